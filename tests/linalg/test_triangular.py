"""Solves with L D L^T, chunk by chunk, against dense ones."""

import numpy as np
import pytest
import scipy.sparse as sp

from unbend.linalg._chunks import moves
from unbend.linalg._triangular import chunk_solver


@pytest.mark.kernels
@pytest.mark.parametrize("width", [1, 8, 16])
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
    load, unload = moves(width)
    for first in range(0, count, width):
        chunk = np.empty((n, width))
        load(order, rhs, first, chunk, 0, n)
        chunk_solver(width)(*factor, chunk)
        unload(order, chunk, first, solution, 0, n)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix, rhs), rtol=0, atol=1e-8)
