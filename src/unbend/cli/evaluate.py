"""``unbend evaluate``: how far a map is from the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import unbend
from unbend.choices import GeodesicKind
from unbend.cli import _options as options
from unbend.cli._input import keeps_all, read_truth
from unbend.cli._output import progress_on_stderr, table, tell

_SHOWN = (0.025, 0.05, 0.1, 0.15)


def evaluate(
    map_file: Annotated[str, typer.Argument(metavar="MAP")],
    target: str,
    source_truth: str,
    target_truth: str,
    mirrored_truth: Annotated[str | None, typer.Option(metavar="FILE")] = None,
    distance: GeodesicKind = "geodesic",
    base: options.Base = None,
    figure: options.Figure = None,
) -> None:
    """Measure the geodesic errors of a map against the ground truth, in units of sqrt(target area).

    The protocols are: direct, against the ground truth as given; map-min, the better of the ground
    truth and its reflection for the whole map; vertex-min, the better for each row. For partial
    shapes, -1 in the ground truth means no partner, and the overlap is measured too.

    Options
    -------
      map_file: A map: .npz, .npy, .txt, .csv or .vts.
      target: The mesh that MAP maps to.
      source_truth: Source vertices whose image is known (.vts, .txt, .csv or .npy).
      target_truth: Their true images, row by row.
      mirrored_truth: Their images on the other side, left-right.
      distance: geodesic: heat method, within 1 % on average; geodesic-exact: slow.
      figure: Draw the error curves (.png, .pdf, .svg).

    Examples
    --------
      unbend evaluate map.vts cat1.off cat0.vts cat1.vts
      unbend evaluate map.npz b.off a.vts b.vts --mirrored-truth b.sym.vts --figure curves.png
      unbend evaluate map.npz b.off a.vts b.vts --distance geodesic-exact --json
    """
    with progress_on_stderr() as progress:
        shape = unbend.read_mesh(target)
        if keeps_all(map_file):
            point_map = unbend.read_match(map_file, target=shape).source_to_target
        else:
            point_map = unbend.read_map(map_file, base=base, n_target=shape.n_vertices)
        files = [path for path in (source_truth, target_truth, mirrored_truth) if path is not None]
        sources, *truths = read_truth(files, len(point_map), shape.n_vertices)
        progress(f"{distance} distances", 0)
        found = unbend.evaluate(point_map, shape, sources, *truths, distance=distance)
        if figure is not None:
            unbend.report.draw_error_curves({Path(map_file).stem: found}, figure)
    protocols: dict[str, dict[str, Any]] = {}
    for name in ["direct"] + ["map-min", "vertex-min"] * (found.map_min is not None):
        protocols[name] = {"n_rows": len(found.errors(name))}
        for measure in ("mean", "median", "auc", "curve"):
            protocols[name][measure] = getattr(found, measure)(name)
    told = {"map": map_file, "target": target, "distance": distance, "n_rows": len(found.direct)}
    told |= {"coverage": found.coverage, "overlap": found.overlap}
    told |= {"thresholds": unbend.correspondence.THRESHOLDS, "protocols": protocols}
    columns = [int(abs(unbend.correspondence.THRESHOLDS - shown).argmin()) for shown in _SHOWN]
    cells = [["protocol", "mean", "median", "AUC", *(f"<= {shown:g}" for shown in _SHOWN)]]
    for name, one in protocols.items():
        numbers = f"{one['mean']:.4f}", f"{one['median']:.4f}", f"{one['auc']:.3f}"
        cells.append([name, *numbers, *(f"{one['curve'][i]:.1f} %" for i in columns)])
    counts = f"{len(found.direct):,} rows"
    if found.map_min is not None and len(found.map_min) < len(found.direct):
        counts += f", {len(found.map_min):,} of them with a mirrored truth"
    lines = ["", f"{counts}; {found.coverage:.1%} of the target's area is hit"]
    part = found.overlap
    if part.iou < 1:
        lines.append(
            f"overlap: {part.iou:.1%} intersection over union, {part.precision:.1%} precision, "
            f"{part.recall:.1%} recall"
        )
    lines = table("<>>>>>>>", *cells) + lines
    tell(told, lines, shapes=[shape], written=[figure])
