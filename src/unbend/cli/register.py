"""``unbend register``: a template laid onto a scan."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from unbend._text import printable
from unbend.cli._common import (
    BaseOption,
    CacheOption,
    ComponentOption,
    JsonOption,
    parse_component,
    print_json,
    print_notes,
    print_rows,
    steps_on_stderr,
)
from unbend.cli.transfer import found_match

if TYPE_CHECKING:
    from unbend._types import FloatArray
    from unbend.correspondence import Registration

_SUFFIXES = (".ply", ".obj", ".glb", ".off", ".stl")


def register(
    template: Annotated[str, typer.Argument(metavar="TEMPLATE", help="The mesh to deform.")],
    scan: Annotated[str, typer.Argument(metavar="SCAN", help="The mesh to fit it to.")],
    out: Annotated[
        str,
        typer.Option(
            "-o",
            "--out",
            metavar="OUT",
            help="The fitted template: .ply, .obj or .glb, coloured by the distance of each vertex "
            "from the scan, yellow where that is not reached (.ply has the distances too), .off, "
            ".stl.",
        ),
    ],
    map_file: Annotated[
        str | None,
        typer.Option(
            "--map",
            metavar="MAP",
            help="The map from TEMPLATE to SCAN that unbend match wrote, best as .npz. "
            "Without it the shapes are matched first.",
        ),
    ] = None,
    base: BaseOption = None,
    component: ComponentOption = None,
    cache: CacheOption = True,
    as_json: JsonOption = False,
) -> None:
    """Register a template to a scan: deform it so that it lies on the scan's surface.

    The template keeps its vertices and faces, and its shape over holes of the scan. The result is
    in the scan's coordinates and unit.

    \b
    Examples:
      unbend register template.ply scan.ply -o fitted.ply
      unbend register template.obj scan.stl --map template_scan.npz -o fitted.obj
      unbend register template.ply scan.ply -o fitted.glb
      unbend register template.ply scan.ply --component largest -o fitted.ply --json
    """  # noqa: D301
    from unbend.correspondence import register as lay
    from unbend.io import (
        COLOR_SUFFIXES,
        check_writable,
        read_mesh,
        value_colors,
        write_mesh,
    )
    from unbend.preparation import only_component

    check_writable(out, _SUFFIXES)
    start = time.perf_counter()
    with steps_on_stderr() as progress:
        progress("reading", 0)
        chosen = parse_component(component)
        shapes = [only_component(read_mesh(path), chosen) for path in (template, scan)]
        match = found_match(map_file, base, shapes, progress)
        found = lay(
            shapes[0],
            shapes[1],
            match,
            progress=lambda stage, share: progress(f"{stage}, {share:.0%}", 0),
        )
        seconds = time.perf_counter() - start
        progress("writing", 0)
        suffix = Path(out).suffix.lower()
        scalars = {"distance": found.distances} if suffix == ".ply" else None
        colors = None
        if suffix in COLOR_SUFFIXES:
            colors = value_colors(found.distances, limits=(0, found.tolerance))
        write_mesh(out, found.mesh, scalars=scalars, colors=colors)
    for shape in shapes:
        print_notes(shape.notes)
    on = _spread(found, found.distances[found.covered])
    everywhere = _spread(found, found.distances)
    if as_json:
        print_json(
            {
                "template": template,
                "scan": scan,
                "out": out,
                "vertices": found.mesh.n_vertices,
                "covered_vertices": int(found.covered.sum()),
                "coverage": found.coverage,
                "tolerance": found.tolerance,
                "distance_covered": on,
                "distance_all": everywhere,
                "confidence": found.confidence,
                "seconds": seconds,
            }
        )
        return
    unknown = math.isnan(found.confidence)
    print_rows(
        {
            "covered": f"{found.coverage:.1%} of the area, within {found.tolerance:.3g}",
            "distance there": _in_words(on),
            "distance of all": _in_words(everywhere),
            "confidence": "not estimated" if unknown else f"{found.confidence:.2f}, of the match",
            "written": out,
        }
    )
    legend = "" if colors is None else "; its colours are the distance from the scan"
    typer.echo(printable(f"next: open {out} and {scan} together in MeshLab or Blender{legend}"))


def _spread(found: Registration, distances: FloatArray) -> dict[str, Any]:
    """Mean and 95 % quantile of distances, in the scan's unit and in sqrt(area)."""
    import numpy as np

    from unbend.mesh import vertex_areas

    known = distances[np.isfinite(distances)]
    mean, most = (known.mean(), np.quantile(known, 0.95)) if len(known) else (np.nan, np.nan)
    side = np.sqrt(vertex_areas(found.mesh).sum())
    return {
        "mean": float(mean),
        "within_95": float(most),
        "mean_relative": float(mean / side),
        "within_95_relative": float(most / side),
    }


def _in_words(spread: dict[str, Any]) -> str:
    return (
        f"mean {spread['mean']:.3g}, 95 % within {spread['within_95']:.3g} "
        f"({spread['mean_relative']:.2g} and {spread['within_95_relative']:.2g} of sqrt(area))"
    )
