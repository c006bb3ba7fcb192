"""``unbend register``: fit a template to scans."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import unbend
from unbend._text import quoted
from unbend.choices import Axis
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.cli._input import expand_folders, is_batch, read_or_match, read_shapes

if TYPE_CHECKING:
    from unbend._types import FloatArray


def register(
    template: str,
    scans: list[str],
    out: Annotated[str, options.out()],
    *,
    matching: options.MatchOptions,
    component: options.Component = None,
    report: options.Report = None,
    up: Axis = "y",
    cache: options.Cache = True,
) -> None:
    """Register a template to scans: deform it so that it lies on the surface of each.

    The template keeps its vertices and faces, and its shape over holes of the scan. The result is
    in the scan's coordinates and unit. Of several scans, a folder is written with a mesh of each
    and tables of all; scans that cannot be registered are listed, with exit code 1. The command
    unbend collection register does the same on all processors.

      template: The mesh to deform.
      scans: The meshes to fit it to, or folders of them.
      out: The fitted template: .ply, .obj, .glb or .vtp, coloured by the distance of each vertex
          from the scan, yellow where it does not reach it (.ply and .vtp have the distances too);
          .off or .stl. From .obj to .obj or .glb to .glb, textures and all else stay, and only
          positions change. For several scans, or a folder of them, a folder.
      report: Write a page for a browser: the template, coloured by distance, beside the scan.

    $ unbend register template.ply scan.ply -o fitted.ply
    $ unbend register template.ply scans/ -o fitted
    $ unbend register leaf.ply leaves/ --partial none -o fitted
    $ unbend register template.obj scan.stl --map template_scan.npz -o fitted.obj
    $ unbend register template.ply torn.ply --partial target --save-match map.npz -o fitted.ply
    $ unbend register template.ply scan.ply --landmarks hints.csv -o fitted.glb
    $ unbend register template.ply scan.ply --min-confidence 0.7 -o fitted.ply --json
    """
    paths = expand_folders(scans)
    of_one = vars(matching) | {"component": component, "report": report, "partial": None}
    if is_batch(scans, paths, out, of_one):
        output.progress("reading", 0)
        done = unbend.collection.register_files(
            paths, template, out, matching.partial, output.progress
        )
        _, fitted, _ = unbend.collection.read_registrations(out)
        of_all = [
            _numbers(row.path, os.path.join(out, row.file), one, row.also)
            for row, one in zip(done.shapes, fitted, strict=True)
        ]
        tell_registered(done, {"template": template, "scans": of_all}, template, out)
        return
    options.keep_inputs([out], paths)
    unbend.io.check_writable(out, (".ply", ".obj", ".glb", ".vtp", ".off", ".stl"))
    shapes = read_shapes((template, paths[0]), component)
    unbend.correspondence.check_template(shapes[0])
    match = read_or_match(shapes, matching)
    found = unbend.register(shapes[0], shapes[1], match, progress=output.progress)
    output.progress("writing", 0)
    like = output.what_to_keep(out, template, whole=component is None)
    unbend.correspondence.write_registration(out, found, like=like)
    if report is not None:
        reach = f"{found.tolerance:.3g}"
        note = (
            f"{found.coverage:.1%} of the template's area lies on the scan, within {reach} in the "
            f"scan's unit, and {found.scan_coverage:.1%} of the scan's on the template, within a "
            f"mean edge; confidence {output.confidence_of(found)}."
        )
        cut = f", up to {reach}" if (found.distances > found.tolerance).any() else ""
        looks: Any = {"label": f"distance from the scan{cut}", "note": note, "up": up}
        looks["values"] = found.distances.clip(max=found.tolerance)
        unbend.report.view(found.mesh, shapes[1], path=report, **looks)
    one = _numbers(paths[0], out, found)
    lines = {
        "covered": f"{found.coverage:.1%} of the area, within {found.tolerance:.3g}",
        "scan covered": f"{found.scan_coverage:.1%} of its area, within a mean edge",
        "distance there": _in_words(one["distance_covered"]),
        "distance of all": _in_words(one["distance_all"]),
        "confidence": output.confidence_of(found),
    }
    colored = Path(out).suffix.lower() in unbend.io.COLOR_SUFFIXES and like is None
    legend = "; its colours are the distance from the scan" if colored else ""
    viewer = output.viewer_of(out, paths[0])
    output.tell(
        {"template": template, "scans": [one]},
        output.rows(lines),
        failures=(),
        shapes=shapes,
        written=[out, matching.save_match],
        report=report,
        next_step=f"open {out} and {paths[0]} together in {viewer}{legend}",
    )


def tell_registered(
    done: unbend.collection.Registered, result: dict[str, Any], template: str, out: str
) -> None:
    """Tell how registering many shapes went, the least confident last, where they are seen."""
    if done.shapes and os.path.exists(template):  # not a shape of a collection by its id
        output.what_to_keep(os.path.join(out, f"*{Path(done.shapes[0].file).suffix}"), template)
    lines = [("shape", "confidence", "covered", "scan covered", "95% within", "")]
    for one in sorted(done.shapes, key=lambda one: -one.confidence):
        numbers = f"{one.confidence:.2f}", f"{one.coverage:.1%}", f"{one.scan_coverage:.1%}"
        doubt = "doubtful" if one.doubtful else ""
        lines.append((output.shown_shape(one), *numbers, f"{one.distance_95:.3g}", doubt))
    lines += [(output.shown(one.path), "-", "-", "-", "-", "failed") for one in done.failures]
    doubtful = [one for one in done.shapes if one.doubtful]
    counts = f"registered {done.registered:,}, there before {done.skipped:,}"
    failed = f"failed {len(done.failures):,} ({done.seconds:.1f} s)"
    hint = f"unbend collection mean {quoted(out)} -o OUT, for the mean and the components"
    if doubtful:
        worst = min(doubtful, key=lambda one: one.confidence)
        others = "mirror those of the other side"
        if not any("mirror image" in told for told in worst.warnings):
            others = "where limbs are swapped, register again with --landmarks"
        hint = (
            f"look at doubtful ones: unbend match {quoted(template, output.shown(worst.path))} "
            f"--report match.html; {others}"
        )
    output.tell(
        result,
        [*output.table("<>>>><", *lines), "", f"{counts}, {failed}; doubtful {len(doubtful):,}"],
        written=[out],
        next_step=hint if done.shapes else None,
        failures=done.failures,
    )


def _numbers(
    scan: str, file: str, found: unbend.correspondence.Registration, also: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Give what the JSON has of a scan; lengths are in its unit."""
    import numpy as np

    side = np.sqrt(unbend.mesh.vertex_areas(found.mesh).sum())

    def spread(distances: FloatArray) -> dict[str, float]:
        known = distances[np.isfinite(distances)]
        mean, most = (known.mean(), np.quantile(known, 0.95)) if len(known) else (np.nan, np.nan)
        relative = {"mean_relative": mean / side, "within_95_relative": most / side}
        return {"mean": mean, "within_95": most} | relative

    return {
        "scan": scan,
        "also": also,
        "file": file,
        "n_vertices": found.mesh.n_vertices,
        "n_covered": int(found.covered.sum()),
        **output.fields_of(found, "coverage", "scan_coverage", "tolerance"),
        "distance_covered": spread(found.distances[found.covered]),
        "distance_all": spread(found.distances),
        "confidence": found.confidence,
    }


def _in_words(spread: dict[str, float]) -> str:
    return (
        f"mean {spread['mean']:.3g}, 95% within {spread['within_95']:.3g} in the scan's unit "
        f"({spread['mean_relative']:.2g} and {spread['within_95_relative']:.2g} of sqrt(area))"
    )
