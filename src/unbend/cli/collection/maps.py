"""Commands that relate the shapes of a collection: match, register, mean."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

import typer

import unbend
from unbend.choices import Partial
from unbend.cli import _options as options
from unbend.cli._input import opened
from unbend.cli._output import fields_of, list_failures, progress, rows, tell
from unbend.cli.register import tell_registered
from unbend.errors import FileError, InputError


def match(
    store: str,
    out: Annotated[str, options.out("DIR")],
    pairs: Annotated[str | None, typer.Option(metavar="PAIRS.csv")] = None,
    every: Annotated[bool, typer.Option("--all")] = False,
    partial: Partial = "auto",
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
) -> None:
    """Match many pairs of shapes, as unbend match does one; each spectrum is computed once.

    Pairs whose match exists are skipped, so run the same command again to resume. Shapes that
    cannot be matched are listed at the end, with exit code 1.

      out: Folder for a .npz file and a .csv map per pair, the table matches.csv, and the spectra.
      pairs: The pairs: columns source,target of paths or ids.
      every: Match every shape with each that follows it.
      partial: Which shape may lack what the other has; auto: either; none: every point gets a
          partner. Files of every choice but auto are named after it.

    $ unbend collection match shapes --all -o matches
    $ unbend collection match shapes --pairs pairs.csv -o matches --workers 4
    $ unbend collection match leaves --all --partial none -o matches
    """
    if (pairs is None) == (not every):
        raise InputError("give either --pairs PAIRS.csv or --all")
    collection = opened(store)
    chosen: Any = None if pairs is None else unbend.io.read_table(pairs, ("source", "target"))
    done = collection.match(
        chosen, out, partial=partial, workers=workers, scheduler=scheduler, progress=progress
    )
    line = (
        f"matched {done.matched:,}, there before {done.skipped:,}, failed {len(done.failures):,} "
        f"({done.seconds:.1f} s); doubtful {done.doubtful:,}; {out}/matches.csv lists these matches"
    )
    told = {"store": store, "n_matched": done.matched, "n_skipped": done.skipped}
    told |= {"n_doubtful": done.doubtful}
    hint = "look at those with a confidence below 0.6: unbend match SOURCE TARGET --report HTML"
    next_step = hint if done.doubtful else None
    tell(told, [line], written=[out], next_step=next_step, failures=done.failures)


def register(
    store: str,
    template: Annotated[str, typer.Option(metavar="MESH")],
    out: Annotated[str, options.out("DIR")],
    landmarks: Annotated[str | None, typer.Option(metavar="CSV")] = None,
    partial: Partial = "auto",
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
) -> None:
    """Register a template to all shapes, as unbend register does to one.

    Every written mesh has the template's vertices, in its order, and its faces. vertices.npy
    (shapes, vertices, 3) and vertices.csv (shape,vertex,x,y,z,covered) hold all positions;
    shapes.csv lists confidence, coverage and distances. Registered shapes are skipped, so run the
    same command again to resume. Shapes that cannot be registered are listed at the end, with exit
    code 1.

      template: The mesh to deform: a file, or a path or id of the collection.
      out: The folder to write to, for this template alone: a mesh per shape, shapes.csv,
          vertices.npy and vertices.csv.
      landmarks: Landmarks: columns shape,template,vertex, with a path or id of a shape, a vertex of
          the template, and the corresponding vertex of the shape, counted from 0. Shapes that
          are not named keep those of an earlier run.
      partial: Which may lack what the other has: the template (source), the shapes (target), both,
          or none; auto: either. Shapes that were registered otherwise are registered again.

    $ unbend collection register people --template anna.ply -o registered
    $ unbend collection register people --template anna.ply --landmarks hints.csv -o registered
    """
    collection = opened(store, out)
    pairs = None if landmarks is None else _read_landmarks(landmarks)
    done = collection.register(
        template,
        out,
        landmarks=pairs,
        partial=partial,
        workers=workers,
        scheduler=scheduler,
        progress=progress,
    )
    result: dict[str, Any] = {"store": store, "template": template}
    result |= {"n_registered": done.registered, "n_skipped": done.skipped}
    result["shapes"] = [vars(one) | {"doubtful": one.doubtful} for one in done.shapes]
    tell_registered(done, result, template, out)


def _read_landmarks(path: str) -> dict[str, list[tuple[int, int]]]:
    found: dict[str, list[tuple[int, int]]] = {}
    columns = ("shape", "template", "vertex")
    for line, (shape, *vertices) in enumerate(unbend.io.read_table(path, columns), start=2):
        if not all(word.isdecimal() and len(word) < 19 for word in vertices):
            raise FileError(
                f"{path}: line {line}: vertices are whole numbers counted from 0, not "
                f"{' and '.join(vertices)}"
            )
        found.setdefault(shape, []).append((int(vertices[0]), int(vertices[1])))
    return found


def mean(
    registered: Annotated[str, typer.Argument(metavar="DIR")],
    out: Annotated[str, options.out("OUT")],
    n_components: Annotated[int, typer.Option(metavar="N", min=1)] = 5,
    scale: Annotated[bool, typer.Option("--scale/--keep-scale")] = False,
    min_confidence: float = 0.5,
    min_coverage: float = 0.5,
) -> None:
    """Compute the mean, components and variability of shapes that are registered to a template.

    Into OUT go mean.ply (with the variability of each vertex, in colours too),
    component_K_minus.ply and component_K_plus.ply (the mean moved by 3 standard deviations),
    variances.csv, scores.csv, left_out.csv (shapes left out, and why) and, with matplotlib,
    components.png.

      registered: The folder that unbend collection register wrote.
      out: The folder to write to.
      n_components: How many components to keep.
      scale: Scale all shapes to one size first.
      min_confidence: Leave out less confident matches.
      min_coverage: Least share of the template that is covered.

    $ unbend collection mean registered -o statistics
    $ unbend collection mean skulls_registered -o form --scale --n-components 10
    """
    progress("reading", 0)
    template, shapes, failures = unbend.collection.read_registrations(registered)
    list_failures(failures)
    found = unbend.collection.mean_shape(
        shapes,
        template,
        n_components=n_components,
        scale=scale,
        min_confidence=min_confidence,
        min_coverage=min_coverage,
    )
    list_failures(found.left_out)
    found = replace(found, left_out=(*failures, *found.left_out))
    progress("writing", 0)
    written = unbend.collection.write_mean(out, found)
    statistics, n, others = found.statistics, len(found.names), len(found.left_out)
    of_all = f"{n:,} of {n + others:,}; the others are listed in left_out.csv"
    shares = ", ".join(f"{one / statistics.total_variance:.1%}" for one in statistics.variances)
    size = f"{statistics.total_variance**0.5:.4g}"
    lines = {
        "shapes": of_all if others else f"{n:,}",
        "components": f"{shares} of the variance" if shares else "none: the shapes do not differ",
        "variability": f"{size} on average, in the unit of the shapes",
    }
    result: dict[str, Any] = {"registered": registered, "template": template.name}
    result |= {"files": [path.name for path in written], "n_shapes": n, "failed": found.left_out}
    result |= fields_of(statistics, "variances", "total_variance")
    tell(result, rows(lines), written=[out])
