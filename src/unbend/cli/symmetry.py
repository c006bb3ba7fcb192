"""``unbend symmetry``: which point of a shape is its mirror partner on the other side."""

from __future__ import annotations

import unbend
from unbend.choices import Axis
from unbend.cli import _options as options
from unbend.cli._input import is_unsure, read_shapes, show_match, write_result
from unbend.cli._output import elapsed, progress_on_stderr, rows, tell, warn_if_doubtful


def symmetry(
    mesh: str,
    out: options.MapOut = None,
    min_confidence: options.MinConfidence = None,
    refine: bool = True,
    component: options.Component = None,
    figure: options.Figure = None,
    report: options.Report = None,
    up: Axis = "y",
    cache: options.Cache = True,
) -> None:
    """Find the left-right symmetry of a shape, in any pose: the mirror partner of each vertex.

    The confidence says how likely it is that the shape has such a symmetry and that this is it.

    Options
    -------
      refine: Refine the map on the full mesh.
      figure: Draw the shape twice, mirror partners in one colour (.png, .pdf, .svg).
      report: Write a page on which a place shows its partner on the other side.

    Examples
    --------
      unbend symmetry cat.off -o partners.csv
      unbend symmetry cat.off --report symmetry.html --up z
      unbend transfer cat.off cat.off --map partners.csv --values left.csv -o right.csv
    """
    with progress_on_stderr() as progress:
        (shape,) = read_shapes([mesh], component)
        found = unbend.symmetry(shape, refine=refine, progress=progress)
        seconds = elapsed()
        unsure = is_unsure(found, min_confidence)
        if not unsure:
            progress("writing", 0)
            if out is not None:
                write_result(out, found, (shape, shape))
            show_match((shape, shape), found, figure, report, up=up, progress=progress)
    warn_if_doubtful(found, seen=report is not None and not unsure)
    matched, n = int((found.source_to_target >= 0).sum()), len(found.source_to_target)
    partners = f"{matched:,} of {n:,} vertices of {shape.name}, {seconds:.1f} s"
    way = {"confidence": found.confidence, "orientation": found.orientation}
    tell(
        {"file": mesh, "n_vertices": n, "n_matched": matched, **way},
        rows({"partners": partners, "confidence": f"{found.confidence:.2f}"}),
        shapes=[shape],
        written=[out, figure],
        report=report,
        next_step="add --report HTML to look at it" if out else "add -o PARTNERS.csv to keep them",
        unsure=unsure,
    )
