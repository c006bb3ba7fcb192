"""``unbend reproduce``: the paper's tables and figures, run again."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from unbend.choices import Experiment
from unbend.cli._common import EXIT_REFUSED, JsonOption, print_json, quoted, say, steps_on_stderr


def reproduce(
    target: Annotated[
        Experiment,
        typer.Argument(
            metavar="TARGET",
            help="table1 (with Figure 2, its plot), table2, figure1, figure3; robustness, "
            "efficiency or convergence; or all of them.",
        ),
    ],
    data: Annotated[
        str,
        typer.Option(
            "--data",
            metavar="DIR",
            help="A folder that holds the shapes of TOSCA and SCAPE, in folders of these names; "
            "or: synthetic, for shapes of our own.",
        ),
    ],
    out: Annotated[
        str, typer.Option("-o", "--out", metavar="OUT", help="Folder for the pages and numbers.")
    ],
    quick: Annotated[
        bool, typer.Option("--quick", help="Few and small shapes: minutes, not hours.")
    ] = False,
    jobs: Annotated[int, typer.Option("--jobs", help="Processes at a time.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """Run the experiments of Yang, Obaseki and Chen (2019) again, each into a folder of OUT.

    Each page sets the paper's figures beside ours. Finished pieces are kept in OUT/pieces: a run
    that was interrupted goes on where it stopped. Delete that folder to start anew.

    \b
    Examples:
      unbend reproduce table2 --data synthetic -o reproduction --quick
      unbend reproduce table1 --data shapes -o reproduction --jobs 4
      unbend reproduce all --data shapes -o reproduction --jobs 4
    """  # noqa: D301
    from pathlib import Path

    from unbend.datasets import Collection
    from unbend.errors import InputError
    from unbend.report.figures import new_figure
    from unbend.reproduce.data import SYNTHETIC, open_data
    from unbend.reproduce.page import write_index, write_page
    from unbend.reproduce.run import Run
    from unbend.reproduce.targets import TARGETS, shapes_for

    if jobs < 1:
        raise InputError(f"--jobs must be at least 1, not {jobs}")
    new_figure(1, 1)  # matplotlib is missing? Say so before the work.
    folder = Path(out)
    pages: dict[str, str] = {}
    skipped: dict[str, str] = {}
    with _progress() as progress:
        found = open_data(data, folder / "pieces", quick, progress)
        run = Run(
            found.shapes.collection if found.shapes else Collection("TOSCA", {}, {}, None, {}),
            found.scape.collection if found.scape else None,
            quick,
            jobs,
            found.store,
            progress,
        )
        wanted = list(TARGETS) if target == "all" else [target]
        for name in wanted:
            try:
                described = shapes_for(name, found)
            except InputError as error:
                if target != "all":
                    raise
                skipped[name] = str(error)
                continue
            progress(name)
            result = TARGETS[name](run)
            where = SYNTHETIC if found.synthetic else "DIR"
            command = f"unbend reproduce {name} --data {where} -o OUT" + " --quick" * quick
            pages[name] = str(write_page(folder, name, result, command, described))
            write_index(folder, skipped)
        index = write_index(folder, skipped)
    for name, why in skipped.items():
        say("note", f"{name} was not run: {why}")
    if as_json:
        print_json({"index": str(index), "pages": pages, "not_run": skipped})
    else:
        for name, path in pages.items():
            typer.echo(f"{name:12}{quoted(path)}")
        typer.echo(f"{'index':12}{quoted(str(index))}")
    if not pages:
        raise typer.Exit(EXIT_REFUSED)


@contextmanager
def _progress() -> Iterator[Callable[[str], None]]:
    """Show what is under way; line by line where stderr is a file, for runs that take hours."""
    if sys.stderr is not None and sys.stderr.isatty():
        with steps_on_stderr() as show:
            yield lambda step: show(step, 0)
    else:
        yield lambda step: typer.echo(step, err=True)
