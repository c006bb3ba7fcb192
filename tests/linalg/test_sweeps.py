"""Solves with L D L^T, chunk by chunk, against dense ones."""

import numba
import numpy as np
import pytest
import scipy.sparse as sp

from unbend._parallel import in_chunks
from unbend.linalg import _sweeps
from unbend.linalg._sweeps import solve_chunk


@pytest.mark.kernels
@pytest.mark.parametrize("count", [1, 8, 9, 16, 20])
def test_columns_are_solved(count):
    n = 30
    rng = np.random.default_rng(count)
    lower = sp.csc_matrix(np.tril(sp.random_array((n, n), density=0.3, rng=rng).toarray(), -1))
    pivots = rng.choice([-1.0, 1.0], n) * rng.uniform(1, 2, n)
    order = rng.permutation(n)
    unit = lower.toarray() + np.eye(n)
    matrix = np.empty((n, n))
    matrix[np.ix_(order, order)] = unit * pivots @ unit.T
    factor = lower.indptr.astype(np.int64), lower.indices.astype(np.int32), lower.data, 1 / pivots
    rhs = rng.standard_normal((n, count))

    def solve(chunk):
        solve_chunk(*factor, chunk, (0.0,) * chunk.shape[1])

    solution = in_chunks(order, solve, rhs)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix, rhs), rtol=0, atol=1e-8)


@pytest.mark.parametrize("width", [8, 16])
def test_the_code_generated_does_what_is_written_beside_it(width):
    """Compiled anew, not taken from what was kept."""
    subtract = _sweeps._subtract_row

    @numba.njit
    def change(rows, lanes):
        subtract(rows, 2, 0.5, 0, lanes)

    rows, lanes = np.random.default_rng(0).standard_normal((3, width)), (0.0,) * width
    expected = rows.copy()
    _sweeps._subtract(expected, 2, 0.5, 0, lanes)
    change(rows, lanes)
    np.testing.assert_allclose(rows, expected, rtol=1e-14)
