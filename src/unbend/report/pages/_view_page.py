"""A page with one or two meshes, on which landmarks are placed."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._arrays import array_of
from unbend._text import plural
from unbend._types import StrPath
from unbend.choices import Axis
from unbend.io import MeshLike, both_signs, scale_limits, value_colors
from unbend.mesh import Mesh
from unbend.report.figures import check_one_each, check_values, drawable
from unbend.report.pages import _document as parts
from unbend.report.pages._document import Page
from unbend.report.pages._shown import checked_landmarks, pack_places, pack_whole, show

# Saved positions and values are exact to this share of the widest range.
_STEPS = 2**20
_MOST_NAMED = 12  # labels below the shapes
_HINT = (
    "Point at a place to read its vertex; click to place a landmark, drag a landmark to move it. "
    "Drag elsewhere to turn, shift-drag to shift, wheel or + and - to zoom, 0 to start over."
)


def view(
    a: MeshLike,
    b: MeshLike | None = None,
    landmarks: npt.ArrayLike | Mapping[str, Any] | None = None,
    path: StrPath | None = None,
    *,
    values: npt.ArrayLike | None = None,
    label: str = "value",
    note: str = "",
    up: Axis = "y",
) -> Page:
    """Write a page that shows one or two meshes, their vertex numbers and landmarks.

    Landmarks are placed on the page by mouse, touch or keyboard, and saved as the .csv file that
    ``unbend match --landmarks`` reads, or as .mrk.json files for 3D Slicer.

    Parameters
    ----------
    a : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    b : mesh-like, optional
        A second shape: landmarks are then pairs of vertices that correspond.
    landmarks : (l, 2) array_like of int, or (l,) array_like of int, or mapping from str
        Vertices of both shapes, counted from 0; of one shape, its vertices; either perhaps by name.
    values : (n,) array_like of float, int, bool or str, optional
        A value for each vertex of `a`, shown as colours. Floats are numbers, and go from light to
        dark, or from blue (negative) over white to red; others are labels, of fourteen colours in
        turn. NaN, -1 and "" are grey.
    label : str, default="value"
        What such a value is.
    note : str, default=""
        A sentence to show above the shapes.
    path, up
        As for :func:`match_page`.

    Returns
    -------
    Page

    Raises
    ------
    InputError
        If there is no such axis, or landmarks or values do not fit.
    MeshError, FileError
        If a point cloud has no surface, or the file cannot be written.

    Notes
    -----
    At most 60,000 vertices of a shape are drawn, and can become landmarks.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from unbend.report import view
    >>> view(make_sphere(2))
    Page('sphere', 0.1 MB)
    >>> view(make_sphere(2), make_sphere(3), landmarks=[(0, 0), (5, 7)])
    Page('sphere and sphere', 0.1 MB)
    """
    parts.begin_page(path, up)
    meshes = [drawable(one) for one in (a, b) if one is not None]
    names = [mesh.name for mesh in meshes]
    checked = None if values is None else _checked(values, meshes[0])
    packed, lead = [], []
    for i, mesh in enumerate(meshes):
        one, facts = _packed(mesh, None if i else checked, label)
        packed.append(one)
        lead.append(f"{mesh.name}: {'; '.join(facts)}.")
    named = checked_landmarks(landmarks, meshes)
    return parts.make_page(
        " and ".join(names),
        " ".join([*lead, note]).strip(),
        [_pictures(names, up, packed[0]), _table(names)],
        {"shapes": packed, "landmarks": [{"name": name, "at": at} for name, at in named]},
        ("landmarks.js", "view.js"),
        path=path,
        heading=' <span class="arrow">and</span> '.join(map(escape, names)),
    )


def _checked(values: npt.ArrayLike, mesh: Mesh) -> npt.NDArray[Any]:
    """Numbers as floats, or labels of another type, one of each vertex."""
    array = array_of(values, "values")
    if array.dtype.kind not in "biuU":
        return check_values(array, mesh)
    check_one_each(array, mesh)
    return array


def _packed(
    mesh: Mesh, values: npt.NDArray[Any] | None, label: str
) -> tuple[dict[str, Any], list[str]]:
    """Pack a shape, perhaps with values, and tell of it."""
    shown = show(mesh)
    packed = shown.packed() | {"name": mesh.name, "standIns": pack_whole(shown.stand_ins)}
    used = shown.stand_ins >= 0
    apart = mesh.vertices[used] - shown.places[shown.stand_ins[used]]
    packed["reach"] = float(np.linalg.norm(apart, axis=1).max())  # of those that stand for others
    widest = float(np.ptp(shown.places, axis=0).max())
    packed["places"] = pack_places(shown.places, widest / _STEPS or None)
    size = f"{plural(mesh.n_vertices, 'vertex')}, {plural(mesh.n_faces, 'face')}"
    facts = [size, *mesh.notes, *shown.facts]
    if values is None:
        return packed, facts
    packed["label"] = label
    if values.dtype.kind == "f":
        low, high = packed["limits"] = float(np.nanmin(values)), float(np.nanmax(values))
        facts.append("{}: {} to {}".format(label, *_told_apart(low, high)))
        seen = values[shown.ids, None]
        packed["values"] = pack_places(seen, (high - low) / _STEPS or None)
        packed["known"] = pack_whole(np.isfinite(seen))
        if both_signs(low, high):
            packed["colors"] = pack_whole(value_colors(values)[shown.ids])
    else:
        labels, numbers = np.unique(values, return_inverse=True)
        packed["labels"] = labels.tolist()
        facts.append(f"{label}: {plural(len(labels), 'label')}")
        packed["values"] = pack_whole(numbers[shown.ids])
        packed["colors"] = pack_whole(value_colors(values, kind="label")[shown.ids])
    return packed, facts


def _told_apart(low: float, high: float) -> tuple[str, str]:
    """Write the ends of a range with five digits, and those more that both begin with."""
    begun = max(abs(low), abs(high)) / (high - low) if high > low else 1.0
    digits = min(5 + int(np.log10(max(begun, 1.0))), 17)
    return f"{low:.{digits}g}", f"{high:.{digits}g}"


def _pictures(names: list[str], up: str, first: dict[str, Any]) -> str:
    paints, legend = {"2": "plain", "0": "by place"}, ""
    if "values" in first:
        label = first["label"]
        paints = {"1": f"by {label}"} | paints
        legend = parts.hint(f"{escape(label[:1].upper() + label[1:])}: {_legend(first)}.")
    views = [
        parts.canvas(
            f"shape-{side}",
            name,
            f"The shape {name} in three dimensions. Arrow keys move a cursor over its vertices, "
            "Enter places a landmark.",
            f"vertex-{side}",
            f'<button type="button" id="markups-{side}">Save .mrk.json</button><label>'
            f'Load .mrk.json, .fcsv or .pp <input type="file" id="load-{side}" '
            'accept=".json,.fcsv,.pp"></label>',
        )
        for side, name in enumerate(names)
    ]
    paint = parts.select("Colours", "paint", paints)
    return parts.side_by_side(paint, up, views) + legend + parts.hint(_HINT)


def _legend(shape: dict[str, Any]) -> str:
    if "limits" in shape:
        low, high = _told_apart(*scale_limits(*shape["limits"]))
        signed = "colors" in shape
        return f'{low} <span class="scale{" signed" * signed}"></span> {high}'
    labels = shape["labels"]
    colors = map(tuple, value_colors(labels, kind="label").tolist())
    chips = [
        f'<svg class="chip"><rect width="100%" height="100%" fill="rgb{color}"/></svg> '
        f"{escape(str(one)) or 'none'}"
        for one, color in zip(labels[:_MOST_NAMED], colors, strict=False)
    ]
    more = len(labels) - len(chips)
    return ", ".join([*chips, f"and {more:,} more"] if more else chips)


def _table(names: list[str]) -> str:
    heads = "".join(f'<th scope="col">vertex of {escape(name)}</th>' for name in names)
    html = files("unbend.report.pages").joinpath("landmarks.html").read_text("utf-8")
    return parts.section("Landmarks", html.replace("{heads}", heads))
