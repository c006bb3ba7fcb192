"""``unbend match``: which point of one shape is which of another."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from unbend.choices import Axis, Partial
from unbend.cli._common import (
    CacheOption,
    ComponentOption,
    JsonOption,
    MapOutOption,
    SourceArgument,
    TargetArgument,
    UpOption,
    command_line,
    parse_component,
    print_json,
    print_notes,
    print_rows,
    print_written,
    quoted,
    read_truth,
    steps_on_stderr,
    warn_if_doubtful,
)

if TYPE_CHECKING:
    from unbend.matching import Match
    from unbend.mesh import Mesh

# A map that is not sure of its side has about as much of the surface on either.
_CLEAR_SIDE = 0.1


def match(
    source: SourceArgument,
    target: TargetArgument,
    out: MapOutOption = None,
    partial: Annotated[
        Partial,
        typer.Option(
            "--partial",
            help="Which shape may be partial: torn, cut, or seen from one side; auto: those "
            "with a boundary.",
        ),
    ] = "auto",
    landmarks: Annotated[
        str | None,
        typer.Option(
            "--landmarks",
            metavar="CSV",
            help="Landmarks: on each line a source vertex and a target vertex, counted from 0.",
        ),
    ] = None,
    n_matches: Annotated[
        int,
        typer.Option(
            "--n-matches", metavar="N", help="Write the N best distinct maps: MAP, MAP-2, MAP-3 ..."
        ),
    ] = 1,
    n_eigenpairs: Annotated[
        int, typer.Option("--n-eigenpairs", help="Eigenfunctions of each shape.")
    ] = 150,
    allow_mirror: Annotated[
        bool, typer.Option("--allow-mirror", help="Let the map turn the surface inside out.")
    ] = False,
    refine: Annotated[
        bool, typer.Option("--refine/--no-refine", help="Refine the map on the full meshes.")
    ] = True,
    component: ComponentOption = None,
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure",
            metavar="PNG",
            help="Draw both shapes (.png, .pdf, .svg), corresponding points in one colour.",
        ),
    ] = None,
    colored: Annotated[
        tuple[str, str] | None,
        typer.Option(
            "--colored",
            metavar="OUT OUT",
            help="Write both shapes (.ply, .obj, .glb), corresponding points in one colour, for "
            "Blender and MeshLab.",
        ),
    ] = None,
    report: Annotated[
        str | None,
        typer.Option(
            "--report",
            metavar="HTML",
            help="Write a page to look at the match in a browser: both shapes turn together, and a "
            "place on one shows its partner on the other.",
        ),
    ] = None,
    source_truth: Annotated[
        str | None,
        typer.Option(
            "--source-truth",
            metavar="FILE",
            help="Source vertices whose image is known: the report then shows the errors.",
        ),
    ] = None,
    target_truth: Annotated[
        str | None,
        typer.Option("--target-truth", metavar="FILE", help="Their true images, row by row."),
    ] = None,
    mirrored_truth: Annotated[
        str | None,
        typer.Option("--mirrored-truth", metavar="FILE", help="Their images on the other side."),
    ] = None,
    up: UpOption = "y",
    cache: CacheOption = True,
    as_json: JsonOption = False,
) -> None:
    """Match two shapes: find the target vertex of each source vertex.

    The shapes may have different poses and different meshes. Nothing is random: the same meshes
    give the same map.

    \b
    Examples:
      unbend match cat0.off cat1.off -o cat0_cat1.npz --figure match.png
      unbend match cat0.off cat1.off -o cat0_cat1.vts
      unbend match cat0.off cat1.off --report match.html --up z
      unbend match cat0.off cat1.off --colored cat0.glb cat1.glb
      unbend match scan.ply model.ply --component largest --json
      unbend match torn.ply model.ply --partial source -o torn.npz
      unbend match a.ply b.ply --landmarks hints.csv --n-matches 3 -o map.npz
    """  # noqa: D301
    from unbend.errors import InputError
    from unbend.io import (
        COLOR_SUFFIXES,
        MAP_SUFFIXES,
        check_writable,
        read_landmarks,
        read_mesh,
    )
    from unbend.matching import match as find_match
    from unbend.preparation import only_component

    if out is not None:
        check_writable(out, (".npz", *MAP_SUFFIXES))
    if figure is not None:
        check_writable(figure, (".png", ".pdf", ".svg"))
    if report is not None:
        check_writable(report, (".html",))
    for path in colored or ():
        check_writable(path, COLOR_SUFFIXES)
    if colored is not None and os.path.realpath(colored[0]) == os.path.realpath(colored[1]):
        raise InputError(f"--colored needs two files, and both are {colored[0]}")
    truth_files = _truth_files(report, source_truth, target_truth, mirrored_truth)
    start = time.perf_counter()
    with steps_on_stderr() as progress:
        progress("reading", 0)
        chosen = parse_component(component)
        shapes = [only_component(read_mesh(path), chosen) for path in (source, target)]
        n_vertices = [shape.n_vertices for shape in shapes]
        hints = None if landmarks is None else read_landmarks(landmarks, *n_vertices)
        truth = read_truth(truth_files, *n_vertices) if truth_files else None
        found = find_match(
            *shapes,
            partial=partial,
            landmarks=hints,
            n_matches=n_matches,
            n_eigenpairs=n_eigenpairs,
            refine=refine,
            allow_mirror=allow_mirror,
            barycentric=any((figure, report, colored, _keeps_all(out))),
            progress=lambda stage, share: progress(f"{stage}, {share:.0%}", 0),
        )
        seconds = time.perf_counter() - start
        if out is not None:
            progress("writing", 0)
            for i, one in enumerate((found, *found.alternatives)):
                write_result(_numbered(out, i), one)
        if colored is not None:
            progress("writing", 0)
            _write_colored(shapes, found, colored)
        if figure is not None:
            progress("drawing", 0)
            _draw(shapes, found, figure, up)
        if report is not None:
            from unbend.report.pages import match_page

            match_page(
                shapes[0],
                shapes[1],
                found,
                report,
                up=up,
                truth=truth,
                command=command_line(),
                progress=progress,
            )
    for shape in shapes:
        print_notes(shape.notes)
    warn_if_doubtful(found.confidence)
    if as_json:
        print_json(
            {
                "source": source,
                "target": target,
                "out": out,
                "figure": figure,
                "colored": colored,
                "report": report,
                "source_vertices": len(found.source_to_target),
                "target_vertices": len(found.target_to_source),
                "matched": int((found.source_to_target >= 0).sum()),
                "overlap_source": found.overlap_source,
                "overlap_target": found.overlap_target,
                "missed_landmarks": list(found.missed_landmarks),
                "alternatives": [
                    {
                        "out": out and _numbered(out, i + 1),
                        "confidence": one.confidence,
                        "confidence_bound": one.confidence_bound,
                        "orientation": one.orientation,
                        "overlap_source": one.overlap_source,
                        "overlap_target": one.overlap_target,
                    }
                    for i, one in enumerate(found.alternatives)
                ],
                "orientation": found.orientation,
                "residual": found.residual,
                "confidence": found.confidence,
                "confidence_bound": found.confidence_bound,
                "hypotheses": [vars(one) for one in found.hypotheses],
                "seconds": seconds,
            }
        )
        return
    print_rows(summary(shapes, found, seconds))
    for i, one in enumerate(found.alternatives):
        where = f", {_numbered(out, i + 1)}" if out else ""
        typer.echo(f"or, at confidence {one.confidence:.2f}, another map{where}")
    print_written(out, figure, *(colored or ()))
    typer.echo(f"next: {_next_step(source, target, out, report)}")


def _truth_files(report: str | None, *paths: str | None) -> list[str]:
    """Check that truths go together, and with a report."""
    from unbend.errors import InputError

    given = [path for path in paths if path is not None]
    if given and (report is None or None in paths[:2]):
        raise InputError(
            "ground truth is shown by --report, and needs both --source-truth and --target-truth"
        )
    return given


def summary(shapes: list[Mesh], found: Match, seconds: float) -> dict[str, str]:
    """Name the results."""
    matched, all_of_it = int((found.source_to_target >= 0).sum()), len(found.source_to_target)
    count = f"{matched:,}" if matched == all_of_it else f"{matched:,} of {all_of_it:,}"
    trust = f"{found.confidence:.2f}"
    if found.confidence_bound < 1:
        trust += f" (limited to {found.confidence_bound:.2f} by errors of the final map)"
    return {
        "matched": f"{count} vertices of {shapes[0].name} to {shapes[1].name}, {seconds:.1f} s",
        "overlap": f"{found.overlap_source:.0%} of the source's area, {found.overlap_target:.0%} "
        "of the target's",
        "orientation": f"{found.orientation:+.2f}, {describe_side(found.orientation)}",
        "confidence": trust,
    }


def describe_side(orientation: float) -> str:
    """Say whether a map keeps the surface right side out."""
    if abs(orientation) < _CLEAR_SIDE:
        return "unclear which side is out"
    return "right side out" if orientation > 0 else "inside out, a reflection"


def write_result(out: str, found: Match) -> None:
    """Write all of a match to a .npz file, or its point map to any other."""
    from unbend.correspondence import write_match
    from unbend.io import write_map

    if _keeps_all(out):
        write_match(out, found)
    else:
        write_map(out, found.source_to_target)


def _numbered(out: str, i: int) -> str:
    """Name the file of the i-th way to match: ``map.npz``, ``map-2.npz`` and so on."""
    path = Path(out)
    return out if i == 0 else str(path.with_name(f"{path.stem}-{i + 1}{path.suffix}"))


def _keeps_all(out: str | None) -> bool:
    return out is not None and Path(out).suffix.lower() == ".npz"


def _draw(shapes: list[Mesh], found: Match, figure: str, up: Axis) -> None:
    from unbend.report.match_figures import draw_match

    draw_match(shapes[0], shapes[1], found, figure, up=up)


def _write_colored(shapes: list[Mesh], found: Match, paths: tuple[str, str]) -> None:
    from unbend.io import write_mesh
    from unbend.report.match_figures import match_colors

    colors = match_colors(shapes[0], shapes[1], found)
    for path, shape, one in zip(paths, shapes, colors, strict=True):
        write_mesh(path, shape, colors=one)


def _next_step(source: str, target: str, out: str | None, report: str | None) -> str:
    if report is not None:
        return f"open {report} in a browser"
    if out is None:
        return "add -o MAP.npz to keep the match, --report HTML to look at it"
    paths = quoted(source, target)
    return f"unbend transfer {paths} --map {quoted(out)} --values VALUES.npy -o OUT.npy"
