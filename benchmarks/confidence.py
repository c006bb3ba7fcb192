"""How far the confidence of maps holds, and what its three constants would be if they were fitted.

    python benchmarks/confidence.py FILE ...

FILES are rows that benchmarks/match.py wrote (``--out``), refused maps left out. Prints how many
maps are right of those in each of ten classes of confidence. Then fits the constants of
`unbend.matching._score.probabilities` by maximum likelihood, and prints how well the confidence
holds with them on the fifth of the maps that each of five fits did without.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from match import SURE, WRONG, Row, calibration_error, read
from scipy.optimize import minimize

from unbend._types import FloatArray
from unbend.matching._score import probabilities

START = (0.3, 0.03, 0.04)
N_FOLDS = 5


def confidences(rows: list[Row], constants: FloatArray) -> FloatArray:
    """Confidence of every row with other constants."""
    found = []
    for row in rows:
        energies = np.array(row["energies"])
        trust = probabilities(energies, energies, row["overlap"], constants)[0]
        found.append(min(trust, row["confidence_bound"]))
    return np.array(found)


def fitted(rows: list[Row], right: FloatArray) -> FloatArray:
    """Constants of the greatest likelihood."""

    def loss(logs: FloatArray) -> float:
        said = np.clip(confidences(rows, np.exp(logs)), 1e-4, 1 - 1e-4)
        return float(-np.mean(right * np.log(said) + (1 - right) * np.log(1 - said)))

    return np.exp(minimize(loss, np.log(START), method="Nelder-Mead").x)


def held_out(rows: list[Row], right: FloatArray) -> FloatArray:
    """Confidence of every row with the constants that are fitted to four fifths without it."""
    fold = np.random.default_rng(0).permutation(len(rows)) % N_FOLDS
    found = np.empty(len(rows))
    for k in range(N_FOLDS):
        used = [row for row, one in zip(rows, fold, strict=True) if one != k]
        rest = [row for row, one in zip(rows, fold, strict=True) if one == k]
        found[fold == k] = confidences(rest, fitted(used, right[fold != k]))
    return found


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


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    rows = [row for file in parser.parse_args().files for row in read(file) if "energies" in row]
    right = np.array([float(row["error"] < WRONG) for row in rows])
    if min(right.sum(), len(rows) - right.sum()) < N_FOLDS:
        parser.error(
            f"a fit takes {N_FOLDS} right maps and {N_FOLDS} wrong ones; of the {len(rows)} in the "
            f"files {right.sum():.0f} are right"
        )
    print(f"{len(rows)} maps as they were matched:")
    print_reliability(np.array([row["confidence"] for row in rows]), right)
    even, spread, lead = fitted(rows, right)
    print(f"fitted to all: even {even:.3f}, spread {spread:.4f}, lead {lead:.4f}; to four fifths, "
          "on the fifth that was left:")  # fmt: skip
    print_reliability(held_out(rows, right), right)


if __name__ == "__main__":
    main()
