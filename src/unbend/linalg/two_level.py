"""The Green's operator of a Laplacian too large to factorise: two levels, conjugate gradients."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from unbend._types import FloatArray, IntArray, SparseMatrix
from unbend.errors import SolverError
from unbend.linalg.factorization import factorize
from unbend.linalg.lanczos import smallest_eigenpairs

_MOST_STEPS = 400
_DAMPING = 0.6  # of Jacobi steps: the spectrum of D^-1 W ends at 2 or a little beyond


def two_level_green_operator(
    stiffness: SparseMatrix, areas: FloatArray, aggregates: IntArray, tol: float = 1e-10
) -> tuple[Callable[[FloatArray], FloatArray], Callable[[int], FloatArray]]:
    """Operator K of :func:`unbend.linalg.pseudoinverse.green_operator`, without its factor.

    Conjugate gradients, preconditioned by damped Jacobi steps before and after an exact solve on
    the coarse level, whose functions are constant on aggregates of vertices, then smoothed [1]_.

    Parameters
    ----------
    stiffness : (n, n) sparse matrix
        W: symmetric, positive semi-definite, with the constants alone as null space.
    areas : (n,) ndarray of float64
    aggregates : (n,) ndarray of int64
        The coarse vertex that each vertex belongs to, 0 to m - 1, each in use.
    tol : float, default=1e-10
        Residual at which a column is solved, relative to its right-hand side.

    Returns
    -------
    green : callable
        Maps (n,) to (n,) or (n, r) to (n, r). Raises SolverError where `tol` is not reached.
    rough : callable
        Given k, the first k eigenfunctions but the constant one as the coarse level knows them,
        (n, k): smooth, and right to some percent.

    References
    ----------
    .. [1] P. Vaněk, J. Mandel, M. Brezina. Algebraic multigrid by smoothed aggregation for second
       and fourth order elliptic problems. Computing 56, 1996.

    Examples
    --------
    >>> import numpy as np, scipy.sparse as sp
    >>> from unbend.linalg.two_level import two_level_green_operator
    >>> path = sp.csr_array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> green, _ = two_level_green_operator(path, np.ones(3), np.array([0, 0, 1]))
    >>> green(np.array([1.0, 0.0, -1.0])).round(9)
    array([ 1.,  0., -1.])
    """
    matrix = sp.csr_array(stiffness, dtype=np.float64)
    n, total = len(areas), areas.sum()
    step = _DAMPING / matrix.diagonal()[:, None]
    flat = sp.csr_array((np.ones(n), (np.arange(n), aggregates)))
    prolong = sp.csr_array(flat - sp.diags_array(step[:, 0]) @ (matrix @ flat))
    restrict = sp.csr_array(prolong.T)
    coarse = sp.csc_array(restrict @ (matrix @ prolong))
    # As in green_operator: a consistent system stays true, and becomes definite.
    peak = coarse.diagonal().max()
    factor = factorize(coarse + sp.csc_array(([peak], ([0], [0])), shape=coarse.shape))

    def precondition(residual: FloatArray) -> FloatArray:
        update: FloatArray = step * residual
        update += step * (residual - matrix @ update)
        update += prolong @ factor.solve(restrict @ (residual - matrix @ update))
        update += step * (residual - matrix @ update)
        update += step * (residual - matrix @ update)
        return update

    def green(rhs: FloatArray) -> FloatArray:
        load = np.multiply.outer(areas, rhs.sum(axis=0) / -total)
        load += rhs
        solution = _conjugate_gradients(matrix, precondition, load.reshape(n, -1), tol)
        solution -= areas @ solution / total
        return np.asarray(solution.reshape(rhs.shape))

    def rough(k: int) -> FloatArray:
        lumped = flat.T @ areas
        return np.asarray(prolong @ smallest_eigenpairs(coarse, lumped, k + 1)[1][:, 1:])

    return green, rough


def _conjugate_gradients(
    matrix: SparseMatrix,
    precondition: Callable[[FloatArray], FloatArray],
    load: FloatArray,
    tol: float,
) -> FloatArray:
    """Solve for each column on its own, all of them side by side."""
    solution = np.zeros_like(load)
    residual = load.copy()
    goal = tol * np.linalg.norm(load, axis=0)
    direction = precondition(residual)
    energy = (residual * direction).sum(axis=0)
    for _ in range(_MOST_STEPS):
        if (np.linalg.norm(residual, axis=0) <= goal).all():
            return solution
        image = matrix @ direction
        curvature = (direction * image).sum(axis=0)
        length = energy / np.where(curvature > 0, curvature, np.inf)  # 0 for what is solved
        solution += length * direction
        residual -= length * image
        better = precondition(residual)
        before, energy = energy, (residual * better).sum(axis=0)
        direction *= energy / np.where(before > 0, before, np.inf)
        direction += better
    raise SolverError(
        f"{_MOST_STEPS} steps of conjugate gradients did not reach a residual of {tol:g}; allow "
        "more coarse vertices"
    )
