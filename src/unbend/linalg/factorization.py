"""Sparse symmetric factorisation behind one small interface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from unbend._types import FloatArray, SparseMatrix
from unbend.errors import SolverError


@dataclass(frozen=True, eq=False)
class Factorization:
    """A factorised sparse symmetric matrix.

    Attributes
    ----------
    n_negative : int
        Number of negative eigenvalues of the matrix (Sylvester's law of inertia).
    """

    n_negative: int
    _lu: Any

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solve for one right-hand side (n,) or a block of them (n, r)."""
        solution: FloatArray = self._lu.solve(np.asarray(rhs, dtype=np.float64))
        return solution


def factorize(matrix: SparseMatrix) -> Factorization:
    """Factorise a sparse, symmetric, non-singular matrix.

    Parameters
    ----------
    matrix : (n, n) sparse matrix of float64
        Symmetric; may be indefinite.

    Returns
    -------
    Factorization

    Raises
    ------
    SolverError
        If the matrix is singular.

    Examples
    --------
    >>> import scipy.sparse as sp
    >>> from unbend.linalg.factorization import factorize
    >>> factorize(sp.csc_array([[2.0, 1.0], [1.0, 3.0]])).solve([3.0, 4.0])
    array([1., 1.])
    """
    try:
        lu = spla.splu(
            sp.csc_matrix(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise SolverError(f"the matrix is singular and cannot be factorised ({error})") from None
    return Factorization(n_negative=int((lu.U.diagonal() < 0).sum()), _lu=lu)
