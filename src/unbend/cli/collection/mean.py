"""``unbend collection mean``: the mean of many shapes and how they vary."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from unbend.cli._common import JsonOption, print_json, print_rows
from unbend.cli.collection._common import (
    SchedulerOption,
    StoreArgument,
    WorkersOption,
    bar_on_stderr,
    list_failures,
    opened,
)

if TYPE_CHECKING:
    from unbend.collection import Failure, MeanShape


def mean(
    store: StoreArgument,
    template: Annotated[
        str,
        typer.Option(
            "--template",
            metavar="MESH",
            help="The template: a shape of the same kind in about the same pose.",
        ),
    ],
    out: Annotated[str, typer.Option("-o", "--out", metavar="DIR", help="The folder to write to.")],
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
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Register all shapes to a template; write their mean, components and variability.

    Into DIR go mean.ply (with the variability of each vertex, in colours too),
    component_K_minus.ply and component_K_plus.ply (the mean moved by 3 standard deviations),
    variances.csv, scores.csv, left_out.csv (shapes left out, and why) and, with matplotlib,
    components.png.

    \b
    Examples:
      unbend collection mean people --template anna.ply -o statistics
      unbend collection mean skulls --template skull.ply -o form --scale --n-components 10
    """  # noqa: D301
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
    with bar_on_stderr() as progress:
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
    if as_json:
        print_json(
            {
                "store": store,
                "template": template,
                "out": out,
                "files": [path.name for path in written],
                "n_shapes": len(found.names),
                "left_out": {one.path: one.reason for one in found.left_out},
                "variances": found.statistics.variances,
                "total_variance": found.statistics.total_variance,
            }
        )
        return
    print_rows(_told(found, shares.tolist(), out))


def _told(found: MeanShape, shares: list[float], out: str) -> dict[str, str]:
    n = len(found.names) + len(found.left_out)
    return {
        "shapes": f"{len(found.names):,} of {n:,}; the others are listed in left_out.csv"
        if found.left_out
        else f"{n:,}",
        "components": ", ".join(f"{share:.1%}" for share in shares) + " of the variance",
        "variability": f"{found.statistics.total_variance**0.5:.4g} on average, in the unit of "
        "the shapes",
        "written": str(Path(out)),
    }
