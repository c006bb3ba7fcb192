"""``unbend demo``: shapes in several poses, before and after they are unbent."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Annotated, Any

import unbend
from unbend.cli import _options as options
from unbend.cli._output import progress, table, tell

if TYPE_CHECKING:
    from unbend._types import FloatArray

    Column = tuple[str, unbend.Mesh, FloatArray, FloatArray, FloatArray]

_POSES = {"dog": ("standing", "galloping", "sitting"), "human": ("standing", "running", "sitting")}
_N_VERTICES = 4000
_COMPARED = 800  # vertices of each shape that the printed comparison looks at


def demo(picture: Annotated[str, options.out("PNG")] = "unbend-demo.png") -> None:
    """Draw a dog and a person in three poses with their canonical forms, and compare them.

      picture: Where to write the picture.

    $ unbend demo
    $ unbend demo -o picture.png
    """
    columns: list[Column] = []
    makers = {"dog": unbend.datasets.make_quadruped, "human": unbend.datasets.make_biped}
    for species, make in makers.items():
        first = upright = None
        for pose in _POSES[species]:
            progress(f"{species}, {pose}", 0)
            mesh = make(pose, n_vertices=_N_VERTICES).mesh
            form = unbend.canonical_form(mesh)
            points, surface = form.points, unbend.lay_into_pose(mesh, form)
            if first is None:
                first, upright = points, mesh.vertices
                colors = unbend.report.position_colors(mesh.vertices)
            # A form is unique up to a rotation or reflection: draw them all one way round.
            rotation, translation = unbend.alignment.procrustes(points, first)
            points = points @ rotation.T + translation
            turn, shift = unbend.alignment.procrustes(surface, upright, reflect=False)
            upright = surface = surface @ turn.T + shift
            columns.append((f"{species}, {pose}", mesh, points, colors, surface))
    progress("comparing", 0)
    pairs = _compare(columns)
    progress("drawing", 0)
    unbend.report.draw_canonical_forms(columns, picture, canonical_view=(30, 20))
    cells = [["", "before", "after"]]
    for pair in sorted(pairs, key=lambda pair: not pair["same_species"]):
        names = f"{pair['first']} - {pair['second']}"
        cells.append([names, f"{pair['before']:.1%}", f"{pair['after']:.1%}"])
    most = max(pair["after"] for pair in pairs if pair["same_species"])
    least = min(pair["after"] for pair in pairs if not pair["same_species"])
    lines = [
        "How far apart two shapes are after the best rigid alignment, in % of their size:",
        "",
        *table("<>>", *cells),
        "",
        f"Unbent, one species differs by {most:.1%} at most between poses, "
        f"two species by {least:.1%} at least.",
    ]
    next_step = "unbend canonical YOUR_MESH -o canonical.ply"
    tell({"pairs": pairs}, lines, written=[picture], next_step=next_step)


def _compare(columns: list[Column]) -> list[dict[str, Any]]:
    """Measure how far apart each two shapes are, as they stand and unbent."""
    import numpy as np

    def scaled(points: FloatArray) -> FloatArray:
        some = points[:: len(points) // _COMPARED]
        some = some - some.mean(axis=0)
        return np.asarray(some / np.sqrt((some**2).sum(axis=1).mean()))

    pairs = []
    for one, other in itertools.combinations(columns, 2):
        names = {"first": one[0].replace(",", ""), "second": other[0].replace(",", "")}
        same = one[0].split(",")[0] == other[0].split(",")[0]
        before = unbend.align(scaled(one[1].vertices), scaled(other[1].vertices)).residual
        after = unbend.align(scaled(one[2]), scaled(other[2])).residual
        pairs.append({**names, "same_species": same, "before": before, "after": after})
    return pairs
