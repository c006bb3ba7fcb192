"""Eigenpairs of sparse symmetric problems: smallest generalised ones, largest of an operator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from unbend._types import FloatArray, SparseMatrix
from unbend.errors import InputError, SolverError
from unbend.linalg._krylov import KrylovBasis, Operator
from unbend.linalg._threads import combine, inner, one_blas_thread
from unbend.linalg.factorization import Factorization, factorize

_DENSE = 400  # up to this size the dense solver is faster, and it never misses a pair
_FEW = 30  # up to this many pairs the shift goes above them all: see _first_shift
_LIMIT = 1_000  # columns of the basis beyond ten for each pair before giving up
_ROUNDING = 10 * np.finfo(np.float64).eps


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
        close to 0 count as if they were the mean distance between the first k. What rounding in
        the product ``stiffness @ x`` makes unavoidable comes on top.
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
        if n <= max(_DENSE, 2 * k + 100):
            values, vectors = scipy.linalg.eigh(scaled.toarray(), subset_by_index=(0, k - 1))
        else:
            values, vectors = _inverse_lanczos(scaled, k, tol, random_state, progress)
    if progress is not None:
        progress(1.0)
    return np.maximum(values, 0) / total, vectors / (weights * np.sqrt(total))[:, None]


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
    n : int
        Size of the operator.
    k : int
        Number of eigenpairs, 1 <= k <= n.
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

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.linalg.lanczos import largest_eigenpairs
    >>> diagonal = np.arange(5.0)
    >>> largest_eigenpairs(lambda x: diagonal[:, None] * x, 5, 2)[0].round(6)
    array([4., 3.])
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


def _inverse_lanczos(
    matrix: SparseMatrix,
    k: int,
    tol: float,
    random_state: int,
    progress: Callable[[float], None] | None,
) -> tuple[FloatArray, FloatArray]:
    """Compute the k smallest eigenpairs of a sparse positive semi-definite matrix."""
    n = matrix.shape[0]
    shift, factor = _first_shift(matrix, k)
    below = factor.n_negative
    block_size = 4 if k <= 20 else 8
    basis = KrylovBasis(factor.solve, n, block_size, np.random.default_rng(random_state))
    wanted = max(k, below)
    usual = 1.6 * wanted + 75  # columns that surfaces need, measured
    check = min(wanted + 40, n)
    goal, counted, reached = tol / 2, False, np.inf
    while basis.done < min(n, _LIMIT + 10 * wanted):
        basis.grow()
        if progress is not None:
            progress(min(basis.done / usual, 1.0) * 0.95)
        if basis.done < check and basis.done < basis.size:
            continue
        check = basis.done + 2 * block_size
        if basis.done > 1.5 * usual:
            basis.add_random(block_size)  # an eigenvalue more frequent than the block is wide
        values, coordinates, residuals = _near_pairs(basis, shift, below)
        if len(values) < wanted:
            continue
        floor = max(values[k - 1], shift) / k
        if (residuals[:wanted] > goal * np.maximum(values[:wanted], floor)).any():
            continue
        if below < k and not counted:
            counted = _none_missed(matrix, values, residuals, k)
            if not counted:
                basis.add_random(block_size)
                continue
        rough = basis.combine(coordinates[:, :k])
        values, vectors, reached = _polish(matrix, factor, rough, floor, tol)
        if reached <= tol:
            return values, vectors
        goal /= 10
    raise SolverError(
        f"no {k} eigenpairs to a relative residual of {tol:g}; {reached:.1e} was reached, or the "
        f"pairs could not be counted: is the stiffness matrix positive semi-definite?"
    )


def _first_shift(matrix: SparseMatrix, k: int) -> tuple[float, Factorization]:
    """Choose the shift by Weyl's law (unit area), corrected by the count of what lies below it.

    Pairs near the shift are found first. For many pairs it lies in their middle; a second count
    above them costs a factorisation. For few, it lies above them, where the count comes free.
    """
    share = 1.1 if k <= _FEW else 0.5
    shift = 4 * np.pi * share * k
    best = None
    for _ in range(20):
        try:
            factor = _shifted(matrix, shift)
        except SolverError:  # an eigenvalue is hit
            shift *= 1.01
            continue
        below = factor.n_negative
        if best is None or abs(below - share * k) < abs(best[1].n_negative - share * k):
            best = shift, factor
        if 0.4 * share * k <= below + 2 and below <= 1.7 * share * k + 4:
            break
        shift *= min(max(share * k / max(below, 0.1), 1e-3), 1e3)
    if best is None:
        raise SolverError("the shifted stiffness matrix could not be factorised")
    return best


def _shifted(matrix: SparseMatrix, shift: float) -> Factorization:
    return factorize(matrix - shift * sp.eye_array(matrix.shape[0]), indefinite=True)


def _near_pairs(
    basis: KrylovBasis, shift: float, below: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give Ritz values of the matrix around the shift, ascending: ``below`` of them below it.

    Returns
    -------
    values : (r,) array
    coordinates : (size, r) array
        Of the Ritz vectors after one more application of the inverse, which costs nothing here.
    residuals : (r,) array
        Residuals of these vectors with the matrix itself: |residual of the inverse| / value^2.
    """
    inverse, vectors, coupling = basis.ritz()
    # The inverse maps what is below the shift to its negative end, the rest to its positive one.
    # Between -1 / shift and 0 there is nothing to find: the matrix has no negative eigenvalues.
    n_low = int((inverse < -1 / shift * (1 - 1e-6)).sum())
    n_high = int((inverse > 0).sum())
    if n_low < below:
        n_high = 0
    done = len(inverse)
    order = np.concatenate([np.arange(min(n_low, below))[::-1], done - 1 - np.arange(n_high)])
    theta = inverse[order]
    coordinates = np.concatenate([vectors[:, order], coupling[:, order] / theta])
    residuals = np.linalg.norm(coupling[:, order], axis=0) / theta**2
    return shift + 1 / theta, coordinates, residuals


