"""Solves with L D L^T, chunk by chunk, against dense ones."""

import numpy as np
import pytest
import scipy.sparse as sp

from unbend.linalg._triangular import chunk_solver


@pytest.mark.kernels
@pytest.mark.parametrize("width", [1, 8, 16])
def test_chunks_of_columns_are_solved(width):
    n, count = 30, 20
    rng = np.random.default_rng(width)
    lower = sp.csc_matrix(np.tril(sp.random_array((n, n), density=0.3, rng=rng).toarray(), -1))
    pivots = rng.choice([-1.0, 1.0], n) * rng.uniform(1, 2, n)
    order = rng.permutation(n)
    unit = lower.toarray() + np.eye(n)
    matrix = np.empty((n, n))
    matrix[np.ix_(order, order)] = unit * pivots @ unit.T
    rhs = rng.standard_normal((n, count))
    solution = np.full((n, count), np.nan)
    structure = lower.indptr.astype(np.int64), lower.indices.astype(np.int32), lower.data
    for first in range(0, count, width):
        chunk_solver(width)(order, *structure, 1 / pivots, rhs, solution, first)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix, rhs), rtol=0, atol=1e-8)
