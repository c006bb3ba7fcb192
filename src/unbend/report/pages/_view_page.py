"""A page with one or two meshes, on which landmarks are placed."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._text import plural
from unbend._types import FloatArray, StrPath
from unbend.choices import Axis
from unbend.io import MeshLike
from unbend.mesh import Mesh
from unbend.report.figures import check_values, drawable
from unbend.report.pages import _document as parts
from unbend.report.pages._document import Page
from unbend.report.pages._shown import checked_landmarks, pack_places, pack_whole, show

# Saved positions and values are exact to this share of the widest range.
_STEPS = 2**20
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
    values : (n,) array_like of float, optional
        A number for each vertex of `a`, shown as colours; NaN is grey.
    label : str, default="value"
        What such a number is.
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
    scalars = None if values is None else check_values(values, meshes[0])
    packed, lead = [], []
    for i, mesh in enumerate(meshes):
        one, facts = _packed(mesh, None if i else scalars, label)
        packed.append(one)
        lead.append(f"{mesh.name}: {'; '.join(facts)}.")
    named = checked_landmarks(landmarks, meshes)
    return parts.make_page(
        " and ".join(names),
        " ".join([*lead, note]).strip(),
        [_pictures(names, up, packed[0].get("limits"), label), _table(names)],
        {"shapes": packed, "landmarks": [{"name": name, "at": at} for name, at in named]},
        ("landmarks.js", "view.js"),
        path=path,
        heading=' <span class="arrow">and</span> '.join(map(escape, names)),
    )


def _packed(mesh: Mesh, scalars: FloatArray | None, label: str) -> tuple[dict[str, Any], list[str]]:
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
    if scalars is not None:
        low, high = limits = float(np.nanmin(scalars)), float(np.nanmax(scalars))
        facts.append("{}: {} to {}".format(label, *_told_apart(low, high)))
        seen = scalars[shown.ids, None]
        packed["values"] = pack_places(seen, (high - low) / _STEPS or None)
        packed["known"] = pack_whole(np.isfinite(seen))
        packed |= {"limits": limits, "label": label}
    return packed, facts


def _told_apart(low: float, high: float) -> tuple[str, str]:
    """Write the ends of a range with five digits, and those more that both begin with."""
    begun = max(abs(low), abs(high)) / (high - low) if high > low else 1.0
    digits = min(5 + int(np.log10(max(begun, 1.0))), 17)
    return f"{low:.{digits}g}", f"{high:.{digits}g}"


def _pictures(names: list[str], up: str, limits: tuple[float, float] | None, label: str) -> str:
    paints, legend = {"2": "plain", "0": "by place"}, ""
    if limits is not None:
        paints = {"1": f"by {label}"} | paints
        low, high = _told_apart(*limits)
        begin = escape(f"{label[:1].upper()}{label[1:]}: {low}")
        legend = parts.hint(f'{begin} <span class="scale"></span> {high}.')
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


def _table(names: list[str]) -> str:
    heads = "".join(f'<th scope="col">vertex of {escape(name)}</th>' for name in names)
    html = files("unbend.report.pages").joinpath("landmarks.html").read_text("utf-8")
    return parts.section("Landmarks", html.replace("{heads}", heads))
