"""Small array helpers that NumPy lacks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeGuard

import numpy as np
import numpy.typing as npt

from unbend._types import FloatArray, IntArray
from unbend.errors import InputError

# Values that a symmetry makes equal come out of a solver with errors far below this share.
_ROUNDING = 1e-6
_GRID_BITS = 27
_LEAST_SINGLE = 2.0**-149  # of 32-bit numbers
_COARSE = 0.1  # of the distance between points: rounding to longer steps turns faces about


def is_whole(number: Any) -> TypeGuard[int]:
    """Whether a number counts something: a whole number, and no truth value."""
    return isinstance(number, (int, np.integer)) and not isinstance(number, bool)


def check_whole(number: Any, name: str, least: int = 0, most: int | None = None) -> int:
    """Return a whole number as an int, for NumPy's may overflow; InputError if out of bounds."""
    if not is_whole(number) or number < least or (most is not None and number > most):
        bounds = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise InputError(f"{name} must be a whole number {bounds}, not {number!r}")
    return int(number)


def check_choice(given: Any, name: str, choices: Iterable[str]) -> None:
    """Raise InputError, which lists the choices, unless it is one of them."""
    known = list(choices)  # of which a list or an array is none, and no error
    if not isinstance(given, str) or given not in known:
        raise InputError(f"{name} must be one of {', '.join(known)}, not {given!r}")


def listed(given: Any, what: str) -> list[Any]:
    """Make a list; InputError for a set, whose order is chance, and for text, which is no list."""
    if isinstance(given, str | bytes | set | frozenset | Mapping) or not isinstance(
        given, Iterable
    ):
        raise InputError(f"{what} must be a list, not {given!r:.60}")
    return list(given)


def is_number(number: Any) -> TypeGuard[float]:
    """Whether it is a real number: no text, no truth value, no array."""
    return is_whole(number) or isinstance(number, (float, np.floating))


def array_of(values: npt.ArrayLike, what: str) -> npt.NDArray[Any]:
    """Turn rows into an array; raise InputError if some are masked, or their lengths differ.

    Text that pandas holds as objects becomes text of NumPy.
    """
    if np.ma.is_masked(values):
        raise InputError(f"{what}: some are masked; fill them, or leave them out")
    try:
        array = np.asarray(values)
    except ValueError:
        raise InputError(f"{what}: rows have different lengths, and must have one") from None
    if array.dtype.kind == "O" and array.size and all(isinstance(one, str) for one in array.flat):
        array = array.astype(np.str_)
    return array


def values_of(values: npt.ArrayLike) -> npt.NDArray[Any]:
    """Turn real numbers, truth values or text into an array; raise InputError for all else."""
    array = array_of(values, "values")
    if array.dtype.kind not in "biufU":
        raise InputError(f"values of type {array.dtype} are neither numbers nor labels")
    return array


def numbers_of(values: npt.ArrayLike, what: str) -> FloatArray:
    """Turn real numbers, whatever their type, into an array of float64; refuse all else."""
    array = array_of(values, what)
    try:
        if array.dtype.kind in "biufO":  # NumPy would cut, count or read others
            return array.astype(np.float64, copy=False)
    except (TypeError, ValueError):
        pass
    raise InputError(f"{what}: needs real numbers, not {array.dtype}")


def unit_of(points: npt.NDArray[Any]) -> float:
    """Power of 2 about as large as points are across: dividing by it rounds nothing.

    Rows that are not finite do not count. Without extent: 1.
    """
    finite = points[np.isfinite(points).all(axis=1)]
    size = float(np.ptp(finite, axis=0).max()) if len(finite) else 0.0
    return float(2.0 ** np.round(np.log2(size))) if size > 0 else 1.0


def coarse_steps(points: npt.NDArray[Any]) -> tuple[float, float] | None:
    """Length of a step of 32-bit numbers where points (n, 3) are, and about how far they are apart.

    None if rounding moves them too little to turn faces about.
    """
    with np.errstate(over="ignore"):
        step = max(float(np.finfo(np.float32).eps * np.abs(points).max()), _LEAST_SINGLE)
        apart = float(np.ptp(points, axis=0).max() / np.sqrt(len(points)))
    return None if step <= _COARSE * apart else (step, apart)


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """Scale vectors (n, 3) to length one; zero stays zero."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300))


def first_equal_row(rows: npt.NDArray[Any]) -> IntArray:
    """Index (n,) of the first row equal to each row of (n, k); NaN equals nothing, -0.0 is 0.0."""
    rows = np.ascontiguousarray(rows + 0)  # + 0 turns -0.0 into 0.0
    first = np.arange(len(rows), dtype=np.int64)
    # Only rows whose hash occurs more than once are compared: all repeated ones and few others.
    mixed = np.zeros(len(rows), dtype=np.uint64)
    for column in rows.view(np.uint64).T:
        mixed = (mixed ^ column) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
    hashes = np.sort(mixed)
    candidates = np.flatnonzero(np.isin(mixed, hashes[1:][hashes[1:] == hashes[:-1]]))
    columns = rows[candidates].T
    order = np.lexsort(columns)  # stable: equal rows stay in their original order
    ordered = columns[:, order]
    starts = np.ones(len(order), dtype=bool)
    starts[1:] = (ordered[:, 1:] != ordered[:, :-1]).any(axis=0)
    group_start = order[starts][np.cumsum(starts) - 1]
    first[candidates[order]] = candidates[group_start]
    return first


def first_largest(values: FloatArray) -> IntArray:
    """Index of the first entry that is the largest but for rounding, along the first axis.

    Of equal values on a symmetric shape, which is largest depends on the last bit, and so on the
    processor; which comes first does not. The largest must not be negative.
    """
    return np.asarray((values >= (1 - _ROUNDING) * values.max(axis=0)).argmax(axis=0))


def snap(values: FloatArray) -> FloatArray:
    """Round to a grid of a 100-millionth of the largest, where sums and differences are exact.

    What should be equal is then equal, and what it decides (the nearest of two points, an order) is
    the same on every processor. What is not finite stays.
    """
    largest = np.abs(values[np.isfinite(values)]).max(initial=0.0)
    cell = 2.0 ** max(int(np.frexp(largest)[1]) - _GRID_BITS, -1000)
    return np.asarray(np.round(values / cell) * cell)


def sum_rows(owners: IntArray, rows: FloatArray, count: int) -> FloatArray:
    """Sum the rows (m, d) of each of `count` owners, (count, d)."""
    return np.column_stack([np.bincount(owners, column, count) for column in rows.T])


def nearest_rows(points: FloatArray, targets: FloatArray) -> IntArray:
    """Row of the nearest target (m, d) to each point (n, d); of equally near ones, the first."""
    from scipy.spatial import cKDTree

    snapped = snap(np.concatenate([targets, points]))
    found: IntArray = cKDTree(snapped[: len(targets)]).query(snapped[len(targets) :])[1]
    return found.astype(np.int64)


def count_repeats(rows: npt.NDArray[Any]) -> int:
    """Count the rows that equal an earlier one."""
    return int((first_equal_row(rows) != np.arange(len(rows))).sum())
