"""``unbend evaluate``: how far a map is from the ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import unbend
from unbend.choices import GeodesicKind
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.cli._input import read_given, read_shapes, read_truth

_ENOUGH = 10  # rows of ground truth, with which a map that counts from the other base shows
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

      map_file: A map: .npz, .npy, .txt, .csv or .vts.
      target: The mesh that MAP maps to.
      source_truth: Source vertices whose image is known (.vts, .txt, .csv or .npy).
      target_truth: Their true images, row by row.
      mirrored_truth: Their images on the other side, left-right.
      distance: geodesic: the heat method, whose means of small errors are within 2 % of exact
          ones; geodesic-exact: exact, but slow.
      figure: Draw the error curves (.png, .pdf, .svg).

    $ unbend evaluate map.vts cat1.off cat0.vts cat1.vts
    $ unbend evaluate map.npz b.off a.vts b.vts --mirrored-truth b.sym.vts --figure curves.png
    $ unbend evaluate map.npz b.off a.vts b.vts --distance geodesic-exact --json
    """
    (shape,) = read_shapes([target])
    given = read_given(map_file, base, None, shape)
    point_map = given.source_to_target if isinstance(given, unbend.Match) else given
    files = source_truth, target_truth, mirrored_truth
    sources, *truths = read_truth(files, len(point_map), shape.n_vertices)
    if base is None and point_map is given and len(sources) >= _ENOUGH:
        error = unbend.io.straight_error(shape, sources, truths[0])
        unbend.io.refuse_other_base(map_file, point_map, shape.n_vertices, error)
    unbend.io.warn_of_truth(files[:2], point_map, shape, sources, truths[0])
    found = unbend.evaluate(
        point_map, shape, sources, *truths, distance=distance, progress=output.progress
    )
    if figure is not None:
        unbend.report.draw_error_curves({Path(map_file).stem: found}, figure)
    thresholds = unbend.correspondence.THRESHOLDS
    columns = [int(abs(thresholds - shown).argmin()) for shown in _SHOWN]
    cells = [["protocol", "mean", "median", "AUC", *(f"<= {shown:g}" for shown in _SHOWN)]]
    protocols: dict[str, Any] = {}
    for name in ["direct"] + ["map-min", "vertex-min"] * (found.map_min is not None):
        mean, median, auc = found.mean(name), found.median(name), found.auc(name)
        curve = found.curve(name)
        cells.append([name, f"{mean:.4f}", f"{median:.4f}", f"{auc:.3f}"])
        cells[-1] += [f"{curve[i]:.1f}%" for i in columns]
        measures = {"mean": mean, "median": median, "auc": auc, "curve": curve}
        protocols[name] = {"n_rows": len(found.errors(name)), **measures}
    told = {"map": map_file, "target": target, "distance": distance, "n_rows": len(found.direct)}
    told |= {"coverage": found.coverage, "overlap": found.overlap}
    told |= {"thresholds": thresholds, "protocols": protocols}
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
    lines = output.table("<>>>>>>>", *cells) + lines
    output.tell(told, lines, shapes=[shape], written=[figure])
