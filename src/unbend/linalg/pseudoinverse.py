"""The Green's operator of a Laplacian: its inverse away from the constants."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

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
    >>> green_operator(path, np.ones(3))(np.array([1.0, 0.0, -1.0]))
    array([ 1.,  0., -1.])
    """
    total = areas.sum()
    # The system is consistent, so one vertex may be fixed at zero: what is left is definite,
    # and the solution differs from the wanted one by a constant.
    factor = factorize(stiffness[1:, 1:])

    def green(rhs: FloatArray) -> FloatArray:
        # The equation of the fixed vertex is left out, so its right-hand side never enters.
        load = rhs[1:] - np.multiply.outer(areas[1:], rhs.sum(axis=0) / total)
        solution = np.zeros(rhs.shape)
        solution[1:] = factor.solve(load)
        solution -= areas @ solution / total
        return solution

    return green
