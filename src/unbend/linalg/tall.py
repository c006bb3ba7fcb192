"""Products over tall arrays. Their rows are split among threads."""

from __future__ import annotations

import functools

import numpy as np

from unbend._parallel import row_slices, run_all
from unbend._types import FloatArray, SparseMatrix


def inner(left: FloatArray, right: FloatArray) -> FloatArray:
    """Compute ``left.T @ right`` of tall arrays, (n, p) and (n, q) to (p, q)."""
    parts = run_all(
        functools.partial(lambda rows: left[rows].T @ right[rows], rows)
        for rows in row_slices(len(left))
    )
    total: FloatArray = functools.reduce(np.add, parts)
    return total


def combine(target: FloatArray | None, tall: FloatArray, small: FloatArray) -> FloatArray:
    """Compute ``tall @ small``, (n, p) and (p, q) to (n, q), or subtract it from ``target``."""
    if target is None:
        result = np.empty((len(tall), small.shape[1]))

        def work(rows: slice) -> None:
            result[rows] = (small.T @ tall[rows].T).T  # transposed, BLAS is faster
    else:
        result = target

        def work(rows: slice) -> None:
            result[rows] -= (small.T @ tall[rows].T).T

    run_all(functools.partial(work, rows) for rows in row_slices(len(tall)))
    return result


def rotate(tall: FloatArray, small: FloatArray) -> None:
    """Replace tall columns (n, p) by ``tall @ small``, in place."""

    def work(rows: slice) -> None:
        tall[rows] = (small.T @ tall[rows].T).T

    run_all(functools.partial(work, rows) for rows in row_slices(len(tall)))


def column_dots(left: FloatArray, right: FloatArray) -> FloatArray:
    """Compute the inner product of each column of (n, r) with the other's, to (r,)."""

    def work(rows: slice) -> FloatArray:
        return np.asarray(np.einsum("ij,ij->j", left[rows], right[rows]))

    return np.asarray(sum(run_all(functools.partial(work, rows) for rows in row_slices(len(left)))))


def column_lengths(block: FloatArray) -> FloatArray:
    """Compute the Euclidean norm of each column, (n, r) to (r,)."""
    return np.asarray(np.sqrt(column_dots(block, block)))


def scale_and_add(
    target: FloatArray, share: FloatArray | float, factor: FloatArray | float, other: FloatArray
) -> None:
    """Replace each column by a share of it and a multiple of the other's, in place."""

    def work(rows: slice) -> None:
        if np.any(share != 1.0):
            target[rows] *= share
        target[rows] += factor * other[rows]

    run_all(functools.partial(work, rows) for rows in row_slices(len(target)))


def sparse_product(matrix: SparseMatrix, block: FloatArray, out: FloatArray) -> None:
    """Put ``matrix @ block`` into ``out``; the matrix is in compressed rows."""

    def work(rows: slice) -> None:
        out[rows] = matrix[rows] @ block

    run_all(functools.partial(work, rows) for rows in row_slices(len(out)))