def _none_missed(matrix: SparseMatrix, values: FloatArray, residuals: FloatArray, k: int) -> bool:
    """Count the eigenvalues below a gap in the Ritz values at or after the k-th."""
    widths = values[k:] - values[k - 1 : -1]
    needed = 4 * (residuals[k:] + residuals[k - 1 : -1]) + 1e-8 * values[k:]
    for gap in np.flatnonzero(widths > needed)[:3]:
        try:
            factor = _shifted(matrix, values[k - 1 + gap] + widths[gap] / 2)
        except SolverError:  # an eigenvalue there that we do not know of
            continue
        return bool(factor.n_negative == k + gap)
    return False


def _polish(
    matrix: SparseMatrix, factor: Factorization, vectors: FloatArray, floor: float, tol: float
) -> tuple[FloatArray, FloatArray, float]:
    """Make the vectors orthonormal Ritz vectors of the matrix; measure the largest residual.

    Sliver triangles have huge entries, and a solve's rounding errors, however small, are rough:
    the matrix makes much of them. A step of inverse iteration, written as a correction so that
    only the correction is rounded, removes them where the residual falls short.
    """
    magnitude = abs(matrix)
    for attempt in range(3):
        image = matrix @ vectors
        values, rotation = scipy.linalg.eigh(inner(vectors, image), inner(vectors, vectors))
        vectors, image = combine(None, vectors, rotation), combine(None, image, rotation)
        image -= vectors * values
        rounding = np.linalg.norm(magnitude @ np.abs(vectors), axis=0) * _ROUNDING
        excess = np.maximum(np.linalg.norm(image, axis=0) - rounding, 0)
        reached = float((excess / np.maximum(values, floor)).max())
        if reached <= tol or attempt == 2:
            break
        vectors = vectors - factor.solve(image)
    return values, vectors, reached
