"""Eigenpairs of sparse symmetric problems: smallest generalised ones, largest of an operator.

The smallest come from block Lanczos on the inverse, shifted into the spectrum.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from unbend._parallel import COLUMNS, n_threads, one_blas_thread, run_all, slices
from unbend._types import FloatArray, SparseMatrix
from unbend.errors import SolverError
from unbend.linalg._krylov import KrylovBasis, Operator
from unbend.linalg.factorization import Factorization, factorize
from unbend.linalg.tall import column_lengths, inner, multiply, sparse_residuals

_FEW = 30  # up to this many pairs the shift goes above them all: see _first_shift
_LIMIT = 1_000  # columns of the basis beyond ten for each pair before giving up
_CLEARANCE = 0.03  # least distance from a shift to an eigenvalue, in mean spacings of eigenvalues
_POLISHINGS = 3  # corrections before more is taken in; one is the rule
_PATIENCE = 30  # corrections before another try: far from the shift each leaves up to .83
_STALLED = 0.95  # a correction that leaves more has nothing left but rounding
_ROUNDING = 20 * float(np.finfo(np.float64).eps)  # relative, of a product with the matrix


def smallest_eigenpairs(
    stiffness: SparseMatrix, areas: FloatArray, k: int, *, tol: float = 1e-8
) -> tuple[FloatArray, FloatArray]:
    """Compute the k smallest eigenpairs of ``stiffness @ x = value * areas * x``.

    Grimes, Lewis and Simon, SIAM J. Matrix Anal. Appl. 15, 1994. The signs of the pivots of L D L^T
    count the eigenvalues below a shift: no pair is missed, however many are equal.

    Returns the values (k,), ascending and not negative, and the vectors (n, k), orthonormal in the
    area inner product. `tol` bounds the relative residual |W x - value A x| / |value A x| in the
    norm of A^-1. Values close to 0 count as in :func:`_least_that_counts`, and what rounding in W x
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
            values, vectors = scipy.linalg.eigh(
                scaled.toarray(order="F"), subset_by_index=(0, k - 1), overwrite_a=True
            )
            # Its errors are those of the largest entries, and sliver triangles have huge ones.
            clipped = np.maximum(values, 0)
            _, residual = measure_eigenpairs(scaled, np.ones(n), clipped, vectors, tol)
        if not small or not residual <= tol:
            values, vectors = _inverse_lanczos(scaled, k, tol)
    return np.maximum(values, 0) / total, vectors / (weights * np.sqrt(total))[:, None]


def working_columns(n: int, k: int) -> int:
    """Predict how many columns of n numbers :func:`smallest_eigenpairs` keeps at once.

    Fitted to 10, 100 and 300 pairs of meshes of 50,000 to 500,000 vertices, in 1 to 16 threads.
    """
    if _dense_is_faster(n, k):
        return n + 2 * k
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
    floor = _least_that_counts(values, stiffness.diagonal() / areas)
    shares = np.random.default_rng(0).standard_normal((len(values), 2))
    shares[:, 1] /= np.maximum(values, floor)
    weights = np.sqrt(areas)
    plain, scaled = (vectors @ shares).T
    skew = float(np.linalg.norm(vectors.T @ (areas * plain) - shares[:, 0]))
    image = stiffness @ scaled - areas * (vectors @ (values * shares[:, 1]))
    residual = float(np.linalg.norm(image / weights))
    if residual > tol:
        sizes = abs(stiffness) @ (np.abs(vectors) @ np.abs(shares[:, 1]))
        residual = max(residual - _ROUNDING * float(np.linalg.norm(sizes / weights)), 0.0)
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
            if basis.done > _LIMIT + 10 * k:
                raise SolverError(
                    f"no {k} eigenpairs to a relative residual of {tol:g} in {basis.done} products"
                )
        return values[: -k - 1 : -1], basis.combine(vectors[:, : -k - 1 : -1])


def _dense_is_faster(n: int, k: int) -> bool:
    return n <= max(400, 7 * k)  # beyond, the iteration may need a basis of the whole space


