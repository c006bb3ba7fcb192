"""``unbend collection match``: pairs of the shapes of a collection."""

from __future__ import annotations

from typing import Annotated

import typer

from unbend.cli import _options as options
from unbend.cli._output import progress_on_stderr, tell
from unbend.cli.collection._common import opened


def match(
    store: options.Store,
    out: Annotated[
        str,
        options.out(
            "Folder for a .npz file and a .csv map per pair, the table matches.csv, and the "
            "spectra.",
            "DIR",
        ),
    ],
    pairs: Annotated[
        str | None,
        typer.Option(metavar="PAIRS.csv", help="The pairs: columns source,target of paths or ids."),
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
    line = (
        f"matched {done.matched:,}, there before {done.skipped:,}, failed "
        f"{len(done.failures):,} ({done.seconds:.1f} s); {out}/matches.csv lists all"
    )
    tell(
        {"store": store, "n_matched": done.matched, "n_skipped": done.skipped},
        [line],
        written=[out],
        failures=done.failures,
    )
