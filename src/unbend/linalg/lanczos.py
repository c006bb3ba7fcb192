"""Eigenpairs of sparse symmetric problems: smallest generalised ones, largest of an operator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from unbend._parallel import COLUMNS, n_threads, one_blas_thread
from unbend._types import FloatArray, SparseMatrix
from unbend.errors import InputError, SolverError
from unbend.linalg._inverse import ROUNDING, inverse_lanczos, least_that_counts
from unbend.linalg._krylov import KrylovBasis, Operator

_LIMIT = 1_000  # columns of the basis beyond ten for each pair before giving up


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

    Block Lanczos on the inverse, shifted into the spectrum, with full orthogonalisation [1]_. The
    signs of the pivots of L D L^T count the eigenvalues below a shift (Sylvester), here below the
    one in use and below one just above the last pair: no pair is missed, however many are equal.

    Parameters
    ----------
    stiffness : (n, n) sparse matrix of float64
        Symmetric, positive semi-definite.
    areas : (n,) array of float64
        Positive diagonal of the mass matrix.
    k : int
        Number of eigenpairs, 1 <= k <= n.
    tol : float
        Largest relative residual: |W x - value A x| / |value A x| in the norm of A^-1. Values
        close to 0 count as if they were the mean distance between the first k (if all k are 0: as
        1e-6 of the median of the diagonal of A^-1/2 W A^-1/2). What rounding in the product W x
        makes unavoidable comes on top.
    random_state : int
        Seed of the starting vectors. The same input gives the same output.
    progress : callable, optional
        Called with the share of the work done, from 0 to 1.

    Returns
    -------
    values : (k,) array of float64
        Ascending, none negative.
    vectors : (n, k) array of float64
        Orthonormal in the area inner product: ``vectors.T @ (areas[:, None] * vectors) = I``.

    Raises
    ------
    InputError
        If an argument has the wrong shape or values.
    SolverError
        If the accuracy is not reached.

    References
    ----------
    .. [1] R. G. Grimes, J. G. Lewis, H. D. Simon, "A shifted block Lanczos algorithm for solving
       sparse symmetric generalized eigenproblems", SIAM J. Matrix Anal. Appl. 15, 1994.

    Examples
    --------
    >>> import numpy as np, scipy.sparse as sp
    >>> from unbend.linalg.lanczos import smallest_eigenpairs
    >>> path = sp.csc_array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> values, vectors = smallest_eigenpairs(path, np.ones(3), 2)
    >>> bool(np.allclose(values, [0.0, 1.0]))
    True
    """
    areas = np.asarray(areas, dtype=np.float64)
    n = len(areas)
    if stiffness.shape != (n, n) or areas.ndim != 1:
        raise InputError(f"stiffness is {stiffness.shape} and areas {areas.shape}: they must agree")
    if not (np.isfinite(areas).all() and (areas > 0).all()):
        raise InputError("all areas must be positive and finite")
    if not 1 <= k <= n:
        raise InputError(f"k = {k} eigenpairs of a problem of size {n}: k must be from 1 to {n}")
    # Unit total area and a plain inner product: A^-1/2 W A^-1/2 has the eigenvalues of the problem.
    total = areas.sum()
    weights = np.sqrt(areas / total)
    scaling = sp.diags_array(1 / weights)
    scaled = sp.csc_matrix(scaling @ sp.csc_matrix(stiffness, dtype=np.float64) @ scaling)
    if not np.isfinite(scaled.data).all():
        raise InputError("the stiffness matrix holds NaN or infinite values")
    with one_blas_thread():
        small = _dense_is_faster(n, k)
        if small:
            values, vectors = scipy.linalg.eigh(scaled.toarray(), subset_by_index=(0, k - 1))
            # Its errors are those of the largest entries, and sliver triangles have huge ones.
            clipped = np.maximum(values, 0)
            _, residual = measure_eigenpairs(scaled, np.ones(n), clipped, vectors, tol)
        if not small or not residual <= tol:
            values, vectors = inverse_lanczos(scaled, k, tol, random_state, progress)
    if progress is not None:
        progress(1.0)
    return np.maximum(values, 0) / total, vectors / (weights * np.sqrt(total))[:, None]


