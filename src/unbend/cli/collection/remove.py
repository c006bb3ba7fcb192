"""``unbend collection remove``: shapes out of a collection."""

from __future__ import annotations

from typing import Annotated

import typer

from unbend.cli._common import JsonOption, print_json
from unbend.cli.collection._common import StoreArgument, opened, shown, shown_shape


def remove(
    store: StoreArgument,
    shapes: Annotated[
        list[str],
        typer.Argument(metavar="SHAPES...", help="Paths, or ids (8 digits or more of them)."),
    ],
    as_json: JsonOption = False,
) -> None:
    """Remove shapes from a collection; their files stay where they are.

    A path removes only that path of a shape that has several. An id removes the shape.

    \b
    Examples:
      unbend collection remove shapes scans/cat0.off
      unbend collection remove shapes 3287ee037b25 9f0c11d2a4b7
    """  # noqa: D301
    collection = opened(store)
    left = {one.id: {one.path, *one.also} for one in collection.find(shapes)}
    removed = collection.remove(shapes)
    for entry in removed:
        left[entry.id] -= {entry.path, *entry.also}
    if as_json:
        removals = [vars(entry) for entry in removed]
        print_json({"store": store, "removed": removals, "shapes": len(collection)})
        return
    for entry in removed:
        kept = f"; the shape stays as {shown(min(left[entry.id]))}" if left[entry.id] else ""
        typer.echo(f"removed {shown_shape(entry)}{kept}")
    typer.echo(f"{store} has {len(collection):,} shapes")
