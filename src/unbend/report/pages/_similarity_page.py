"""Pages of many shapes: how alike all are, and which are most like one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from unbend._arrays import array_of, check_choice, listed, numbers_of
from unbend._display import table
from unbend._text import plural
from unbend._types import Progress, StrPath
from unbend.choices import Axis, Measure
from unbend.errors import InputError
from unbend.io import MeshLike, as_mesh, value_colors
from unbend.mesh import Mesh
from unbend.report.collection_figures import checked_table, join_alike
from unbend.report.pages import _document as parts
from unbend.report.pages._document import Page
from unbend.report.pages._shown import pack_places, pack_whole, show

# Pages of more shapes have no table of numbers.
_MOST_TOLD = 30
# Vertices drawn in all, which keeps a page below 8 MB, and of any one shape: at most, to be quick,
# and at least, to be recognised.
_VERTICES_IN_ALL, _MOST_VERTICES, _LEAST_VERTICES = 300_000, 20_000, 1_000
_SIDES = ("first", "second")
MOST_SHAPES = _VERTICES_IN_ALL // _LEAST_VERTICES


def similarity_page(
    shapes: Iterable[MeshLike],
    values: npt.ArrayLike,
    path: StrPath | None = None,
    *,
    measure: Measure = "similarity",
    groups: npt.ArrayLike | None = None,
    up: Axis = "y",
    command: str = "",
    progress: Progress | None = None,
) -> Page:
    """Write how alike shapes are as a page that opens in any browser, without a network.

    It has a heat map, ordered by its dendrogram. Pointing at a cell shows both names and the value;
    a click opens both shapes, which turn together. Below are pictures of all shapes.

    Parameters
    ----------
    shapes : iterable of mesh-like
        Of n shapes, 2 to 300, anything :func:`unbend.as_mesh` accepts. One without faces has no
        picture.
    values : (n, n) array_like of float
        Symmetric and not negative; NaN where unknown.
    measure : {"similarity", "distance"}, default="similarity"
        What the values are: 1 for the same shape, as of :func:`unbend.similarity`, or 0.
    groups : (n,) array_like of int, optional
        The number of each one's group, from 0: the pictures are put together by it.
    path, up, command, progress
        As for :func:`match_page`.

    Returns
    -------
    Page

    Raises
    ------
    InputError, FileError
        If there are too few or too many shapes, something does not fit them, or the file cannot be
        written.

    Notes
    -----
    At most 300,000 vertices are drawn in all, and 20,000 of one shape.

    Examples
    --------
    >>> from unbend.report import similarity_page
    >>> from unbend.datasets import make_quadruped
    >>> animals = [make_quadruped(species=one, n_vertices=600).mesh for one in ("dog", "horse")]
    >>> similarity_page(animals, [[1, 0.9], [0.9, 1]], "similarity.html")
    Page('How alike 2 shapes are', 0.1 MB)
    """
    step = parts.begin_page(path, up, progress)
    shapes = listed(shapes, "shapes")
    check_choice(measure, "measure", get_args(Measure))
    array = checked_table(values, len(shapes))
    numbers = None if groups is None else array_of(groups, "groups")
    if numbers is not None and (
        numbers.shape != (len(shapes),) or numbers.dtype.kind not in "iu" or numbers.min() < 0
    ):
        raise InputError(f"groups must be {len(shapes)} whole numbers from 0")
    meshes, packed, said = _read_shapes(shapes, step)
    names = [one.name for one in meshes]
    order, heights, places = join_alike(array, alike=measure == "similarity")
    others = array[~np.eye(len(array), dtype=bool) & np.isfinite(array)]
    spread = "no pair is known"
    if len(others):
        ends = (_number_told(float(one)) for one in (others.min(), others.max()))
        spread = f"{' to '.join(ends)} between different shapes"
    shades, low, high = array, float(others.min(initial=1.0)), 1.0
    if measure == "distance":  # what is alike is yellow
        shades, low, high = -array, -float(others.max(initial=0.0)), 0.0
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        low = high - 1
    cells = np.full((array.size, 4), 255)  # red, green, blue and opacity
    cells[:, :3] = value_colors(shades[np.ix_(order, order)].ravel(), limits=(low, high))
    blocks = [_heat_map(measure, abs(low), abs(high))]
    if len(names) <= _MOST_TOLD:
        heads = (measure, *(names[j] for j in order))
        rows = [(names[i], *(_number_told(array[i, j]) for j in order)) for i in order]
        blocks.append(f"<details><summary>As a table</summary>{table(rows, heads)}</details>")
    if numbers is None:
        title = f"How alike {len(names):,} shapes are"
        blocks.append(parts.section("Shapes", _cards(names, order)))
    else:
        found = np.unique(numbers)
        title = f"{plural(len(names), 'shape')} in {plural(len(found), 'group')}"
        for number in found:
            members = order[numbers[order] == number]
            heading = f"Group {number}: {plural(len(members), 'shape')}"
            blocks.append(parts.section(heading, _cards(names, members)))
    facts = [
        ("values", f"{measure}, {high:g} for the same shape"),
        ("dendrogram", "Ward's linkage; the most alike stand beside each other"),
        ("for display", said),
    ]
    largest = float(array[np.isfinite(array)].max(initial=0.0)) or 1.0
    known = np.where(np.isfinite(array), array, -largest)
    shares = heights / max(float(heights.max()), 1e-300)
    return parts.make_page(
        title,
        f"{measure.capitalize()} is {spread}.",
        _body(meshes, up, blocks, facts, command),
        {
            "shapes": packed,
            "measure": measure,
            # A millionth of the largest apart; below 0 where they are unknown.
            "table": pack_places(known.reshape(-1, 1), 1e-6 * largest),
            "cells": pack_whole(cells),
            # What tells values apart.
            "digits": min(math.ceil(-math.log10((high - low) / 50)), 4),
            "order": order.tolist(),
            "tree": np.round(np.stack([shares, places], axis=2), 4).tolist(),
        },
        ("heat.js", "shapes.js"),
        path=path,
    )


def search_page(
    query: MeshLike,
    found: Iterable[MeshLike],
    values: npt.ArrayLike,
    path: StrPath | None = None,
    *,
    measure: str = "distance",
    up: Axis = "y",
    command: str = "",
    progress: Progress | None = None,
) -> Page:
    """Write the shapes that are most like one as a page of pictures, without a network.

    Each picture tells its shape's name and value; chosen, it turns beside the query.

    Parameters
    ----------
    query : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    found : iterable of mesh-like
        The most alike first; 299 at most. One without faces has no picture.
    values : (n,) array_like of float
        How far each is from the query, or how much like it; NaN where unknown.
    measure : str, default="distance"
        What the values are called.
    path, up, command, progress
        As for :func:`match_page`.

    Returns
    -------
    Page

    Raises
    ------
    InputError, FileError
        If there is nothing or too much to show, something does not fit, or the file cannot be
        written.

    Examples
    --------
    >>> from unbend.report import search_page
    >>> from unbend.datasets import make_quadruped
    >>> dog, horse = (make_quadruped(species=one, n_vertices=600).mesh for one in ("dog", "horse"))
    >>> search_page(dog, [dog, horse], [0, 0.4], "found.html")
    Page('Most like dog', 0.1 MB)
    """
    step = parts.begin_page(path, up, progress)
    found, numbers = list(found), numbers_of(values, "values")
    if numbers.shape != (len(found),) or not len(found):
        raise InputError(f"{len(found)} shapes need as many values, and there must be one at least")
    meshes, packed, said = _read_shapes([query, *found], step)
    names = [one.name for one in meshes]
    below = [f"{i + 1}. {measure} {_number_told(one)}" for i, one in enumerate(numbers)]
    blocks = [
        parts.section("Looked for", _cards(names, [0])),
        parts.section("Found", _cards(names, range(1, len(names)), below)),
    ]
    known = [float(one) if np.isfinite(one) else None for one in numbers]
    return parts.make_page(
        f"Most like {names[0]}",
        f"{plural(len(found), 'shape')}, the most alike first.",
        _body(meshes, up, blocks, [("for display", said)], command),
        {"shapes": packed, "measure": measure, "values": [None, *known]},
        ("heat.js", "shapes.js"),
        path=path,
    )


def _heat_map(measure: str, least: float, most: float) -> str:
    described = (
        f"The {measure} of each shape to each other as colours, with a dendrogram beside it. Arrow "
        "keys go from cell to cell, Enter opens both shapes; names and value are told beside it."
    )
    return parts.section(
        measure.capitalize(),
        f'<canvas id="heat" tabindex="0" role="application" aria-label="{described}"></canvas>',
        parts.hint(
            f'{measure} {_number_told(least)} <span class="scale viridis"></span> '
            f"{_number_told(most)}. "
            "Point at a cell to read it, click it to see both shapes; or go from cell to cell with "
            "the arrow keys, and open both with Enter."
        ),
    )


def check_count(n: int) -> None:
    """Raise InputError if there are more shapes than a page holds, before they are read."""
    if n > MOST_SHAPES:
        raise InputError(
            f"a page shows {MOST_SHAPES} shapes at most, not {n:,}: their surfaces would be too "
            "coarse or the file too large; write a table or a figure instead"
        )


def _read_shapes(
    shapes: Sequence[MeshLike], step: Progress
) -> tuple[list[Mesh], list[dict[str, Any]], str]:
    """Read shapes, no more than a page holds, and pack them, with a sentence on decimation.

    A mesh without faces has no picture.
    """
    check_count(len(shapes))
    meshes = [as_mesh(one) for one in shapes]
    most = min(_MOST_VERTICES, _VERTICES_IN_ALL // len(meshes))
    packed, thinned = [], 0
    for i, mesh in enumerate(meshes):
        step("page, shapes", i / len(meshes))
        facts = "; ".join([f"{mesh.n_vertices:,} vertices, {mesh.n_faces:,} faces", *mesh.notes])
        drawn = None
        if mesh.n_faces:
            shown = show(mesh, most)
            thinned += shown.is_thinned
            drawn = {"places": pack_places(shown.places), "faces": pack_whole(shown.faces)}
        packed.append({"name": mesh.name, "told": facts, "drawn": drawn})
    said = "all shapes are drawn as they are"
    if thinned:
        said = (
            f"{thinned:,} of {len(meshes):,} shapes are drawn with {most:,} vertices; "
            "results were computed on all of them"
        )
    return meshes, packed, said


def _body(
    meshes: Sequence[Mesh],
    up: str,
    blocks: Sequence[str],
    rows: Sequence[tuple[str, str]],
    command: str,
) -> list[str]:
    """Put HTML blocks beside two shapes, below controls and above facts on what was done."""
    names = {str(i): mesh.name for i, mesh in enumerate(meshes)}
    choices = "".join(parts.select(side.capitalize(), f"{side}-choice", names) for side in _SIDES)
    views = "".join(parts.canvas(one, one.capitalize(), f"The {one} shape.") for one in _SIDES)
    usage = parts.readout("Choose a picture or a name to see a shape here.")
    noted = [(one.name, "; ".join(one.notes)) for one in meshes if one.notes]
    return [
        parts.controls(choices, up, grid=False),
        f'<div class="beside">\n<div>{"".join(blocks)}</div>\n'
        f'<div class="views">{views}{usage}</div>\n</div>\n'
        '<canvas id="maker" aria-hidden="true"></canvas>',  # off screen, for the pictures
        parts.how_made([*rows, *noted], command),
    ]


def _cards(names: Sequence[str], chosen: Iterable[int], below: Sequence[str] = ()) -> str:
    """Buttons with pictures of some shapes, their names and perhaps a line below each."""
    made = []
    for k, i in enumerate(chosen):
        line = f"<small>{escape(below[k])}</small>" if below else ""
        made.append(
            f'<button type="button" class="card" data-shape="{i}" aria-pressed="false"><canvas>'
            f"</canvas><span>{escape(names[i])}</span>{line}</button>"
        )
    return f'<div class="cards">{"".join(made)}</div>'


def _number_told(value: float) -> str:
    """Format a number that may be unknown, as the page does."""
    if not np.isfinite(value):
        return "unknown"
    return f"{value:.4f}" if value == 0 or abs(value) >= 1e-3 else f"{value:#.4g}"
