"""How far the confidence of maps holds, and what its four constants would be if they were fitted.

    python benchmarks/confidence.py FILE ...

FILES are rows of two sets or more that benchmarks/match.py wrote (``--out``), refused maps left
out. Prints how many maps are right of those in each of ten classes of confidence. Then fits the
constants of `unbend.matching._score.plausibility` and `lead_shares` by maximum likelihood, and
prints how well the confidence holds on each set with the constants fitted to the other sets.

First it prints how well the expected errors of vertices hold on each set: the share of the vertices
and of the area whose error is below, and Spearman's rank correlation with the error,
within maps (mean) and over all vertices of the set.
"""

import argparse
from pathlib import Path

import numpy as np
from match import SURE, WRONG, Row, calibration_error, read
from scipy.optimize import minimize
from scipy.stats import spearmanr

from unbend._types import FloatArray
from unbend.matching._score import alike_share, lead_shares, plausibility

START = (0.3, 0.03, 0.5, 0.04)
LEAST = 5  # right maps, and wrong ones
STEEP = 0.002  # keeps a fit that few wrong maps decide from a step


def confidences(rows: list[Row], constants: FloatArray) -> FloatArray:
    """Confidence of every row with other constants."""
    found = []
    for row in rows:
        costs = np.array(row["energies"])
        partial = "relaxed" in row["lines"]  # a line of the plan that runs for partial shapes only
        shares = lead_shares(costs, partial, constants[3])
        share = alike_share(shares, np.array(row["differences"]))
        trust = share * plausibility(costs[0], row["disorder"], constants[:3])
        found.append(min(trust, row["confidence_bound"]))
    return np.array(found)


def fitted(rows: list[Row], right: FloatArray) -> FloatArray:
    """Constants of the greatest likelihood."""

    def loss(logs: FloatArray) -> float:
        said = np.clip(confidences(rows, np.exp(logs)), 1e-4, 1 - 1e-4)
        likelihood = np.mean(right * np.log(said) + (1 - right) * np.log(1 - said))
        return float(STEEP * np.log(START[1] / np.exp(logs[1])) ** 2 - likelihood)

    return np.exp(minimize(loss, np.log(START), method="Nelder-Mead").x)


def held_out(rows: list[Row], right: FloatArray) -> FloatArray:
    """Confidence of every row with the constants that are fitted to the other sets."""
    sets = np.array([row["set"] for row in rows])
    found = np.empty(len(rows))
    for name in np.unique(sets):
        used = [row for row in rows if row["set"] != name]
        rest = [row for row in rows if row["set"] == name]
        found[sets == name] = confidences(rest, fitted(used, right[sets != name]))
    return found


def print_sets(rows: list[Row], trust: FloatArray, right: FloatArray) -> None:
    """Print how well the confidence holds on each set."""
    for name in dict.fromkeys(row["set"] for row in rows):
        some = np.array([row["set"] == name for row in rows])
        sure = some & (trust > SURE)
        print(
            f"  {name:22}{some.sum():5}  said {trust[some].mean():.2f}  right "
            f"{right[some].mean():.2f}  calibration error "
            f"{calibration_error(trust[some], right[some]):.3f}  wrong of those above {SURE}: "
            f"{int((sure & (right == 0)).sum())} of {int(sure.sum())}"
        )


def print_reliability(trust: FloatArray, right: FloatArray) -> None:
    """Print shares of right maps by confidence, and what they come to."""
    classes = np.minimum((10 * trust).astype(int), 9)
    for i in np.unique(classes):
        some = classes == i
        said, held = trust[some].mean(), right[some].mean()
        print(f"  {i / 10:.1f} on  {some.sum():5}  said {said:.2f}  right {held:.2f}")
    sure = trust > SURE
    print(
        f"  calibration error {calibration_error(trust, right):.3f}, Brier score "
        f"{np.mean((trust - right) ** 2):.3f}, wrong of those above {SURE}: "
        f"{int((sure & (right == 0)).sum())} of {int(sure.sum())}"
    )


def print_expected(rows: list[Row]) -> None:
    """Print how well the expected errors of vertices hold on each set."""
    points = [(row["set"], row["points"]) for row in rows if "points" in row]
    for name in [*dict.fromkeys(one for one, _ in points), "all"] if points else []:
        some = [one for of, one in points if name in (of, "all")]
        every = {key: np.concatenate([one[key] for one in some]) for key in some[0]}
        below = every["error"] <= every["expected"]
        within = np.nanmean([_rank_correlation(one) for one in some])
        print(
            f"  {name:22}{len(some):5}  below {below.mean():.2f} of vertices, "
            f"{every['area'] @ below / every['area'].sum():.2f} of area  "
            f"rank correlation within maps {within:.2f}, of all {_rank_correlation(every):.2f}  "
            f"median error {np.median(every['error']):.3f}, expected "
            f"{np.median(every['expected']):.3f}"
        )


def _rank_correlation(points: dict[str, FloatArray]) -> float:
    return float(spearmanr(points["error"], points["expected"]).statistic)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    rows = [row for file in parser.parse_args().files for row in read(file) if "energies" in row]
    print("expected errors of vertices:")
    print_expected(rows)
    right = np.array([float(row["error"] < WRONG) for row in rows])
    n_sets = len({row["set"] for row in rows})
    if min(right.sum(), len(rows) - right.sum()) < LEAST or n_sets < 2:
        parser.error(
            f"a fit takes {LEAST} right maps and {LEAST} wrong ones of two sets; of the "
            f"{len(rows)} in the files, of {n_sets}, {right.sum():.0f} are right"
        )
    print(f"{len(rows)} maps as they were matched:")
    trust = np.array([row["confidence"] for row in rows])
    print_reliability(trust, right)
    print_sets(rows, trust, right)
    even, spread, weight, lead = fitted(rows, right)
    print(f"fitted to all: even {even:.3f}, spread {spread:.4f}, disorder {weight:.2f}, lead "
          f"{lead:.4f}; to all sets but one, on that one:")  # fmt: skip
    trust = held_out(rows, right)
    print_reliability(trust, right)
    print_sets(rows, trust, right)


if __name__ == "__main__":
    main()