def working_columns(k: int) -> int:
    """Predict how many columns of n numbers :func:`smallest_eigenpairs` keeps at once.

    Fitted to 10, 100 and 300 pairs of meshes of 50,000 to 500,000 vertices, in 1 to 16 threads.
    """
    # The basis has about 1.6 k + 75 columns, and polishing copies what it found. Each thread solves
    # for three chunks of columns.
    busy = min(n_threads(), k // 12 + 1)
    return 4 * k + 75 + 3 * COLUMNS * busy


def measure_eigenpairs(
    stiffness: SparseMatrix,
    areas: FloatArray,
    values: FloatArray,
    vectors: FloatArray,
    tol: float,
) -> tuple[float, float]:
    """Measure the errors of eigenpairs, from one random combination of them.

    Pairs that are off by some share make a combination that is off by about as much, so one product
    with the matrix measures all pairs at once.

    Parameters
    ----------
    stiffness, areas, tol
        As :func:`smallest_eigenpairs` had them.
    values, vectors : (k,) and (n, k) arrays of float64

    Returns
    -------
    skew, residual : float
        About the size of ``vectors.T @ (areas[:, None] * vectors) - I``, and that of the relative
        residuals. If the residual is above `tol`, what rounding makes unavoidable is subtracted.
    """
    floor = least_that_counts(values, stiffness.diagonal() / areas)
    shares = np.random.default_rng(0).standard_normal((len(values), 2))
    shares[:, 1] /= np.maximum(values, floor)
    weights = np.sqrt(areas)
    plain, scaled = (vectors @ shares).T
    skew = float(np.linalg.norm(vectors.T @ (areas * plain) - shares[:, 0]))
    image = stiffness @ scaled - areas * (vectors @ (values * shares[:, 1]))
    residual = float(np.linalg.norm(image / weights))
    if residual > tol:
        sizes = abs(stiffness) @ (np.abs(vectors) @ np.abs(shares[:, 1]))
        residual = max(residual - ROUNDING * float(np.linalg.norm(sizes / weights)), 0.0)
    return skew, residual


def largest_eigenpairs(
    operator: Operator,
    n: int,
    k: int,
    *,
    tol: float = 1e-10,
    random_state: int = 0,
    block_size: int | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Compute the k algebraically largest eigenpairs of a symmetric operator.

    Block Lanczos with full orthogonalisation; stops as soon as the k leading pairs are accurate.

    Parameters
    ----------
    operator : callable
        Takes an (n, b) array of float64 and returns the operator times it, a new array.
    n, k : int
        Size of the operator, and number of eigenpairs.
    tol : float
        Largest residual |operator(x) - value x|, relative to the largest absolute eigenvalue.
    random_state : int
        Seed of the starting vectors. The same input gives the same output.
    block_size : int, optional
        Number of vectors the operator is given at once, k + 3 by default. Of an eigenvalue that
        occurs more often than this, copies may be missed.

    Returns
    -------
    values : (k,) array of float64
        Descending.
    vectors : (n, k) array of float64
        Orthonormal.

    Raises
    ------
    InputError
        If k or the block size is out of range.
    SolverError
        If the accuracy is not reached, or the operator returns NaN or infinity.
    """
    if not 1 <= k <= n:
        raise InputError(f"k = {k} eigenpairs of an operator of size {n}: k must be from 1 to {n}")
    block_size = k + 3 if block_size is None else block_size
    if block_size < 1:
        raise InputError(f"block_size = {block_size}: it must be at least 1")
    rng = np.random.default_rng(random_state)
    with one_blas_thread():
        basis = KrylovBasis(operator, n, block_size, rng)
        while True:
            basis.grow()
            values, vectors, coupling = basis.ritz()
            residuals = np.linalg.norm(coupling[:, -k:], axis=0)
            exhausted = basis.done == basis.size
            if exhausted or (basis.done >= k and residuals.max() <= tol * np.abs(values).max()):
                break
            if basis.done > _LIMIT + 10 * k:
                raise SolverError(
                    f"no {k} eigenpairs to a relative residual of {tol:g} in {basis.done} products"
                )
        return values[: -k - 1 : -1], basis.combine(vectors[:, : -k - 1 : -1])


def _dense_is_faster(n: int, k: int) -> bool:
    return n <= max(400, 2 * k + 100)
