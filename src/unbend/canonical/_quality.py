"""How good a form is: its axes, its stress, and what to know of its eigenvalues."""

from __future__ import annotations

import numpy as np

from unbend._types import FloatArray
from unbend.distances import Metric
from unbend.errors import SolverError

_STRESS_VERTICES = 32  # the stress is over all pairs of so many random vertices
# Tolerance for columns' lengths, right angles and centres, as a share of the largest eigenvalue.
_SKEW = 1e-6


def check_axes(points: FloatArray, eigenvalues: FloatArray, weights: FloatArray, name: str) -> None:
    """Check that the form is centred and its columns are its principal axes."""
    if eigenvalues.max() <= 0:
        raise SolverError(
            f"{name}: all points of the form coincide, because its distances are lost in rounding"
        )
    weighted, largest = points * weights[:, None], float(eigenvalues.max())
    apart = points.T @ weighted - np.diag(np.maximum(eigenvalues, 0))
    middle = weighted.sum(axis=0) / np.sqrt(largest * weights.sum())
    skew = max(float(np.abs(apart).max()) / largest, float(np.abs(middle).max()))
    if not skew <= _SKEW:
        raise SolverError(
            f"{name}: the form is not centred, or its columns are not orthogonal or do not have "
            f"their eigenvalues' lengths, by {skew:.1e} of the largest eigenvalue"
        )


def stress_of(points: FloatArray, metric: Metric, random_state: int) -> float:
    """Relative error of straight distances within a form."""
    order = np.random.default_rng(random_state).permutation(len(points))
    some = np.sort(order[:_STRESS_VERTICES])
    distances = metric.between(some)
    straight = np.linalg.norm(points[some][:, None] - points[some], axis=2)
    return float(np.sqrt(((distances - straight) ** 2).sum() / (distances**2).sum()))


def eigenvalue_notes(values: FloatArray, d: int, equal: float) -> tuple[str, ...]:
    """Describe problems of the first d eigenvalues, by the next one if it is known."""
    notes = []
    negative = int((values[:d] < 0).sum())
    if negative:
        notes.append(
            f"{negative} of the {d} leading eigenvalues are negative (these distances are not "
            "Euclidean); their coordinates are zero"
        )
    apart = values[:-1] - values[1:] > equal * values[:-1]
    if len(values) > d and values[d] > 0 and not apart[d - 1]:
        fewer = np.flatnonzero(apart[: d - 1]) + 1
        choices = " or ".join(str(n) for n in (*fewer[-1:], d + 1))
        notes.append(
            f"eigenvalues {d} and {d + 1} are nearly equal ({values[d - 1]:.6g} and "
            f"{values[d]:.6g}), so the form holds an arbitrary part of their eigenspace; use "
            f"n_components={choices}"
        )
    return tuple(notes)
