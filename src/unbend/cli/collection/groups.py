"""``unbend collection groups``: clusters of shapes, without labels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from unbend.cli._common import JsonOption, UpOption, print_json, print_written, write_table
from unbend.cli.collection._common import (
    ReportOption,
    StoreArgument,
    opened,
    shown_shape,
    write_page,
)

if TYPE_CHECKING:
    from unbend.collection import Entry


def groups(
    store: StoreArgument,
    n: Annotated[
        int | None,
        typer.Option(
            "-n",
            metavar="N",
            min=1,
            help="Number of groups, by default the best of 2 to 50.",
        ),
    ] = None,
    csv: Annotated[
        str | None, typer.Option("--csv", metavar="OUT", help="Write path and group, too.")
    ] = None,
    report: ReportOption = None,
    up: UpOption = "y",
    as_json: JsonOption = False,
) -> None:
    """Group similar shapes, whatever their poses, without labels.

    The groups are those of average linkage of the descriptors. By default their number has the
    largest mean silhouette.

    \b
    Examples:
      unbend collection groups shapes
      unbend collection groups shapes -n 5 --csv groups.csv
      unbend collection groups shapes --report groups.html
    """  # noqa: D301
    from unbend.collection import find_groups
    from unbend.io import check_writable

    if csv is not None:
        check_writable(csv, (".csv",))
    if report is not None:
        check_writable(report, (".html",))
    entries, distances = opened(store, csv, report).distances()
    numbers = find_groups(distances, n).tolist()
    members: list[list[Entry]] = [[] for _ in range(max(numbers) + 1)]
    for entry, number in zip(entries, numbers, strict=True):
        members[number].append(entry)
    paths = [[path for one in some for path in (one.path, *one.also)] for some in members]
    if csv is not None:
        pairs = sorted((path, number) for number, some in enumerate(paths) for path in some)
        write_table(csv, [("path", "group"), *pairs])
    if report is not None:
        write_page(report, store, entries, distances, up, groups=numbers)
    if as_json:
        print_json({"store": store, "groups": paths, "csv": csv, "report": report})
        return
    for number, some in enumerate(members):
        typer.echo(f"group {number}: {len(some):,}")
        for one in some:
            typer.echo(f"  {shown_shape(one)}")
    print_written(csv)
    if report is not None:
        typer.echo(f"next: open {report} in a browser")
