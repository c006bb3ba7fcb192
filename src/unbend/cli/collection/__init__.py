"""``unbend collection``: many shapes, one file per command as for all others."""

from __future__ import annotations

import typer

from unbend.cli.collection import (
    add,
    evaluate,
    export,
    groups,
    info,
    list_,
    match,
    matrix,
    mean,
    remove,
    search,
)

app = typer.Typer(
    help="Store many shapes; search, group and match them.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
app.command()(add.add)
app.command("list")(list_.list_)
app.command()(info.info)
app.command()(remove.remove)
app.command()(search.search)
app.command()(matrix.matrix)
app.command()(groups.groups)
app.command()(match.match)
app.command()(evaluate.evaluate)
app.command()(mean.mean)
app.command()(export.export)
