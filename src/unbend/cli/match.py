"""``unbend match`` and ``unbend symmetry``: which point is which of another shape or side."""

from __future__ import annotations

from typing import Annotated

import typer

import unbend
from unbend._display import is_doubtful
from unbend._text import plural, quoted
from unbend.choices import Axis, Partial
from unbend.cli import _input as inputs
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.errors import InputError

# A map that is not sure of its side has about as much of the surface on either.
_CLEAR_SIDE = 0.1
_MEASURES = ("confidence", "confidence_bound", "orientation", "overlap_source", "overlap_target")


def match(
    source: str,
    target: str,
    map_out: options.MapOut = None,
    partial: Partial = "auto",
    landmarks: options.Landmarks = None,
    min_confidence: options.MinConfidence = None,
    n_matches: Annotated[int, options.count("--n-matches", None)] = 1,
    n_eigenpairs: int = 30,
    allow_mirror: Annotated[bool, typer.Option("--allow-mirror")] = False,
    refine: bool = True,
    component: options.Component = None,
    figure: options.Figure = None,
    colored: Annotated[tuple[str, str] | None, typer.Option(metavar="OUT OUT")] = None,
    report: options.Report = None,
    truth: Annotated[
        tuple[str, str] | None, typer.Option(metavar="SOURCE_TRUTH TARGET_TRUTH")
    ] = None,
    mirrored_truth: Annotated[str | None, typer.Option(metavar="FILE")] = None,
    up: Axis = "y",
    cache: options.Cache = True,
) -> None:
    """Match two shapes: find the target vertex of each source vertex.

    The shapes may have different poses and different meshes. Nothing is random: the same meshes
    give the same map. With --min-confidence, a less confident match is printed but not written, and
    the exit code is 3.

      n_matches: Write the N best distinct maps, if there are so many: MAP, MAP-2, MAP-3 ...
      n_eigenpairs: Eigenfunctions of each shape.
      allow_mirror: Let the map turn the surface inside out, as from a left hand to a right one.
      refine: Refine the map on the full meshes.
      figure: Draw both shapes, corresponding points in one colour (.png, .pdf, .svg).
      colored: Write both shapes (.ply, .obj, .glb, .vtp), corresponding points in one colour, for
          Blender, MeshLab and ParaView.
      report: Write a page to look at the match in a browser: both shapes turn together, and a place
          on one shows its partner on the other.
      truth: Source vertices whose image is known, and their true images, row by row: the report
          then shows the errors.
      mirrored_truth: Their images on the other side.

    $ unbend match cat0.off cat1.off -o cat0_cat1.npz --figure match.png
    $ unbend match cat0.off cat1.off -o cat0_cat1.vts --min-confidence 0.7
    $ unbend match cat0.off cat1.off --report match.html --up z
    $ unbend match cat0.off cat1.off --colored cat0.glb cat1.glb
    $ unbend match scan.ply model.ply --component largest --json
    $ unbend match torn.ply model.ply --partial source -o torn.npz
    $ unbend match a.ply b.ply --landmarks hints.csv --n-matches 3 -o map.npz
    """
    if truth is not None and report is None:
        raise InputError("ground truth is shown by --report; add it, or leave out --truth")
    if mirrored_truth is not None and truth is None:
        raise InputError("--mirrored-truth needs --truth")
    maps: list[str] = []
    if map_out is not None:
        maps = [map_out, *(output.numbered(map_out, i) for i in range(2, n_matches + 1))]
        read = (source, target, *(landmarks or ()), *(truth or ()), mirrored_truth)
        options.check_files({"map_out": maps, "read": read})
    shapes = inputs.read_shapes((source, target), component)
    known = None
    if truth is not None:
        sizes = [shape.n_vertices for shape in shapes]
        known = inputs.read_truth((*truth, mirrored_truth), *sizes)
    hints = inputs.landmarks_of(landmarks, shapes)
    found = unbend.match(
        *shapes,
        partial=partial,
        landmarks=hints,
        n_matches=n_matches,
        n_eigenpairs=n_eigenpairs,
        refine=refine,
        allow_mirror=allow_mirror,
        barycentric=any((figure, report, colored, map_out and inputs.keeps_all(map_out))),
        progress=output.progress,
    )
    if truth is not None and known is not None:
        unbend.io.warn_of_truth(truth, found.source_to_target, shapes[1], *known[:2])
    seconds = output.elapsed()
    if (count := 1 + len(found.alternatives)) < n_matches:
        output.say("note", f"{plural(count, 'distinct map')} found, not {n_matches:,}")
    if unsure := inputs.is_unsure(found, min_confidence):
        map_out = figure = report = colored = None
    maps = maps[:count] if map_out else []
    output.progress("writing", 0)
    for path, one in zip(maps, (found, *found.alternatives), strict=False):
        inputs.write_result(path, one, shapes)
    if map_out is None:
        next_step = "add -o MAP.npz to keep the match, --report HTML to look at it"
    elif is_doubtful(found.confidence):
        next_step = "add --report HTML to look at it"
    else:
        paths = f"{quoted(source, target)} --map {quoted(map_out)}"
        next_step = f"unbend transfer {paths} --values VALUES.npy -o OUT.npy"
        next_step += f" --component {component}" if component is not None else ""
    for shape in shapes if component is None else ():
        if wider := unbend.matching.wider_component(unbend.preparation.join_seams(shape)[0]):
            next_step = f"if the body of {shape.name} is component {wider}, add --component {wider}"
    if colored is not None:
        colors = unbend.report.match_colors(shapes[0], shapes[1], found)
        for i, original in enumerate((source, target)):
            whole = component is None
            like = output.what_to_keep(colored[i], original, whole=whole, moved=False)
            unbend.write_mesh(colored[i], shapes[i], colors=colors[i], like=like)
    inputs.show_match(shapes, found, figure, report, up=up, truth=known, landmarks=hints)
    output.warn_if_doubtful(found, seen=report is not None)
    median, within_95 = found.expected_error_quantiles()
    others = [
        f"another map has confidence {one.confidence:.2f}, and differs by "
        f"{one.hypotheses[1].difference:.1%} of the size on average"  # from the first
        for one in found.alternatives
    ]
    output.tell(
        {
            "source": source,
            "target": target,
            "n_source": len(found.source_to_target),
            "n_target": len(found.target_to_source),
            "n_matched": int((found.source_to_target >= 0).sum()),
            **output.fields_of(found, *_MEASURES),
            "expected_error": {"median": median, "within_95": within_95},
            **output.fields_of(
                found, "area_ratio", "mirror_fits", "missed_landmarks", "hypotheses"
            ),
            "alternatives": [output.fields_of(one, *_MEASURES) for one in found.alternatives],
        },
        output.rows(summary(shapes, found, seconds)) + others,
        shapes=shapes,
        written=[*maps, figure, *(colored or ())],
        report=report,
        next_step=next_step,
        unsure=unsure,
    )


