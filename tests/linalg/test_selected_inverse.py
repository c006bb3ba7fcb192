"""Diagonals from a multifrontal factor, on matrices that give each kind of supernode."""

import numpy as np
import pytest
import scipy.sparse as sp

from tests.linalg.problems import laplacian, scattered
from unbend.errors import SolverError
from unbend.linalg import multifrontal
from unbend.linalg._selected_inverse import inverse_diagonals
from unbend.linalg.factorization import factorize
from unbend.linalg.multifrontal import factor

pytestmark = pytest.mark.kernels


def check(matrix, weights, tolerance):
    dense = np.linalg.inv(matrix.toarray())
    expected = dense.diagonal(), (dense * weights @ dense).diagonal()
    found = factor(sp.csc_matrix(matrix))
    for diagonal, wanted in zip(inverse_diagonals(found, weights), expected, strict=True):
        np.testing.assert_allclose(diagonal, wanted, rtol=0, atol=tolerance * abs(wanted).max())
    (alone,) = inverse_diagonals(found)
    np.testing.assert_array_equal(alone, inverse_diagonals(found, weights)[0])


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 24, 25, 45, 61, 64, 65, 130])
def test_diagonals_of_dense_matrices(size):
    """With supernodes of every kind of width, and weights of either sign."""
    rng = np.random.default_rng(size)
    dense = rng.standard_normal((size, size))
    dense += dense.T + 4 * size**0.5 * np.eye(size)
    check(sp.csc_matrix(dense), rng.standard_normal(size), 1e-13)


@pytest.mark.parametrize("size", [30, 100])
def test_diagonals_of_chains(size):
    """Their separators are single vertices; the matrix is indefinite."""
    rng = np.random.default_rng(size)
    beside = rng.uniform(-1, 1, size - 1)
    middle = rng.uniform(2, 3, size) * rng.choice([-1, 1], size)
    chain = sp.diags_array([beside, middle, beside], offsets=[-1, 0, 1]).tocsr()
    shuffle = rng.permutation(size)
    check(chain[shuffle][:, shuffle], rng.random(size), 1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_diagonals_of_meshes(seed):
    stiffness, areas = laplacian(*scattered(400, seed))
    check(stiffness + sp.diags_array(areas), areas, 1e-12)
    check(stiffness - 30.0 * sp.diags_array(areas), areas, 1e-10)


def test_tall_fronts_are_condensed_piece_by_piece(monkeypatch):
    """Uncompiled, small fronts are tall enough. Compiled, this repeats the test above."""
    monkeypatch.setattr(multifrontal, "_ROWS", 3)
    test_diagonals_of_meshes(0)


def test_diagonals_of_a_graph_in_pieces():
    """Some separators are empty then."""
    rng = np.random.default_rng(0)
    sizes = [1, 1, 2, 3, 30, 70, 1, 5]
    blocks = [sp.coo_array(np.ones((size, size)) + size * np.eye(size)) for size in sizes]
    shuffle = rng.permutation(sum(sizes))
    matrix = sp.block_diag(blocks).tocsr()[shuffle][:, shuffle]
    check(matrix, rng.random(sum(sizes)), 1e-13)


def test_a_shifted_factor_is_refused():
    """Solves refine the shift away; the diagonals would be those of the shifted matrix."""
    found = factorize(sp.csc_array([[0.0, 1.0], [1.0, 0.0]]), diagonal=True)
    np.testing.assert_allclose(found.solve(np.array([3.0, 4.0])), [4.0, 3.0])
    with pytest.raises(SolverError, match="too close to singular for entries of its inverse"):
        found.inverse_diagonals()
