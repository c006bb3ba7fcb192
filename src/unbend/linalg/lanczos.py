"""Eigenpairs of sparse symmetric problems: smallest generalised ones, largest of an operator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from unbend._types import FloatArray, SparseMatrix
from unbend.linalg.factorization import factorize

_DENSE_LIMIT = 300


def smallest_eigenpairs(
    stiffness: SparseMatrix,
    areas: FloatArray,
    k: int,
    *,
    tol: float = 1e-8,
    random_state: int = 0,
    progress: Callable[[float], None] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Compute the k smallest eigenpairs of ``stiffness @ x = value * areas * x``.

    Parameters
    ----------
    stiffness : (n, n) sparse matrix of float64
        Symmetric, positive semi-definite.
    areas : (n,) array of float64
        Positive diagonal of the mass matrix.
    k : int
        Number of eigenpairs, 1 <= k <= n.
    tol : float
        Largest relative residual accepted.
    random_state : int
        Seed of the starting vectors.
    progress : callable, optional
        Called with the share of the work done, from 0 to 1.

    Returns
    -------
    values : (k,) array of float64
        Ascending.
    vectors : (n, k) array of float64
        Orthonormal in the area inner product.

    Examples
    --------
    >>> import numpy as np, scipy.sparse as sp
    >>> from unbend.linalg.lanczos import smallest_eigenpairs
    >>> path = sp.csc_array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> values, vectors = smallest_eigenpairs(path, np.ones(3), 2)
    >>> bool(np.allclose(values, [0.0, 1.0]))
    True
    """
    n = len(areas)
    root = np.sqrt(areas)
    scaled = sp.csc_array(sp.diags_array(1 / root) @ stiffness @ sp.diags_array(1 / root))
    if n <= max(_DENSE_LIMIT, 2 * k + 2):
        values, vectors = scipy.linalg.eigh(scaled.toarray(), subset_by_index=(0, k - 1))
    else:
        sigma = -1e-2 * 4 * np.pi / areas.sum()
        factor = factorize(sp.csc_array(scaled - sigma * sp.eye_array(n)))
        start = np.random.default_rng(random_state).standard_normal(n)
        inverse = spla.LinearOperator((n, n), matvec=factor.solve, dtype=np.float64)
        values, vectors = spla.eigsh(
            scaled, k, sigma=sigma, OPinv=inverse, v0=start, ncv=min(n, 2 * k + 20)
        )
    if progress is not None:
        progress(1.0)
    order = np.argsort(values)
    return values[order], vectors[:, order] / root[:, None]


def largest_eigenpairs(
    operator: Callable[[FloatArray], FloatArray],
    n: int,
    k: int,
    *,
    tol: float = 1e-10,
    random_state: int = 0,
    block_size: int = 2,
) -> tuple[FloatArray, FloatArray]:
    """Compute the k algebraically largest eigenpairs of a symmetric operator.

    Parameters
    ----------
    operator : callable
        Takes an (n, b) array of float64 and returns the operator times it.
    n : int
        Size of the operator.
    k : int
        Number of eigenpairs.
    tol : float
        Largest residual accepted, relative to the largest eigenvalue.
    random_state : int
        Seed of the starting vectors.
    block_size : int
        Number of vectors the operator is given at once.

    Returns
    -------
    values : (k,) array of float64
        Descending.
    vectors : (n, k) array of float64
        Orthonormal.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.linalg.lanczos import largest_eigenpairs
    >>> diagonal = np.arange(5.0)
    >>> largest_eigenpairs(lambda x: diagonal[:, None] * x, 5, 2)[0].round(6)
    array([4., 3.])
    """
    if n <= max(_DENSE_LIMIT, 2 * k + 2):
        dense = operator(np.eye(n))
        values, vectors = scipy.linalg.eigh((dense + dense.T) / 2)
        return values[::-1][:k], vectors[:, ::-1][:, :k]
    start = np.random.default_rng(random_state).standard_normal(n)
    linear = spla.LinearOperator(
        (n, n), matvec=lambda x: operator(x.reshape(-1, 1)).ravel(), dtype=np.float64
    )
    values, vectors = spla.eigsh(linear, k, which="LA", v0=start, tol=tol, ncv=2 * k + 18)
    order = np.argsort(values)[::-1]
    return values[order], vectors[:, order]
