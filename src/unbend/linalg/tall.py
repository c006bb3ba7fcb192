"""Products over tall arrays. Their rows are split among threads."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from unbend._parallel import run_all, slices
from unbend._types import FloatArray, SparseMatrix

_ROWS = 16_384  # rows a task works on; fixed, so that results do not depend on the core count


def _by_rows(work: Callable[[slice], Any], n: int) -> list[Any]:
    return run_all(functools.partial(work, rows) for rows in slices(n, _ROWS))


def inner(left: FloatArray, right: FloatArray) -> FloatArray:
    """Compute ``left.T @ right`` of tall arrays, (n, p) and (n, q) to (p, q)."""
    parts = _by_rows(lambda rows: left[rows].T @ right[rows], len(left))
    return np.asarray(functools.reduce(np.add, parts))


def multiply(tall: FloatArray, small: FloatArray, out: FloatArray | None = None) -> FloatArray:
    """Compute ``tall @ small``, (n, p) and (p, q) to (n, q); ``out`` may be ``tall``."""
    result = np.empty((len(tall), small.shape[1])) if out is None else out

    def work(rows: slice) -> None:
        result[rows] = (small.T @ tall[rows].T).T  # transposed, BLAS is faster

    _by_rows(work, len(tall))
    return result


def subtract_product(target: FloatArray, tall: FloatArray, small: FloatArray) -> None:
    """Subtract ``tall @ small`` from ``target``, in place."""

    def work(rows: slice) -> None:
        target[rows] -= (small.T @ tall[rows].T).T

    _by_rows(work, len(tall))


def column_lengths(block: FloatArray) -> FloatArray:
    """Compute the Euclidean norm of each column, (n, r) to (r,)."""
    parts = _by_rows(lambda rows: np.einsum("ij,ij->j", block[rows], block[rows]), len(block))
    return np.asarray(np.sqrt(sum(parts)))


def sparse_residuals(
    matrix: SparseMatrix, vectors: FloatArray, values: FloatArray | float, out: FloatArray
) -> None:
    """Put ``matrix @ vectors - values * vectors`` into ``out``; the matrix is in CSR format."""

    def work(rows: slice) -> None:
        out[rows] = matrix[rows] @ vectors
        out[rows] -= values * vectors[rows]

    _by_rows(work, len(out))
