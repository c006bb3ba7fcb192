"""The Green's operator of a Laplacian too large to factorise: two levels, conjugate gradients."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from unbend._parallel import row_slices, run_all
from unbend._types import FloatArray, IntArray, SparseMatrix
from unbend.errors import SolverError
from unbend.linalg.factorization import factorize
from unbend.linalg.lanczos import smallest_eigenpairs
from unbend.linalg.pseudoinverse import on_zero_means, pinned
from unbend.linalg.tall import column_dots, scale_and_add

_Finish = Callable[[slice, FloatArray], FloatArray]
_Product = Callable[[FloatArray, FloatArray, _Finish], None]

_MOST_STEPS = 400
# Of Jacobi steps by the sums of the rows' absolute values; less than 2 keeps them definite.
_SMOOTHING, _DAMPING = 1.2, 1.7


class TwoLevels(NamedTuple):
    """What two levels give.

    Attributes
    ----------
    green : callable
        ``green(rhs, guess=None, tol=1e-10)`` maps (n,) to (n,) or (n, r) to (n, r) as the operator
        K of :func:`unbend.linalg.pseudoinverse.green_operator` does, to a residual of `tol`
        relative to the right-hand side, starting from `guess`. Raises SolverError where `tol` is
        not reached.
    rough : callable
        Given k, the first k eigenfunctions but the constant one as the coarse level knows them,
        (n, k): smooth, and right to some percent.
    """

    green: Callable[..., FloatArray]
    rough: Callable[[int], FloatArray]


def two_levels(stiffness: SparseMatrix, areas: FloatArray, aggregates: IntArray) -> TwoLevels:
    """Invert the stiffness matrix on functions of zero mean, without its factor.

    Conjugate gradients, preconditioned by a damped Jacobi step before and after an exact solve on
    the coarse level, whose functions are constant on aggregates of vertices, then smoothed [1]_.

    Parameters
    ----------
    stiffness : (n, n) sparse matrix
        W: symmetric, positive semi-definite, with the constants alone as null space.
    areas : (n,) ndarray of float64
    aggregates : (n,) ndarray of int64
        The coarse vertex that each vertex belongs to, 0 to m - 1, each in use.

    Returns
    -------
    TwoLevels

    References
    ----------
    .. [1] P. Vaněk, J. Mandel, M. Brezina. Algebraic multigrid by smoothed aggregation for second
       and fourth order elliptic problems. Computing 56, 1996.

    Examples
    --------
    >>> import numpy as np, scipy.sparse as sp
    >>> from unbend.linalg.two_level import two_levels
    >>> path = sp.csr_array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> green, _ = two_levels(path, np.ones(3), np.array([0, 0, 1]))
    >>> bool(np.allclose(green(np.array([1.0, 0.0, -1.0])), [1, 0, -1]))
    True
    """
    matrix = sp.csr_array(stiffness, dtype=np.float64)
    n = len(areas)
    inverse_sums = 1 / np.asarray(abs(matrix).sum(axis=1)).ravel()
    flat = sp.csr_array((np.ones(n), (np.arange(n), aggregates)))
    prolong = sp.csr_array(flat - sp.diags_array(_SMOOTHING * inverse_sums) @ (matrix @ flat))
    restrict = sp.csr_array(prolong.T)
    coarse = sp.csc_array(restrict @ (matrix @ prolong))
    factor = factorize(pinned(coarse))
    step = _DAMPING * inverse_sums[:, None]
    times, up, down = _by_rows(matrix), _by_rows(prolong), _by_rows(restrict)

    def precondition(residual: FloatArray, update: FloatArray, result: FloatArray) -> None:
        np.multiply(step, residual, out=update)
        times(update, result, lambda rows, image: residual[rows] - image)
        coarse_load = np.empty((coarse.shape[0], residual.shape[1]))
        down(result, coarse_load, lambda rows, image: image)
        coarse_load -= coarse_load.mean(axis=0)  # rounding errors, for which there is no solution
        up(factor.solve(coarse_load), update, lambda rows, image: update[rows] + image)
        times(
            update,
            result,
            lambda rows, image: update[rows] + step[rows] * (residual[rows] - image),
        )

    def solve(load: FloatArray, guess: FloatArray | None = None, tol: float = 1e-10) -> FloatArray:
        start = np.zeros_like(load) if guess is None else guess.copy()
        columns = load.reshape(n, -1), start.reshape(n, -1)
        return _conjugate_gradients(times, precondition, *columns, tol).reshape(load.shape)

    def rough(k: int) -> FloatArray:
        lumped = flat.T @ areas
        return np.asarray(prolong @ smallest_eigenpairs(coarse, lumped, k + 1)[1][:, 1:])

    return TwoLevels(on_zero_means(solve, areas), rough)


def _conjugate_gradients(
    times: _Product,
    precondition: Callable[[FloatArray, FloatArray, FloatArray], None],
    load: FloatArray,
    solution: FloatArray,
    tol: float,
) -> FloatArray:
    """Solve for each column on its own, all of them side by side, from the solution given."""
    # Large arrays are made once: memory fresh from the system costs as much as the work.
    residual, direction, image, better, work = (np.empty_like(load) for _ in range(5))
    times(solution, residual, lambda rows, image: load[rows] - image)
    goal = tol**2 * column_dots(load, load)
    precondition(residual, work, direction)
    energy = column_dots(residual, direction)
    for _ in range(_MOST_STEPS):
        if (column_dots(residual, residual) <= goal).all():
            return solution
        times(direction, image, lambda rows, image: image)
        curvature = column_dots(direction, image)
        length = energy / np.where(curvature > 0, curvature, np.inf)  # 0 for what is solved
        scale_and_add(solution, 1.0, length, direction)
        scale_and_add(residual, 1.0, -length, image)
        precondition(residual, work, better)
        before, energy = energy, column_dots(residual, better)
        scale_and_add(direction, energy / np.where(before > 0, before, np.inf), 1.0, better)
    raise SolverError(
        f"{_MOST_STEPS} steps of conjugate gradients did not reach a residual of {tol:g}; allow "
        "more coarse vertices"
    )


def _by_rows(matrix: SparseMatrix) -> _Product:
    """Make ``times(block, out, finish)``, the product of a matrix with a block of columns.

    Its rows go to `out` through `finish`, which works on them while they are in the cache.
    """
    parts = [(rows, matrix[rows]) for rows in row_slices(matrix.shape[0])]

    def times(block: FloatArray, out: FloatArray, finish: _Finish) -> None:
        def work(rows: slice, part: SparseMatrix) -> None:
            out[rows] = finish(rows, part @ block)

        run_all(functools.partial(work, *part) for part in parts)

    return times
