"""``unbend register``: fit a template to a scan."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from unbend.cli import _options as options
from unbend.cli._input import read_or_match, read_shapes
from unbend.cli._output import lines_to_keep, progress_on_stderr, rows, tell

if TYPE_CHECKING:
    from unbend._types import FloatArray
    from unbend.correspondence import Registration


def register(
    template: Annotated[str, typer.Argument(metavar="TEMPLATE", help="The mesh to deform.")],
    scan: Annotated[str, typer.Argument(metavar="SCAN", help="The mesh to fit it to.")],
    out: Annotated[
        str,
        options.out(
            "The fitted template: .ply, .obj, .glb or .vtp, coloured by the distance of each "
            "vertex from the scan, yellow where that is not reached (.ply and .vtp have the "
            "distances too), .off, .stl. From .obj to .obj only positions change: texture, "
            "materials, groups and polygons stay."
        ),
    ],
    map_file: options.Map = None,
    base: options.Base = None,
    partial: options.Partial = "auto",
    landmarks: options.Landmarks = None,
    save_match: options.SaveMatch = None,
    min_confidence: options.MinConfidence = None,
    component: options.Component = None,
    report: Annotated[
        str | None,
        options.report(
            "Write a page for a browser: the fitted template, coloured by its distance from the "
            "scan, beside the scan."
        ),
    ] = None,
    up: options.Up = "y",
    cache: options.Cache = True,
) -> None:
    """Register a template to a scan: deform it so that it lies on the scan's surface.

    The template keeps its vertices and faces, and its shape over holes of the scan. The result is
    in the scan's coordinates and unit.

    Examples
    --------
      unbend register template.ply scan.ply -o fitted.ply
      unbend register template.obj scan.stl --map template_scan.npz -o fitted.obj
      unbend register template.ply torn.ply --partial target --save-match map.npz -o fitted.ply
      unbend register template.ply scan.ply --landmarks hints.csv -o fitted.glb
      unbend register template.ply scan.ply --min-confidence 0.7 -o fitted.ply --json
    """
    from unbend.correspondence import register as fit_template
    from unbend.io import COLOR_SUFFIXES, SCALAR_SUFFIXES, check_writable, value_colors, write_mesh

    check_writable(out, (".ply", ".obj", ".glb", ".vtp", ".off", ".stl"))
    with progress_on_stderr() as progress:
        progress("reading", 0)
        shapes = read_shapes((template, scan), component)
        match = read_or_match(
            shapes,
            map_file,
            base=base,
            partial=partial,
            landmarks=landmarks,
            save_match=save_match,
            min_confidence=min_confidence,
            progress=progress,
        )
        found = fit_template(shapes[0], shapes[1], match, progress=progress)
        progress("writing", 0)
        suffix = Path(out).suffix.lower()
        scalars = {"distance": found.distances} if suffix in SCALAR_SUFFIXES else None
        like = lines_to_keep(out, template, whole=component is None)
        colors = None
        if suffix in COLOR_SUFFIXES and like is None:
            colors = value_colors(found.distances, limits=(0, found.tolerance))
        write_mesh(out, found.mesh, scalars=scalars, colors=colors, like=like)
        if report is not None:
            from unbend.report import view

            view(found.mesh, shapes[1], path=report, values=found.distances, up=up)
    on = _spread(found, found.distances[found.covered])
    everywhere = _spread(found, found.distances)
    unknown = math.isnan(found.confidence)
    lines = {
        "covered": f"{found.coverage:.1%} of the area, within {found.tolerance:.3g}",
        "distance there": _in_words(on),
        "distance of all": _in_words(everywhere),
        "confidence": "not estimated" if unknown else f"{found.confidence:.2f}, of the match",
    }
    legend = "" if colors is None else "; its colours are the distance from the scan"
    tell(
        {
            "template": template,
            "scan": scan,
            "n_vertices": found.mesh.n_vertices,
            "n_covered": int(found.covered.sum()),
            "coverage": found.coverage,
            "tolerance": found.tolerance,
            "distance_covered": on,
            "distance_all": everywhere,
            "confidence": found.confidence,
        },
        rows(lines),
        shapes=shapes,
        written=[out, save_match, report],
        next_step=f"open {out} and {scan} together in MeshLab or Blender{legend}",
    )


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
