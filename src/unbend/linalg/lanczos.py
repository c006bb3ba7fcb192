"""Eigenpairs of sparse symmetric problems: smallest generalised ones, largest of an operator."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from unbend._parallel import COLUMNS, n_threads, one_blas_thread
from unbend._types import FloatArray, SparseMatrix
from unbend.errors import SolverError
from unbend.linalg._inverse import LIMIT, ROUNDING, inverse_lanczos, least_that_counts
from unbend.linalg._krylov import KrylovBasis, Operator


def smallest_eigenpairs(
    stiffness: SparseMatrix, areas: FloatArray, k: int, *, tol: float = 1e-8
) -> tuple[FloatArray, FloatArray]:
    """Compute the k smallest eigenpairs of ``stiffness @ x = value * areas * x``.

    Block Lanczos on the inverse, shifted into the spectrum (Grimes, Lewis and Simon, SIAM J. Matrix
    Anal. Appl. 15, 1994). The signs of the pivots of L D L^T count the eigenvalues below a shift:
    no pair is missed, however many are equal.

    Returns the values (k,), ascending and not negative, and the vectors (n, k), orthonormal in the
    area inner product. `tol` bounds the relative residual |W x - value A x| / |value A x| in the
    norm of A^-1. Values close to 0 count as in :func:`least_that_counts`, and what rounding in W x
    makes unavoidable comes on top. Raises SolverError if the accuracy is not reached, or an area is
    not positive.
    """
    n = len(areas)
    if not (areas > 0).all():
        raise SolverError("a vertex has no area")
    # Unit total area and a plain inner product: A^-1/2 W A^-1/2 has the eigenvalues of the problem.
    total = areas.sum()
    weights = np.sqrt(areas / total)
    scaling = sp.diags_array(1 / weights)
    scaled = sp.csc_matrix(scaling @ sp.csc_matrix(stiffness, dtype=np.float64) @ scaling)
    with one_blas_thread():
        small = _dense_is_faster(n, k)
        if small:
            values, vectors = scipy.linalg.eigh(scaled.toarray(), subset_by_index=(0, k - 1))
            # Its errors are those of the largest entries, and sliver triangles have huge ones.
            clipped = np.maximum(values, 0)
            _, residual = measure_eigenpairs(scaled, np.ones(n), clipped, vectors, tol)
        if not small or not residual <= tol:
            values, vectors = inverse_lanczos(scaled, k, tol)
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
    stiffness: SparseMatrix, areas: FloatArray, values: FloatArray, vectors: FloatArray, tol: float
) -> tuple[float, float]:
    """Measure the errors of eigenpairs from one random combination of them.

    Returns about the size of ``vectors.T @ (areas[:, None] * vectors) - I``, and that of the
    relative residuals. If the latter is above `tol`, what rounding makes unavoidable is subtracted.
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
    block_size: int,
    tol: float = 1e-10,
    random_state: int = 0,
) -> tuple[FloatArray, FloatArray]:
    """Compute the k algebraically largest eigenpairs of a symmetric operator, (n, b) to (n, b).

    Block Lanczos with full orthogonalisation. Returns the values (k,), descending, and orthonormal
    vectors (n, k). `tol` bounds the residual relative to the largest absolute eigenvalue. Of an
    eigenvalue that occurs more often than `block_size`, copies may be missed. Raises SolverError if
    the accuracy is not reached, or the operator returns NaN or infinity.
    """
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
            if basis.done > LIMIT + 10 * k:
                raise SolverError(
                    f"no {k} eigenpairs to a relative residual of {tol:g} in {basis.done} products"
                )
        return values[: -k - 1 : -1], basis.combine(vectors[:, : -k - 1 : -1])


def _dense_is_faster(n: int, k: int) -> bool:
    return n <= max(400, 2 * k + 100)
