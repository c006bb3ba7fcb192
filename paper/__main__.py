"""Run the experiments of Yang, Obaseki and Chen (2019) again, each into a folder of OUT.

Each page sets the paper's figures beside ours. Finished pieces are kept in OUT/pieces, so an
interrupted run goes on where it stopped. Delete that folder to start anew.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from paper.collection import Collection
from paper.data import SYNTHETIC, open_data
from paper.page import write_index, write_page
from paper.run import Run
from paper.targets import TARGETS, shapes_for
from unbend.errors import InputError, UnbendError
from unbend.report import new_figure
from unbend.spectral import use_cache


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = argparse.ArgumentParser(prog="python -m paper", description=__doc__)
    made.add_argument(
        "target",
        nargs="?",
        choices=[*TARGETS, "all"],
        default="all",
        help="table1 includes Figure 2, its plot; by default, all of them",
    )
    made.add_argument(
        "--data",
        metavar="DIR",
        default=SYNTHETIC,
        help="a folder that holds the shapes of TOSCA and SCAPE, in folders of these names; "
        "by default synthetic, for shapes of our own",
    )
    made.add_argument(
        "-o",
        "--out",
        metavar="OUT",
        type=Path,
        default=Path("reproduction"),
        help="the folder for pages and numbers; by default reproduction",
    )
    made.add_argument("--quick", action="store_true", help="few and small shapes: some minutes")
    made.add_argument("--jobs", type=int, default=1, help="processes at a time; by default 1")
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the arguments ask for and return the exit code."""
    asked = parser().parse_args(arguments)
    try:
        return _reproduce(asked.target, asked.data, asked.out, asked.quick, asked.jobs)
    except UnbendError as error:
        _say(f"error: {error}")
        return 2


@use_cache(gib=0)
def _reproduce(target: str, data: str, out: Path, quick: bool, jobs: int) -> int:
    if jobs < 1:
        raise InputError(f"--jobs must be at least 1, not {jobs}")
    new_figure(1, 1)  # a missing matplotlib is reported before the work
    found = open_data(data, out / "pieces", quick, _say)
    run = Run(
        found.shapes.collection if found.shapes else Collection("TOSCA", {}, {}, None),
        found.scape.collection if found.scape else None,
        quick,
        jobs,
        found.store,
        _say,
    )
    pages: dict[str, Path] = {}
    skipped: dict[str, str] = {}
    for name in TARGETS if target == "all" else [target]:
        try:
            described = shapes_for(name, found)
        except InputError as error:
            if target != "all":
                raise
            skipped[name] = str(error)
            continue
        _say(name)
        result = TARGETS[name](run)
        where = SYNTHETIC if found.synthetic else "DIR"
        command = f"python -m paper {name} --data {where} -o OUT" + " --quick" * quick
        pages[name] = write_page(out, name, result, command, described)
        write_index(out, skipped)
    pages["index"] = write_index(out, skipped)
    for name, why in skipped.items():
        _say(f"note: {name} was not run: {why}")
    for name, path in pages.items():
        print(f"{name:12}{path}")
    return 0


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
