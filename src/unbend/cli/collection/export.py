"""``unbend collection export``: a collection as one table, for other programs."""

from __future__ import annotations

from typing import Annotated

import typer

from unbend.cli._common import JsonOption, print_json
from unbend.cli.collection._common import StoreArgument, opened


def export(
    store: StoreArgument,
    out: Annotated[
        str,
        typer.Option(
            "-o",
            "--out",
            metavar="OUT",
            help=".parquet: every column; .csv: all but forms and thumbnails.",
        ),
    ],
    as_json: JsonOption = False,
) -> None:
    """Write the stored data of every shape into one table.

    There is a row for each file. Identical files have the same id.

    \b
    Examples:
      unbend collection export shapes -o shapes.parquet
      unbend collection export shapes -o shapes.csv
    """  # noqa: D301
    count = opened(store).export(out)
    if as_json:
        print_json({"store": store, "out": out, "rows": count})
        return
    typer.echo(f"wrote {count:,} rows to {out}, one for each file")
