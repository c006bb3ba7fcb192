"""``unbend collection list``: the shapes of a collection."""

from __future__ import annotations

import itertools
from typing import Annotated

import typer

from unbend.cli._common import JsonOption, print_json
from unbend.cli.collection._common import SHORT_ID, StoreArgument, opened, shown_shape


def list_(
    store: StoreArgument,
    n: Annotated[
        int | None, typer.Option("-n", metavar="N", min=1, help="Show the first N only.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """List the shapes of a collection: id, vertices, faces and path.

    \b
    Examples:
      unbend collection list shapes
      unbend collection list shapes -n 20 --json
    """  # noqa: D301
    collection = opened(store)
    entries = itertools.islice(collection, n)
    if as_json:
        print_json({"store": store, "shapes": [vars(entry) for entry in entries]})
        return
    first = list(itertools.islice(entries, 1))  # before anything is printed: it may fail
    typer.echo(f"{'id':<{SHORT_ID}}  {'vertices':>10}  {'faces':>10}  path")
    for one in itertools.chain(first, entries):
        sizes = f"{one.n_vertices:>10,}  {one.n_faces:>10,}"
        typer.echo(f"{one.id[:SHORT_ID]}  {sizes}  {shown_shape(one)}")
    if n is not None and len(collection) > n:
        typer.echo(f"... of {len(collection):,}")
