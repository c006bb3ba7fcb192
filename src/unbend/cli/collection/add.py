"""``unbend collection add``: shapes from files into a collection."""

from __future__ import annotations

from typing import Annotated

import typer

from unbend.cli._common import JsonOption, print_json, quoted
from unbend.cli.collection._common import (
    EXIT_SOME_FAILED,
    SchedulerOption,
    StoreArgument,
    WorkersOption,
    bar_on_stderr,
    list_failures,
)


def add(
    store: StoreArgument,
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="PATHS...",
            help="Meshes, folders of them (and all folders below), quoted patterns like "
            "'scans/**/*.ply'.",
        ),
    ],
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Describe shapes and store their descriptors; the files stay where they are.

    Files whose content is stored already are skipped, so run the same command again to resume. A
    file that cannot be used is listed at the end, with exit code 1. Identical files are one shape
    with several paths. After you move a folder, add it again to update the paths.

    \b
    Examples:
      unbend collection add shapes scans/
      unbend collection add shapes 'models/**/*.obj' --workers 8
      unbend collection add shapes /data/models --scheduler tcp://10.0.0.1:8786 --json
    """  # noqa: D301
    from unbend.collection import Collection

    collection = Collection(store)
    with bar_on_stderr() as progress:
        done = collection.add(paths, workers=workers, scheduler=scheduler, progress=progress)
    list_failures(done.failures)
    if as_json:
        print_json(
            {
                "store": store,
                "added": done.added,
                "skipped": done.skipped,
                "new_paths": done.new_paths,
                "failed": [vars(one) for one in done.failures],
                "shapes": len(collection),
                "seconds": done.seconds,
            }
        )
    else:
        rate = f", {done.added / done.seconds:.3g} a second" if done.added else ""
        moved = f" ({done.new_paths:,} under a new path)" if done.new_paths else ""
        typer.echo(
            f"added {done.added:,}, there before {done.skipped:,}{moved}, failed "
            f"{len(done.failures):,}; {store} has {len(collection):,} shapes "
            f"({done.seconds:.1f} s{rate})"
        )
        if len(collection):
            typer.echo(
                f"next: unbend collection search {quoted(store)} MESH, to find what is like it"
            )
    if done.failures:
        raise typer.Exit(EXIT_SOME_FAILED)
