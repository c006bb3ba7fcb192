"""``unbend collection matrix``: how far every shape is from every other."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from unbend.cli._common import JsonOption, UpOption, print_json, print_written, write_table
from unbend.cli.collection._common import (
    ReportOption,
    StoreArgument,
    opened,
    shown_shape,
    write_page,
)

_MOST_PRINTED = 24


def matrix(
    store: StoreArgument,
    csv: Annotated[
        str | None, typer.Option("--csv", metavar="OUT", help="Write the table, too.")
    ] = None,
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure", metavar="PNG", help="A heat map with its dendrogram (.png, .pdf, .svg)."
        ),
    ] = None,
    report: ReportOption = None,
    up: UpOption = "y",
    as_json: JsonOption = False,
) -> None:
    """Compare every shape with every other: distances of the descriptors, 0 for the same shape.

    \b
    Examples:
      unbend collection matrix shapes
      unbend collection matrix shapes --csv distances.csv --figure distances.png
      unbend collection matrix shapes --report distances.html
    """  # noqa: D301
    from unbend.io import check_writable

    if figure is not None:
        check_writable(figure, (".png", ".pdf", ".svg"))
    if csv is not None:
        check_writable(csv, (".csv",))
    if report is not None:
        check_writable(report, (".html",))
    entries, distances = opened(store, csv, figure, report).distances()
    if csv is not None:
        rows = ([entry.path, *row] for entry, row in zip(entries, distances.tolist(), strict=True))
        write_table(csv, [["path", *(entry.path for entry in entries)], *rows])
    if figure is not None:
        from unbend.report.collection_figures import draw_distances

        draw_distances([Path(entry.path).stem for entry in entries], distances, figure)
    if report is not None:
        write_page(report, store, entries, distances, up)
    if as_json:
        print_json(
            {
                "store": store,
                "paths": [entry.path for entry in entries],
                "also": [entry.also for entry in entries],
                "distances": distances.tolist(),
                "csv": csv,
                "figure": figure,
                "report": report,
            }
        )
        return
    if len(entries) <= _MOST_PRINTED:
        names = [shown_shape(entry) for entry in entries]
        width = max(map(len, names)) + 2
        typer.echo(" " * width + "".join(f"{i:>8}" for i in range(len(entries))))
        for i, (name, row) in enumerate(zip(names, distances, strict=True)):
            numbers = "".join(f"{value:8.4f}" for value in row)
            typer.echo(f"{name:<{width}}{numbers}  {i}")
    else:
        hint = "" if csv or figure or report else ": add --csv OUT or --figure PNG"
        typer.echo(f"compared {len(entries):,} shapes, too many to print{hint}")
    print_written(csv, figure)
    if report is not None:
        typer.echo(f"next: open {report} in a browser")
