"""``unbend collection match``: many pairs of a collection matched."""

from __future__ import annotations

from typing import Annotated

import typer

from unbend.cli._common import JsonOption, print_json
from unbend.cli.collection._common import (
    EXIT_SOME_FAILED,
    SchedulerOption,
    StoreArgument,
    WorkersOption,
    bar_on_stderr,
    list_failures,
    opened,
)


def match(
    store: StoreArgument,
    out: Annotated[
        str,
        typer.Option(
            "-o",
            "--out",
            metavar="DIR",
            help="Folder for one .npz file per pair, the table matches.csv, and the spectra.",
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
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Match many pairs of shapes, as unbend match does one; each spectrum is computed once.

    Pairs whose match exists are skipped, so run the same command again to resume. Shapes that
    cannot be matched are listed at the end, with exit code 1.

    \b
    Examples:
      unbend collection match shapes --all -o matches
      unbend collection match shapes --pairs pairs.csv -o matches --workers 4
    """  # noqa: D301
    from unbend.errors import InputError

    if (pairs is None) == (not every):
        raise InputError("give --pairs PAIRS.csv or --all, one of them")
    collection = opened(store)
    chosen = None if pairs is None else _read_pairs(pairs)
    with bar_on_stderr() as progress:
        done = collection.match(
            chosen, out, workers=workers, scheduler=scheduler, progress=progress
        )
    list_failures(done.failures)
    if as_json:
        print_json(
            {
                "store": store,
                "out": out,
                "matched": done.matched,
                "skipped": done.skipped,
                "failed": [vars(one) for one in done.failures],
                "seconds": done.seconds,
            }
        )
    else:
        typer.echo(
            f"matched {done.matched:,}, there before {done.skipped:,}, failed "
            f"{len(done.failures):,} ({done.seconds:.1f} s); {out}/matches.csv lists all"
        )
    if done.failures:
        raise typer.Exit(EXIT_SOME_FAILED)


def _read_pairs(path: str) -> list[tuple[str, str]]:
    import csv
    from pathlib import Path

    from unbend.errors import FileError
    from unbend.io import read_bytes

    try:
        text = read_bytes(Path(path), (".csv",)).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FileError(f"{path} is not text in UTF-8") from None
    rows = list(csv.DictReader(text.splitlines(), skipinitialspace=True))
    if not rows or not {"source", "target"} <= set(rows[0]):
        raise FileError(f"{path}: needs a first line with source,target, and a line a pair")
    for i, row in enumerate(rows):
        if not row["source"] or not row["target"]:
            raise FileError(f"{path}, line {i + 2}: needs a source and a target")
    return [(row["source"], row["target"]) for row in rows]