def symmetry(
    mesh: str,
    map_out: options.MapOut = None,
    landmarks: options.Landmarks = None,
    min_confidence: options.MinConfidence = None,
    refine: bool = True,
    component: options.Component = None,
    figure: options.Figure = None,
    report: options.Report = None,
    up: Axis = "y",
    cache: options.Cache = True,
) -> None:
    """Find the left-right symmetry of a shape, in any pose: the mirror partner of each vertex.

    What has no counterpart, as beyond a cut, gets no partner; but a limb of which nothing is on the
    other side may be its own, as a tail is. The confidence is that of a match of the shape to its
    mirror image, so it is also high for a roughly symmetric shape, such as a bone, and may be for
    half a body. If back and belly may be exchanged, or limbs may have stayed on their sides, a
    warning tells, and it is 0.5 at most.

      landmarks: A .csv file: on each line two vertices, counted from 0, that are each other's
          partners, such as the tips of two limbs; or two files of points.
      refine: Refine the map on the full mesh.
      figure: Draw the shape twice, mirror partners in one colour (.png, .pdf, .svg).
      report: Write a page on which a place shows its partner on the other side.

    $ unbend symmetry cat.off -o partners.csv
    $ unbend symmetry cat.off --report symmetry.html --up z
    $ unbend symmetry beetle.ply --landmarks legs.csv -o partners.csv
    $ unbend transfer cat.off cat.off --map partners.csv --values left.csv -o right.csv
    """
    (shape,) = inputs.read_shapes([mesh], component)
    pairs = inputs.landmarks_of(landmarks, (shape, shape))
    found = unbend.symmetry(shape, landmarks=pairs, refine=refine, progress=output.progress)
    seconds = output.elapsed()
    if unsure := inputs.is_unsure(found, min_confidence):
        map_out = figure = report = None
    output.progress("writing", 0)
    if map_out is not None:
        inputs.write_result(map_out, found, (shape, shape))
    inputs.show_match((shape, shape), found, figure, report, up=up)
    if is_doubtful(found.confidence):
        trust = f"the symmetry is doubtful (confidence {found.confidence:.2f})"
        look = "on the page" if report else "with unbend symmetry --report"
        why = "the shape may have none"
        again = "" if landmarks else "; if it is wrong, try again with --landmarks"
        output.say("warning", f"{trust}: {why}; look at it {look}{again}")
    matched, n = int((found.source_to_target >= 0).sum()), len(found.source_to_target)
    partners = f"{matched:,} of {n:,} vertices of {shape.name}, {seconds:.1f} s"
    way = output.fields_of(found, "confidence", "orientation")
    output.tell(
        {"file": mesh, "n_vertices": n, "n_matched": matched, **way},
        output.rows({"partners": partners, "confidence": f"{found.confidence:.2f}"}),
        shapes=[shape],
        written=[map_out, figure],
        report=report,
        next_step="add --report HTML to look at it"
        if map_out
        else "add -o PARTNERS.csv to keep them",
        unsure=unsure,
    )


def summary(shapes: list[unbend.Mesh], found: unbend.Match, seconds: float) -> dict[str, str]:
    """Name the results."""
    matched, all_of_it = int((found.source_to_target >= 0).sum()), len(found.source_to_target)
    count = f"{matched:,}" if matched == all_of_it else f"{matched:,} of {all_of_it:,}"
    trust = f"{found.confidence:.2f}"
    if round(found.confidence_bound, 2) < 1:
        trust += f" (limited to {found.confidence_bound:.2f} by errors of the final map)"
    side = "unclear which side is out"
    if abs(found.orientation) >= _CLEAR_SIDE:
        side = f"{(1 + abs(found.orientation)) / 2:.0%} of the surface "
        side += "right side out" if found.orientation > 0 else "inside out, a reflection"
    told = {
        "matched": f"{count} vertices of {shapes[0].name} to {shapes[1].name}, {seconds:.1f} s",
        "confidence": trust,
        "overlap": f"{found.overlap_source:.0%} of the source's area, {found.overlap_target:.0%} "
        "of the target's",
        "orientation": side,
    }
    if matched:
        median, high = found.expected_error_quantiles()
        told["errors"] = (
            f"expected up to {median:.1%} of the size (square root of the area) at half of the "
            f"vertices, {high:.1%} at 95%"
        )
    return told