def _inverse_lanczos(matrix: SparseMatrix, k: int, tol: float) -> tuple[FloatArray, FloatArray]:
    """Compute the k smallest eigenpairs of a positive semi-definite matrix in compressed columns.

    It is scaled such that the mean distance of the first eigenvalues is about 4 pi.
    """
    n = matrix.shape[0]
    shift, factor = _first_shift(matrix, k)
    below = factor.n_negative
    block_size = 4 if k <= 20 else 8
    diagonal = matrix.diagonal()
    wanted = max(k, below)
    usual = 1.6 * wanted + 75  # columns that surfaces need, measured
    rng = np.random.default_rng(0)
    basis = KrylovBasis(factor.solve, n, block_size, rng, int(1.4 * usual))
    check = min(wanted + 40, n)
    # Above the shift pairs must be counted; where all lie below it, that is done.
    goal, counted, reached = tol / 2, below >= k, np.inf
    while basis.done < min(n, _LIMIT + 10 * wanted):
        basis.grow()
        if basis.done < check and basis.done < basis.size:
            continue
        check = basis.done + 2 * block_size
        if basis.done > 1.5 * usual:
            basis.add_random(block_size)  # an eigenvalue more frequent than the block is wide
        values, coordinates, residuals = _near_pairs(basis, shift, below)
        if len(values) < wanted:
            continue
        floor = _least_that_counts(values[:k], diagonal)
        converged = residuals <= goal * np.maximum(values, floor)
        if not converged[:wanted].all():
            continue
        # What has converged takes part; if that is not enough, all that was found as near above
        # the shift as 0 is below, because a correction keeps what is nearer than its own pair.
        rough = residuals > 1e-2 * np.maximum(values, floor)
        rough |= values > 2.2 * shift
        known = int(np.argmax(np.append(~converged, True)))
        everything = max(wanted, int(np.argmax(np.append(rough, True))))
        polish = functools.partial(_polish, matrix, factor, k=k, floor=floor, tol=tol)
        near = basis.combine(coordinates[:, :known])
        tasks: list[Callable[[], Any]] = [
            functools.partial(polish, values[:known], near, steps=_POLISHINGS)
        ]
        if not counted:
            tasks.append(functools.partial(_none_missed, matrix, values, residuals, k))
        (best, vectors, reached), *counts = run_all(tasks)
        counted = all(counts)
        if not counted:
            basis.add_random(block_size)
            continue
        if reached > tol:
            near = basis.combine(coordinates[:, :everything])
            best, vectors, reached = polish(values[:everything], near, steps=_PATIENCE)
        if reached <= tol:
            return best, vectors
        goal /= 10
    raise SolverError(
        f"no {k} eigenpairs to a relative residual of {tol:g}; {reached:.1e} was reached, or the "
        f"pairs could not be counted: is the stiffness matrix positive semi-definite?"
    )


def _least_that_counts(values: FloatArray, diagonal: FloatArray) -> float:
    """Say what eigenvalues near 0 count as: their mean distance, or next to nothing if all are 0.

    Nothing is 1e-12 of what is usual on the matrix's diagonal, not of the largest entry: beside a
    needle that may be of any size.
    """
    usual = float(np.median(diagonal[diagonal > 0])) if (diagonal > 0).any() else 1.0
    last = float(values[-1])
    return last / len(values) if last > 1e-12 * usual else 1e-6 * usual


def _first_shift(matrix: SparseMatrix, k: int) -> tuple[float, Factorization]:
    """Choose the shift by Weyl's law (unit area), corrected by the count of what lies below it.

    For many pairs it lies in their middle; a second count above them costs a factorisation. For
    few, it lies above them, where the count comes free.
    """
    share = 1.1 if k <= _FEW else 0.5
    size = abs(matrix).max()
    shift = min(4 * np.pi * share * k, 2 * size)
    best, last = None, -1
    for _ in range(40):
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
        if shift < 1e-10 * size:
            break  # the eigenvalue 0 of many pieces
        shift *= min(max(share * k / max(below, 0.1), 1e-3), 1e3) if below != last else 1e-2
        last = below
    if best is None:
        raise SolverError("the shifted stiffness matrix could not be factorised")
    return _clear_of_eigenvalues(matrix, *best)


