"""What pages of many shapes have in common: pictures to choose from, and two that turn."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any, get_args

import numpy as np

from unbend._display import table
from unbend._types import Progress
from unbend.choices import Axis
from unbend.errors import InputError
from unbend.io import MeshLike, as_mesh
from unbend.mesh import Mesh
from unbend.report.pages._document import canvas, section
from unbend.report.pages._packing import pack_places, pack_whole
from unbend.report.pages._shown import show

# So many vertices are drawn in all, which keeps a page below 8 MB, and no more of any one shape;
# shapes of fewer than the least could not be told apart.
_VERTICES_IN_ALL, _MOST_VERTICES, _LEAST_VERTICES = 300_000, 20_000, 1_000
MOST_SHAPES = _VERTICES_IN_ALL // _LEAST_VERTICES

_HINT = (
    "Choose a picture or a name to see a shape here. Drag to turn, shift-drag to shift, wheel or + "
    "and - to zoom, arrow keys to turn, 0 to start over."
)


def check_count(n: int) -> None:
    """Refuse more shapes than a page holds, before they are read.

    Raises
    ------
    InputError
        If there are more.
    """
    if n > MOST_SHAPES:
        raise InputError(
            f"a page shows {MOST_SHAPES} shapes at most, not {n:,}: their surfaces would be too "
            "coarse or the file too large"
        )


def read_shapes(shapes: Sequence[MeshLike], up: str) -> list[Mesh]:
    """Take whatever was given as meshes, no more than a page holds.

    Raises
    ------
    InputError
        If there are too many, or there is no such axis.
    """
    if up not in get_args(Axis):
        raise InputError(f'up must be "x", "y" or "z", not {up!r}')
    check_count(len(shapes))
    return [as_mesh(one) for one in shapes]


def pack_shapes(meshes: Sequence[Mesh], progress: Progress | None) -> tuple[list[Any], str]:
    """Pack shapes as they are drawn, and say in a sentence how they were thinned, if they were.

    A mesh without faces has nothing to draw, and no picture.
    """
    step = progress or (lambda stage, share: None)
    most = min(_MOST_VERTICES, _VERTICES_IN_ALL // len(meshes))
    packed, thinned = [], 0
    for i, mesh in enumerate(meshes):
        step("page, shapes", i / len(meshes))
        told = "; ".join([f"{mesh.n_vertices:,} vertices, {mesh.n_faces:,} faces", *mesh.notes])
        drawn = None
        if mesh.n_faces:
            shown = show(mesh, most)
            thinned += len(shown.ids) < (shown.stand_ins >= 0).sum()
            drawn = {
                "places": pack_places(mesh.vertices[shown.ids]),
                "faces": pack_whole(shown.faces),
            }
        packed.append({"name": mesh.name, "told": told, "drawn": drawn})
    said = "all shapes are drawn as they are"
    if thinned:
        said = (
            f"{thinned:,} of {len(meshes):,} shapes are drawn with {most:,} vertices; "
            "results were computed on all of them"
        )
    return packed, said


def controls(names: Sequence[str], up: str) -> str:
    """Make what two shapes are chosen and turned with."""
    axes = "".join(f"<option{' selected' * (axis == up)}>{axis}</option>" for axis in "xyz")
    choices = "".join(f'<option value="{i}">{escape(one)}</option>' for i, one in enumerate(names))
    return (
        '<div class="controls" role="group" aria-label="Controls">'
        f'<label>First <select class="name" id="first-choice">{choices}</select></label>'
        f'<label>Second <select class="name" id="second-choice">{choices}</select></label>'
        '<label><input type="checkbox" id="linked" checked> turn together</label>'
        f'<label>up <select id="up">{axes}</select></label>'
        '<button type="button" id="reset">Reset view</button></div>'
    )


def beside(blocks: Sequence[str]) -> str:
    """Put blocks beside the two shapes that turn."""
    views = "".join(canvas(one, one.capitalize(), f"The {one} shape.") for one in _SIDES)
    return (
        f'<div class="beside">\n<div>{"".join(blocks)}</div>\n'
        f'<div class="views">{views}<p class="readout" id="readout" aria-live="polite">'
        f"{escape(_HINT)}</p></div>\n</div>\n"
        '<canvas id="maker" aria-hidden="true"></canvas>'  # where pictures are drawn
    )


_SIDES = ("first", "second")


def cards(names: Sequence[str], chosen: Sequence[int], below: Sequence[str] = ()) -> str:
    """Make a picture to choose for each of some shapes, with its name and perhaps a line below."""
    made = []
    for k, i in enumerate(chosen):
        line = f"<small>{escape(below[k])}</small>" if below else ""
        made.append(
            f'<button type="button" class="card" data-shape="{i}" aria-pressed="false"><canvas>'
            f"</canvas><span>{escape(names[i])}</span>{line}</button>"
        )
    return f'<div class="cards">{"".join(made)}</div>'


def facts(meshes: Sequence[Mesh], rows: Sequence[tuple[str, str]], command: str) -> str:
    """Say what is shown, what was done to it, and by which command."""
    noted = [(one.name, "; ".join(one.notes)) for one in meshes if one.notes]
    made = f"<pre><code>{escape(command)}</code></pre>" if command else ""
    return section("How it was made", table([*rows, *noted]), made)


def number_told(value: float) -> str:
    """Write a number that may be unknown."""
    return f"{value:.4f}" if np.isfinite(value) else "unknown"
