"""Fit the confidence to pairs of our own bodies, and check it on others that were not used.

    python benchmarks/confidence.py draw FILE [--pairs N] [--seed S] [--vertices N] [--jobs N]
    python benchmarks/confidence.py fit FILE [FILE ...]

``draw`` matches pairs of the sets of benchmarks/hard.py, of one body in two poses and of different
kinds of body, of which no map is right, and appends to a file of JSON lines what the judge said of
every way to match and how far off the best one is. It goes on where an earlier run ended. ``fit``
prints how often maps of each set are right, fits the three constants of the confidence to the pairs
of even numbers, and prints how it holds on those of odd ones, with the constants as they are and as
fitted: in ten classes, as expected calibration error and as Brier score.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from hard import NOTHING, SURE, WRONG, measure
from hard_sets import HARM, KINDS, Case, Chance, Options, draw, own_pair, unchanged
from processes import run_all
from scipy.optimize import minimize

from unbend import match
from unbend._types import FloatArray
from unbend.errors import UnbendError
from unbend.matching._judge import probabilities

# Sets, and how often each is drawn; strengths are drawn evenly.
OFTEN = {
    "one body": 2,
    "proportions": 4,
    "cuts": 3,
    "holes": 2,
    "scans": 1,
    "welds": 2,
    "noise": 1,
    "different kinds": 1,
}
STRENGTHS = {name: [*harm] for name, harm in HARM.items()}
STRENGTHS["cuts"] += ["limb", "overlap 50%"]


def draw_case(number: int, options: Options) -> tuple[str, str, str, Case]:
    """Draw a pair: its set, its kind of body, what was done to it, and the case."""
    chance = np.random.default_rng([options.seed, number])
    share = np.array(list(OFTEN.values())) / sum(OFTEN.values())
    name = str(chance.choice(list(OFTEN), p=share))
    which = int(chance.integers(len(KINDS)))
    if name == "different kinds":
        return name, "", "", _different(chance, options, which)
    if name == "proportions":
        return name, KINDS[which], "", draw(name, KINDS[which], "", number, options)
    done = str(chance.choice(STRENGTHS[name])) if name in STRENGTHS else ""
    # Two in three numbers are of the same kind and of either shape that is harmed.
    numbered = len(KINDS) * (2 * number + int(chance.integers(2))) + which
    return name, KINDS[which], done, draw(name, "own", done, numbered, options)


def _different(chance: Chance, options: Options, which: int) -> Case:
    one, other = (
        own_pair(chance, options, KINDS[(which + i) % len(KINDS)], same_body=True) for i in range(2)
    )
    pair = one._replace(target=other.target)
    return Case(pair, unchanged(pair.source), unchanged(pair.target))


def run_one(number: int, options: Options) -> dict[str, Any]:
    """Match a pair; no map of different kinds is right."""
    warnings.simplefilter("ignore")
    name, kind, done, case = draw_case(number, options)
    row: dict[str, Any] = {"number": number, "set": name, "kind": kind, "done": done}
    try:
        found = match(case.source.mesh, case.target.mesh, cache=False)
    except UnbendError as error:
        return row | {"refused": str(error)}
    row["energies"] = [one.energy for one in found.hypotheses]
    row["overlap"] = min(found.overlap_source, found.overlap_target)
    if name == "different kinds":
        return row | NOTHING
    return row | measure(case, found.source_to_target, found.target_to_source)


def draw_all(file: Path, n_pairs: int, n_jobs: int, options: Options) -> None:
    """Match the pairs that the file lacks."""
    known = {row["number"] for row in read(file)} if file.exists() else set()
    missing = [number for number in range(n_pairs) if number not in known]
    tasks = [(run_one, number, options) for number in missing]
    with file.open("a") as out:
        run_all(tasks, n_jobs, lambda row: print(json.dumps(row), file=out, flush=True))


def read(file: Path) -> list[dict[str, Any]]:
    """Read rows of a file."""
    return [json.loads(line) for line in file.read_text().splitlines() if line.endswith("}")]


def confidences(rows: list[dict[str, Any]], *constants: FloatArray) -> FloatArray:
    """Confidence of every row, with the constants as they are or with others."""
    found = [(np.array(row["energies"]), row["overlap"]) for row in rows]
    return np.array([probabilities(one, one, part, *constants)[0] for one, part in found])


def fitted(rows: list[dict[str, Any]], right: FloatArray) -> FloatArray:
    """Constants of the greatest likelihood."""

    def loss(logs: FloatArray) -> float:
        said = np.clip(confidences(rows, np.exp(logs)), 1e-4, 1 - 1e-4)
        return float(-np.mean(right * np.log(said) + (1 - right) * np.log(1 - said)))

    starts = [np.log([even, 0.03, 0.04]) for even in (0.25, 0.35, 0.45)]
    best = min((minimize(loss, start, method="Nelder-Mead") for start in starts), key=_value)
    return np.exp(best.x)


def _value(result: Any) -> float:
    return float(result.fun)


def print_sets(rows: list[dict[str, Any]], by: Callable[[dict[str, Any]], str]) -> None:
    """Print how often maps are right."""
    for label in sorted({by(row) for row in rows}):
        errors = np.array([row["error"] for row in rows if by(row) == label])
        overlap = np.mean([row["iou"] for row in rows if by(row) == label])
        right = errors < WRONG
        mean = f"{errors[right].mean():.4f}" if right.any() else "     -"
        print(f"{label:34}{right.sum():5} of {len(errors):4}  {mean}  {overlap:.2f}")


def print_reliability(trust: FloatArray, right: FloatArray) -> None:
    """Print shares of right maps by confidence, and what they come to."""
    classes = np.minimum((10 * trust).astype(int), 9)
    gap = 0.0
    for i in range(10):
        some = classes == i
        if some.any():
            gap += abs((trust - right)[some].sum())
            said, held = trust[some].mean(), right[some].mean()
            print(f"  {i / 10:.1f} on  {some.sum():5}  said {said:.2f}  right {held:.2f}")
    sure = trust > SURE
    print(
        f"  calibration error {gap / len(trust):.3f}, Brier score "
        f"{np.mean((trust - right) ** 2):.3f}, wrong of those above {SURE}: "
        f"{int((sure & (right == 0)).sum())} of {int(sure.sum())}"
    )


def fit(files: list[Path]) -> None:
    """Print the tables."""
    rows = [row for file in files for row in read(file) if "refused" not in row]
    print_sets(rows, lambda row: f"{row['set']}, {row['kind'] or 'all'}")
    print_sets(rows, lambda row: f"{row['set']} {row['done']}")
    right = np.array([float(row["error"] < WRONG) for row in rows])
    used = np.array([row["number"] % 2 == 0 for row in rows])
    train, check = ([row for row, one in zip(rows, used, strict=True) if one == k] for k in (1, 0))
    constants = fitted(train, right[used])
    print(f"fitted to {len(train)}: even {constants[0]:.3f}, spread {constants[1]:.4f}, "
          f"lead {constants[2]:.4f}")  # fmt: skip
    for label, given in (("as they are", ()), ("as fitted", (constants,))):
        print(f"{label}, on {len(check)} pairs that were not used:")
        print_reliability(confidences(check, *given), right[~used])


def main() -> None:
    """Draw or fit."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("what", choices=["draw", "fit"])
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--pairs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--vertices", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=1, help="pairs at a time")
    given = parser.parse_args()
    if given.what == "fit":
        fit(given.files)
    else:
        options = Options(given.seed, given.vertices, None, None)
        draw_all(given.files[0], given.pairs, given.jobs, options)


if __name__ == "__main__":
    main()