def _clear_of_eigenvalues(
    matrix: SparseMatrix, shift: float, factor: Factorization
) -> tuple[float, Factorization]:
    """Move a shift with an eigenvalue so near that rounding errors drown the pairs far from it."""
    spacing = min(4 * np.pi, shift)
    found = [(_nearest(matrix.shape[0], factor), shift, factor)]
    for step in (0.3, 0.6, -0.3):
        if found[0][0] > _CLEARANCE * spacing:
            break
        try:
            moved = _shifted(matrix, shift + step * spacing)
        except SolverError:
            continue
        found.append((_nearest(matrix.shape[0], moved), shift + step * spacing, moved))
        found.sort(key=lambda one: -one[0])
    return found[0][1:]


def _nearest(n: int, factor: Factorization) -> float:
    """Estimate the distance from a shift to the nearest eigenvalue, by inverse iteration."""
    vectors = np.linalg.qr(np.random.default_rng(0).standard_normal((n, 4)))[0]
    for _ in range(3):
        vectors, growth = np.linalg.qr(factor.solve(vectors))
    return float(1 / np.linalg.norm(growth, 2))


def _shifted(matrix: SparseMatrix, shift: float) -> Factorization:
    # What solves leave is taken out by the last corrections.
    return factorize(matrix - shift * sp.eye_array(matrix.shape[0]), refine=False)


def _near_pairs(
    basis: KrylovBasis, shift: float, below: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give Ritz values of the matrix around the shift, ascending: ``below`` of them below it.

    With them come the coordinates (size, r) of the Ritz vectors after one more application of the
    inverse, which costs nothing here, and their residuals with the matrix itself.
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
    matrix: SparseMatrix,
    factor: Factorization,
    values: FloatArray,
    vectors: FloatArray,
    k: int,
    floor: float,
    tol: float,
    steps: int,
) -> tuple[FloatArray, FloatArray, float]:
    """Make k orthonormal Ritz vectors of the matrix; measure their largest residual.

    All that is known near the shift takes part, or the corrections would bring it back in. They are
    steps of inverse iteration, written such that only the correction is rounded: the matrix makes
    much of rounding errors where sliver triangles have huge entries.
    """
    rows = matrix.T  # the same, in compressed rows
    # Large arrays are kept: memory fresh from the system costs as much as the work.
    image = np.empty(vectors.shape)
    sparse_residuals(rows, vectors, values, image)
    if (column_lengths(image[:, :k]) > tol * np.maximum(values[:k], floor) / 2).any():
        _correct(vectors, factor, image)
    worst = np.inf
    for step in range(steps):
        if step > 0:
            _correct(vectors, factor, image)
        sparse_residuals(rows, vectors, 0.0, image)
        values, rotation = scipy.linalg.eigh(inner(vectors, image), inner(vectors, vectors))
        multiply(vectors, rotation, out=vectors)
        # Computed again: the rotated image would not show what the rotation of the vectors lost.
        sparse_residuals(rows, vectors, values, image)
        lengths = column_lengths(image[:, :k])
        best, ranks = vectors[:, :k], np.maximum(values[:k], floor)
        last, worst = worst, float((lengths / ranks).max())
        if worst <= tol or worst > _STALLED * last:
            break
    if worst > tol:
        lengths -= np.linalg.norm(abs(matrix) @ np.abs(best), axis=0) * _ROUNDING
        worst = float(np.maximum(lengths / ranks, 0).max())
    return values[:k], best, worst


def _correct(vectors: FloatArray, factor: Factorization, image: FloatArray) -> None:
    """Subtract the solves of an image from vectors, in place, a chunk of columns at a time."""

    def work(part: slice) -> None:
        vectors[:, part] -= factor.solve(np.ascontiguousarray(image[:, part]))

    run_all(functools.partial(work, part) for part in slices(image.shape[1], COLUMNS))
