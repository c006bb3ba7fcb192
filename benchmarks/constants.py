"""What each constant of the matcher does: match sets when it is halved, and when it is doubled.

    python benchmarks/constants.py SET ... --out FOLDER [--only NAME ...] [--data FOLDER]
                                   [--pairs N] [--seed S] [--jobs N]

SETS and measures are those of benchmarks/match.py, and constants those of
`unbend.matching._constants`. FOLDER keeps the rows of each: a run that was interrupted goes on
where it stopped. A cell tells how many maps are right and, of those that are right with the
constant as it is too, the mean error, and how many times the mean error with the constant as it is
that makes; last the times of processors' seconds.
"""

import functools
import importlib
from pathlib import Path
from typing import Any

from ablation import compare
from match import Row, make_parser, measured


def constants() -> dict[str, Any]:
    """Return the constants that are numbers or several numbers."""
    from unbend.matching import _constants

    def is_number(value: Any) -> bool:
        return isinstance(value, int | float) and not isinstance(value, bool)

    return {
        name: value
        for name, value in vars(_constants).items()
        if not name.startswith("__")
        and all(map(is_number, value if isinstance(value, tuple) else (value,)))
    }


def scaled(value: Any, factor: float) -> Any:
    """Scale a number, or each of several; whole numbers stay whole."""
    if isinstance(value, tuple):
        return tuple(scaled(one, factor) for one in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def set_constant(name: str, value: Any) -> None:
    """Change a constant in this process; the plan's numbers of candidates follow."""
    from unbend.matching import _constants, _plan

    setattr(_constants, name, value)
    importlib.reload(_plan)


def cell(before: list[Row], after: list[Row]) -> str:
    """Right maps, their mean error and what it was times, and times the processor's seconds."""
    one = compare(before, after)
    error, cpu = one.mean / one.mean_before, one.cpu / one.cpu_before
    return f"{one.right}, {one.mean:.4f} ({error:.2f}), {cpu:.2f}"


def main() -> None:
    """Match what is missing, print the table."""
    parser = make_parser(__doc__)
    parser.add_argument("--out", type=Path, metavar="FOLDER", required=True)
    parser.add_argument("--only", nargs="+", metavar="NAME", help="some constants")
    given = parser.parse_args()
    known = constants()
    if unknown := set(given.only or ()).difference(known):
        parser.error(f"there is no constant {unknown.pop()}; they are {', '.join(known)}")
    given.out.mkdir(parents=True, exist_ok=True)
    before = measured(given, given.out / "as-they-are.jsonl")
    one = compare(before, before)
    print(f"all as they are: {one.right} of {len(before)} right, mean error {one.mean:.4f}, "
          f"{one.cpu:.2f} s\n\n| constant | value | halved | doubled |\n|---|---|---|---|",
          flush=True)  # fmt: skip
    for name in given.only or known:
        cells = []
        for factor in (0.5, 2.0):
            value = scaled(known[name], factor)
            set_up = functools.partial(set_constant, name, value)
            out = given.out / f"{name}.jsonl"
            cells.append(cell(before, measured(given, out, f"{name} = {value}", set_up)))
        print(f"| `{name}` | {known[name]} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
