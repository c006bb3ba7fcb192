"""What each line of the matcher's plan earns: match sets with the whole plan and without each line.

    python benchmarks/ablation.py SET ... --out FOLDER [--lines NAME ...] [--data FOLDER]
                                  [--pairs N] [--seed S] [--jobs N] [--groups]

SETS and measures are those of benchmarks/match.py. All lines but the first, which proposes from the
spectra, are left out one at a time; a pair for which a line was not run is not matched again
without it. FOLDER keeps the rows of each plan: a run that was interrupted
goes on where it stopped. ``mean`` is the mean error of the maps that are right with both plans, and
``whole`` that of the whole plan's maps of the same pairs. Pairs are lost if only the whole plan's
map is right, and won if only the other one is. CPU seconds are means of a map.
"""

import functools
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from match import WRONG, Row, grouped, leave_out, lines_of_plan, make_parser, measured, read


class Comparison(NamedTuple):
    """Maps of a changed matcher beside those of the matcher as it is."""

    right: int
    mean: float
    mean_before: float
    lost: int
    won: int
    cpu: float
    cpu_before: float


def compare(before: list[Row], after: list[Row]) -> Comparison:
    """Compare maps of the same pairs; mean errors are of those that are right in both."""
    errors = np.array([[row["error"] for row in rows] for rows in (before, after)])
    was, right = errors < WRONG
    both = was & right
    mean_before, mean = errors[:, both].mean(axis=1) if both.any() else (np.nan, np.nan)
    cpu_before, cpu = (float(np.mean([row["cpu"] for row in rows])) for rows in (before, after))
    lost, won = int((was & ~right).sum()), int((right & ~was).sum())
    return Comparison(int(right.sum()), float(mean), float(mean_before), lost, won, cpu, cpu_before)


def keep_the_same(whole: list[Row], name: str, out: Path, changed: str) -> None:
    """Keep the rows of pairs for which a line of the plan was not run as those without it."""
    if not read(out):
        rows = [row | {"changed": changed} for row in whole if name not in row["lines"]]
        out.write_text("".join(f"{json.dumps(row)}\n" for row in rows))


def line(label: str, before: list[Row], after: list[Row]) -> str:
    """One line of the table."""
    one = compare(before, after)
    return (
        f"{label:32}{len(after):6}{one.right:7}{one.mean:9.4f}{one.mean_before:9.4f}"
        f"{one.lost:6}{one.won:6}{one.cpu:8.2f}"
    )


def print_table(whole: list[Row], without: dict[str, list[Row]], groups: bool) -> None:
    """Print a line for each plan, and below it one for each set."""
    print(f"{'left out':32} pairs  right     mean    whole  lost   won   CPU s")
    for name, rows in {"nothing": whole, **without}.items():
        print(line(name, whole, rows))
        if groups:
            before = grouped(whole, groups=False)
            for kind, after in grouped(rows, groups=False).items():
                print(line(f"  {kind}", before[kind], after))


def main() -> None:
    """Match what is missing, print the table."""
    parser = make_parser(__doc__)
    parser.add_argument("--out", type=Path, metavar="FOLDER", required=True)
    parser.add_argument("--lines", nargs="+", metavar="NAME", help="of the plan; all by default")
    parser.add_argument("--groups", action="store_true", help="a line for each set")
    given = parser.parse_args()
    lines = lines_of_plan()[1:]
    if unknown := set(given.lines or ()).difference(lines):
        parser.error(f"the plan has no {unknown.pop()} to leave out; it has {', '.join(lines)}")
    given.out.mkdir(parents=True, exist_ok=True)
    whole = measured(given, given.out / "whole.jsonl")
    without = {}
    for name in given.lines or lines:
        set_up = functools.partial(leave_out, [name])
        out, changed = given.out / f"{name}.jsonl", f"without {name}"
        keep_the_same(whole, name, out, changed)
        without[name] = measured(given, out, changed, set_up)
    print_table(whole, without, given.groups)


if __name__ == "__main__":
    main()
