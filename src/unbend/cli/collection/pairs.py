"""Commands that match the shapes of a collection: match, mean."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from unbend.cli import _options as options
from unbend.cli._output import (
    EXIT_SOME_FAILED,
    progress_on_stderr,
    rows,
    tell,
)
from unbend.cli.collection._common import (
    list_failures,
    opened,
)

if TYPE_CHECKING:
    from unbend.collection import Failure, MeanShape


def match(
    store: options.Store,
    out: Annotated[
        str,
        options.out(
            "Folder for one .npz file per pair, the table matches.csv, and the spectra.", "DIR"
        ),
    ],
    pairs: Annotated[
        str | None,
        typer.Option(
            "--pairs",
            metavar="PAIRS.csv",
            help="The pairs: columns source,target of paths or ids.",
        ),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="Match every shape with each that follows it.")
    ] = False,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
) -> None:
    """Match many pairs of shapes, as unbend match does one; each spectrum is computed once.

    Pairs whose match exists are skipped, so run the same command again to resume. Shapes that
    cannot be matched are listed at the end, with exit code 1.

    Examples
    --------
      unbend collection match shapes --all -o matches
      unbend collection match shapes --pairs pairs.csv -o matches --workers 4
    """
    from unbend.errors import InputError
    from unbend.io import read_table

    if (pairs is None) == (not every):
        raise InputError("give --pairs PAIRS.csv or --all, one of them")
    collection = opened(store)
    chosen = None
    if pairs is not None:
        chosen = [(source, target) for source, target in read_table(pairs, ("source", "target"))]
    with progress_on_stderr() as progress:
        done = collection.match(
            chosen, out, workers=workers, scheduler=scheduler, progress=progress
        )
    list_failures(done.failures)
    line = (
        f"matched {done.matched:,}, there before {done.skipped:,}, failed "
        f"{len(done.failures):,} ({done.seconds:.1f} s); {out}/matches.csv lists all"
    )
    tell(
        {
            "store": store,
            "n_matched": done.matched,
            "n_skipped": done.skipped,
            "failed": [vars(one) for one in done.failures],
        },
        [line],
        written=[out],
    )
    if done.failures:
        raise typer.Exit(EXIT_SOME_FAILED)


def mean(
    store: options.Store,
    template: Annotated[
        str,
        typer.Option(
            "--template",
            metavar="MESH",
            help="The template: a shape of the same kind in about the same pose.",
        ),
    ],
    out: Annotated[str, options.out("The folder to write to.", "DIR")],
    n_components: Annotated[
        int,
        typer.Option("--n-components", metavar="N", min=1, help="How many components to keep."),
    ] = 5,
    scale: Annotated[
        bool, typer.Option("--scale/--keep-scale", help="Scale all shapes to one size first.")
    ] = False,
    min_confidence: Annotated[
        float, typer.Option("--min-confidence", help="Leave out less confident matches.")
    ] = 0.5,
    min_coverage: Annotated[
        float,
        typer.Option("--min-coverage", help="Least share of the template that is covered."),
    ] = 0.5,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
) -> None:
    """Register all shapes to a template; write their mean, components and variability.

    Into DIR go mean.ply (with the variability of each vertex, in colours too),
    component_K_minus.ply and component_K_plus.ply (the mean moved by 3 standard deviations),
    variances.csv, scores.csv, left_out.csv (shapes left out, and why) and, with matplotlib,
    components.png.

    Examples
    --------
      unbend collection mean people --template anna.ply -o statistics
      unbend collection mean skulls --template skull.ply -o form --scale --n-components 10
    """
    from unbend.collection import Failure, find_file, make_folder, mean_shape, write_mean
    from unbend.errors import FileError

    collection = opened(store, out)
    make_folder(out)
    paths: list[str] = []
    missing: list[Failure] = []
    for entry in sorted(collection, key=lambda entry: entry.path):
        try:
            paths.append(find_file(entry, store))
        except FileError as error:
            missing.append(Failure(entry.path, str(error)))
    list_failures(missing)
    with progress_on_stderr() as progress:
        found = mean_shape(
            paths,
            template,
            n_components=n_components,
            scale=scale,
            min_confidence=min_confidence,
            min_coverage=min_coverage,
            workers=workers,
            scheduler=scheduler,
            progress=progress,
        )
    list_failures(found.left_out)
    found = replace(found, left_out=(*missing, *found.left_out))
    written = write_mean(out, found)
    shares = found.statistics.variances / found.statistics.total_variance
    tell(
        {
            "store": store,
            "template": template,
            "files": [path.name for path in written],
            "n_shapes": len(found.names),
            "failed": [vars(one) for one in found.left_out],
            "variances": found.statistics.variances,
            "total_variance": found.statistics.total_variance,
        },
        rows(_told(found, shares.tolist())),
        written=[out],
    )


def _told(found: MeanShape, shares: list[float]) -> dict[str, str]:
    n = len(found.names) + len(found.left_out)
    return {
        "shapes": f"{len(found.names):,} of {n:,}; the others are listed in left_out.csv"
        if found.left_out
        else f"{n:,}",
        "components": ", ".join(f"{share:.1%}" for share in shares) + " of the variance",
        "variability": f"{found.statistics.total_variance**0.5:.4g} on average, in the unit of "
        "the shapes",
    }
