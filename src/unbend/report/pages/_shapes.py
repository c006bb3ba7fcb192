"""Common parts of the pages of many shapes: pictures to choose from, and two shapes that turn."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from unbend._types import Progress
from unbend.errors import InputError
from unbend.io import MeshLike, as_mesh
from unbend.mesh import Mesh
from unbend.report.pages._document import canvas, controls, how_made, readout, select
from unbend.report.pages._packing import pack_places, pack_whole
from unbend.report.pages._shown import show

# Vertices drawn in all, which keeps a page below 8 MB, and of any one shape: at most, to be quick,
# and at least, to be recognised.
_VERTICES_IN_ALL, _MOST_VERTICES, _LEAST_VERTICES = 300_000, 20_000, 1_000
_SIDES = ("first", "second")
MOST_SHAPES = _VERTICES_IN_ALL // _LEAST_VERTICES

_HINT = (
    "Choose a picture or a name to see a shape here. Drag to turn, shift-drag to shift, wheel or + "
    "and - to zoom, arrow keys to turn, 0 to start over."
)


def check_count(n: int) -> None:
    """Raise InputError if there are more shapes than a page holds, before they are read."""
    if n > MOST_SHAPES:
        raise InputError(
            f"a page shows {MOST_SHAPES} shapes at most, not {n:,}: their surfaces would be too "
            "coarse or the file too large"
        )


def read_shapes(
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
            thinned += len(shown.ids) < (shown.stand_ins >= 0).sum()
            drawn = {
                "places": pack_places(mesh.vertices[shown.ids]),
                "faces": pack_whole(shown.faces),
            }
        packed.append({"name": mesh.name, "told": facts, "drawn": drawn})
    said = "all shapes are drawn as they are"
    if thinned:
        said = (
            f"{thinned:,} of {len(meshes):,} shapes are drawn with {most:,} vertices; "
            "results were computed on all of them"
        )
    return meshes, packed, said


def body(
    meshes: Sequence[Mesh],
    up: str,
    blocks: Sequence[str],
    rows: Sequence[tuple[str, str]],
    command: str,
) -> list[str]:
    """Put HTML blocks beside two shapes, below controls and above facts on what was done."""
    names = {str(i): mesh.name for i, mesh in enumerate(meshes)}
    choices = "".join(select(side.capitalize(), f"{side}-choice", names) for side in _SIDES)
    views = "".join(canvas(one, one.capitalize(), f"The {one} shape.") for one in _SIDES)
    noted = [(one.name, "; ".join(one.notes)) for one in meshes if one.notes]
    return [
        controls(choices, up, grid=False),
        f'<div class="beside">\n<div>{"".join(blocks)}</div>\n'
        f'<div class="views">{views}{readout(_HINT)}</div>\n</div>\n'
        '<canvas id="maker" aria-hidden="true"></canvas>',  # off screen, for the pictures
        how_made([*rows, *noted], command),
    ]


def cards(names: Sequence[str], chosen: Sequence[int], below: Sequence[str] = ()) -> str:
    """Buttons with pictures of some shapes, their names and perhaps a line below each."""
    made = []
    for k, i in enumerate(chosen):
        line = f"<small>{escape(below[k])}</small>" if below else ""
        made.append(
            f'<button type="button" class="card" data-shape="{i}" aria-pressed="false"><canvas>'
            f"</canvas><span>{escape(names[i])}</span>{line}</button>"
        )
    return f'<div class="cards">{"".join(made)}</div>'


def number_told(value: float) -> str:
    """Format a number that may be unknown."""
    return f"{value:.4f}" if np.isfinite(value) else "unknown"
