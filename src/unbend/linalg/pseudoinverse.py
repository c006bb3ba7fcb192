"""The Green's operator of a Laplacian: its inverse away from the constants."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from unbend._types import FloatArray, SparseMatrix
from unbend.linalg.factorization import factorize


def green_operator(
    stiffness: SparseMatrix, areas: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    r"""Operator K that inverts the stiffness matrix on functions of zero mean.

    ``x = K b`` solves ``W x = b - a (1^T b) / sum(a)`` with ``a^T x = 0``; equally
    ``K = sum_{i >= 1} phi_i phi_i^T / lambda_i`` over all eigenpairs but the constant one.

    Parameters
    ----------
    stiffness : (n, n) sparse matrix
        W: symmetric, positive semi-definite, with the constants alone as null space (a
        connected mesh).
    areas : (n,) ndarray of float64
        a: lumped vertex areas.

    Returns
    -------
    callable
        Maps (n,) to (n,) or (n, r) to (n, r).

    Raises
    ------
    SolverError
        If the matrix is singular beyond the constants.

    References
    ----------
    Lipman, Rustamov and Funkhouser, "Biharmonic distance", ACM TOG 29(3), 2010, section 4.

    Examples
    --------
    >>> import numpy as np, scipy.sparse as sp
    >>> from unbend.linalg.pseudoinverse import green_operator
    >>> path = sp.csr_array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> green_operator(path, np.ones(3))(np.array([1.0, 0.0, -1.0])).round(6) + 0.0
    array([ 1.,  0., -1.])
    """
    return on_zero_means(factorize(pinned(stiffness)).solve, areas)


def pinned(stiffness: SparseMatrix) -> SparseMatrix:
    """Enlarge one diagonal entry of W, which makes it definite, as compressed columns.

    A consistent system stays true: the equations add up to zero, hence that vertex is at zero.
    The solution differs from the one wanted by a constant.
    """
    fixed = sp.csr_array(stiffness, dtype=np.float64).T  # symmetric, and now in compressed columns
    return fixed + sp.csc_array(([fixed.diagonal().max()], ([0], [0])), shape=fixed.shape)


def on_zero_means(solve: Callable[..., FloatArray], areas: FloatArray) -> Callable[..., FloatArray]:
    """Make K of a function that solves ``W x = load`` up to a constant for loads that add up to 0.

    Further arguments are passed on to `solve`.
    """
    total = areas.sum()
    ones = np.ones(len(areas))  # products with it are faster than sums over an axis

    def green(rhs: FloatArray, *options: Any, **more: Any) -> FloatArray:
        load = np.einsum("i,...->i...", areas, ones @ rhs / -total)  # faster than their outer
        load += rhs
        solution = solve(load, *options, **more)
        solution -= areas @ solution / total
        return solution

    return green
