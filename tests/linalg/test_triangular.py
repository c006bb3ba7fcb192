"""Solves with L D L^T, chunk by chunk, against dense ones."""

import numba
import numpy as np
import pytest
import scipy.sparse as sp

from unbend.linalg import _triangular
from unbend.linalg._chunks import load, unload
from unbend.linalg._triangular import chunk_solver


@pytest.mark.kernels
@pytest.mark.parametrize("width", [8, 16])
def test_chunks_of_columns_are_solved(width):
    n, count = 30, 20
    rng = np.random.default_rng(width)
    lower = sp.csc_matrix(np.tril(sp.random_array((n, n), density=0.3, rng=rng).toarray(), -1))
    pivots = rng.choice([-1.0, 1.0], n) * rng.uniform(1, 2, n)
    order = rng.permutation(n).astype(np.int32)
    unit = lower.toarray() + np.eye(n)
    matrix = np.empty((n, n))
    matrix[np.ix_(order, order)] = unit * pivots @ unit.T
    factor = lower.indptr.astype(np.int64), lower.indices.astype(np.int32), lower.data, 1 / pivots
    rhs = rng.standard_normal((n, count))
    solution = np.full((n, count), np.nan)
    for first in range(0, count, width):
        chunk = np.empty((n, width))
        load(order, rhs, first, chunk, 0, n)
        chunk_solver(width)(*factor, chunk)
        unload(order, chunk, first, solution, 0, n)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix, rhs), rtol=0, atol=1e-8)


@pytest.mark.kernels
@pytest.mark.parametrize("width", [8, 16])
def test_columns_past_the_last_are_zero(width):
    order = np.array([2, 0, 3, 1], np.int32)
    rhs = np.arange(1.0, 13.0).reshape(4, 3)
    chunk = np.full((4, width), np.nan)
    load(order, rhs, 2, chunk, 1, 3)
    assert chunk[1:3, 0].tolist() == [rhs[0, 2], rhs[3, 2]]
    assert (chunk[1:3, 1:] == 0).all()
    assert np.isnan(chunk[[0, 3]]).all()  # rows that were not asked for
    solution = np.zeros((4, 3))
    unload(order, chunk, 2, solution, 1, 3)
    np.testing.assert_array_equal(solution, rhs * (np.arange(3) == 2) * [[1], [0], [0], [1]])


@pytest.mark.parametrize("width", [8, 16])
def test_the_code_generated_does_what_is_written_beside_it(width):
    """Compiled anew, not taken from what was kept."""
    subtract = _triangular._subtract_row

    @numba.njit
    def change(rows):
        subtract(rows, 2, 0.5, 0, width)

    rows = np.random.default_rng(0).standard_normal((3, width))
    expected = rows.copy()
    _triangular._subtract(expected, 2, 0.5, 0, width)
    change(rows)
    np.testing.assert_allclose(rows, expected, rtol=1e-14)
