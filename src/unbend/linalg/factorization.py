"""Sparse symmetric factorisation behind one small interface.

Backends are our own multifrontal L D L^T for large systems, qdldl's with our solves, and qdldl
alone for systems too small to pay for importing Numba. None pivots.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from unbend._parallel import in_chunks
from unbend._types import FloatArray, SparseMatrix
from unbend.errors import SolverError

_Solve = Callable[[FloatArray], FloatArray]
_NUMBA_PAYS = 2_000  # below, importing Numba takes longer than all solves of a usual run
_DENSE_BLOCKS_PAY = 100_000  # below, qdldl and its factor are faster
_SMALLEST_PIVOT = 1e-13  # relative to the diagonal it came from; less is cancellation
_LARGEST_ERROR = 1e-4  # share of an error that a refinement step may leave
_SMALL_ERROR = 1e-8  # share that may stay where solves need not be exact
_BACKWARD_ERROR = 1e-13  # solves less exact than this are refined: without growth they are not


@dataclass(frozen=True, eq=False)
class Factorization:
    """A factorised sparse symmetric matrix, with its number of negative eigenvalues (Sylvester)."""

    n_negative: int
    backend: str
    _matrix: Any
    _solve: Any
    _n_refinements: int

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solve for one right-hand side (n,) or, which is faster, for a block of them (n, r).

        Safe to call from several threads. Raises SolverError if the solution overflows.
        """
        if rhs.size == 0:
            return np.zeros(rhs.shape)
        block = np.ascontiguousarray(rhs, dtype=np.float64).reshape(len(rhs), -1)
        solution: FloatArray = self._solve(block)
        for _ in range(self._n_refinements):
            solution = solution + self._solve(block - self._matrix @ solution)
        # The sum is one pass without a temporary; only an overflow needs the second look.
        with np.errstate(all="ignore"):
            finite = np.isfinite(solution.sum()) or np.isfinite(solution).all()
        if not finite:
            raise SolverError("the solution overflows; scale the matrix or the right-hand side")
        return solution.reshape(rhs.shape)

    def inverse_diagonals(self, weights: FloatArray | None = None) -> FloatArray:
        """Compute the diagonal (1, n) of the inverse B, or (2, n) also of B A B, A diagonal.

        This takes about as long as the factorisation, made with ``diagonal=True``. Raises
        SolverError if the matrix is so close to singular that its solves must be refined.
        """
        from unbend.linalg._selected_inverse import inverse_diagonals

        assert self.backend == "multifrontal"  # so it was asked for
        if self._n_refinements > 0:
            raise SolverError("the matrix is too close to singular for entries of its inverse")
        (found,) = self._solve.args  # a partial function of the multifrontal factor
        return inverse_diagonals(found, weights)


def factorize(
    matrix: SparseMatrix, *, refine: bool = True, many: bool = False, diagonal: bool = False
) -> Factorization:
    """Factorise a sparse, symmetric, non-singular matrix, definite or not.

    Without pivoting, an indefinite matrix may go wrong. So two solves with a known solution measure
    which share of an error a step of iterative refinement leaves. A small share proves that the
    matrix is far from singular and that the inertia is right (all matrices between this one and the
    one factorised are non-singular then); a larger one leads to a new try with a shifted diagonal,
    refined in every solve, and then to a SolverError.

    Without `refine`, a relative error of up to 1e-8 may stay in solves, which halves their time.
    `many` says that compiled solves will pay for a small matrix too; `diagonal`, that
    :meth:`Factorization.inverse_diagonals` will be called.
    """
    matrix = sp.csc_matrix(matrix, dtype=np.float64)
    n = matrix.shape[0]
    size = abs(matrix).sum(axis=0).max()
    decompose: Callable[[SparseMatrix], tuple[Any, FloatArray, _Solve]]
    if diagonal or n >= _DENSE_BLOCKS_PAY:
        name, decompose = "multifrontal", _multifrontal
    elif many or n >= _NUMBA_PAYS:
        name, decompose = "qdldl+numba", functools.partial(_qdldl, compiled=True)
    else:
        name, decompose = "qdldl", functools.partial(_qdldl, compiled=False)
    for shift in (0.0, 1e-10 * size, 1e-7 * size, 1e-5 * size):
        shifted = matrix if shift == 0 else sp.csc_matrix(matrix + shift * sp.eye_array(n))
        try:
            order, pivots, solve = decompose(shifted)
        except ArithmeticError:  # a zero pivot
            continue
        if shift == 0 and _cancelled(matrix, order, pivots):
            continue
        error, residual = _probe(matrix, solve)
        limit = _LARGEST_ERROR if shift == 0 else 100 * _LARGEST_ERROR
        if not error <= limit:  # also when it is not a number
            continue
        steps = 0
        if residual > _BACKWARD_ERROR * size and (refine or error > _SMALL_ERROR):
            steps = math.ceil(math.log(1e-16 * size / residual) / math.log(max(error, 1e-16)))
        return Factorization(int((pivots < 0).sum()), name, matrix, solve, steps)
    raise SolverError("the matrix is singular, too close to singular, or not symmetric")


def _multifrontal(matrix: SparseMatrix) -> tuple[Any, FloatArray, _Solve]:
    from unbend.linalg.multifrontal import factor, solve

    found = factor(matrix)
    return found.nodes.order, found.pivots, functools.partial(solve, found)


def _qdldl(matrix: SparseMatrix, *, compiled: bool) -> tuple[Any, FloatArray, _Solve]:
    import qdldl

    try:
        solver = qdldl.Solver(matrix)
    except (RuntimeError, ValueError) as error:
        raise ArithmeticError("a zero pivot") from error
    lower, pivots, order = solver.factors()
    if not compiled:
        return order, pivots, lambda rhs: np.column_stack([solver.solve(c) for c in rhs.T])
    from unbend.linalg._sweeps import solve_chunk

    starts, rows = np.asarray(lower.indptr, np.int64), np.asarray(lower.indices, np.int32)
    inverse_pivots = 1 / pivots

    def work(chunk: FloatArray) -> None:
        lanes = (0.0,) * chunk.shape[1]
        solve_chunk(starts, rows, lower.data, inverse_pivots, chunk, lanes)

    return order, pivots, functools.partial(in_chunks, order, work)


def _cancelled(matrix: SparseMatrix, order: Any, pivots: FloatArray) -> bool:
    """Tell whether some pivot is nothing but rounding errors."""
    diagonal = np.abs(matrix.diagonal()[order])
    return bool((np.abs(pivots) <= _SMALLEST_PIVOT * diagonal).any())


def _probe(matrix: SparseMatrix, solve: _Solve) -> tuple[float, float]:
    """Measure the share of an error that a refinement step leaves, and the largest residual."""
    known = np.random.default_rng(0).standard_normal((matrix.shape[0], 1))
    with np.errstate(all="ignore"):
        first = known - solve(matrix @ known)
        residual = matrix @ first
        second = first - solve(residual)
        # An error within rounding of the solution is as good as none: its share says nothing.
        size = max(np.linalg.norm(first), 1e-15 * np.linalg.norm(known))
        return float(np.linalg.norm(second) / size), float(np.abs(residual).max())
