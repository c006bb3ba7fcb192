"""The Green's operator of a Laplacian: its inverse away from the constants."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from unbend._parallel import by_columns, slices
from unbend._types import FloatArray, SparseMatrix
from unbend.linalg.factorization import factorize

_Operator = Callable[[FloatArray], FloatArray]
_COMPILED_PAYS = 2_000  # below, importing Numba takes longer than solving for every column
_AT_ONCE = 256  # columns solved for together


def green_operator(stiffness: SparseMatrix, areas: FloatArray) -> _Operator:
    """Operator K, (n,) or (n, r) to the same, that inverts the stiffness on functions of zero mean.

    ``x = K b`` solves ``W x = b - a (1^T b) / sum(a)`` with ``a^T x = 0``; equally ``K = sum_{i >=
    1} phi_i phi_i^T / lambda_i`` over all eigenpairs but the constant one (Lipman, Rustamov and
    Funkhouser 2010, section 4). The mesh must be connected; a are the vertex areas.
    """
    return on_zero_means(factorize(pinned(stiffness)).solve, areas)


def green_and_diagonal(
    stiffness: SparseMatrix, areas: FloatArray, *, biharmonic: bool
) -> tuple[_Operator, FloatArray]:
    """Green's operator K, and the diagonal (n,) of K or, if `biharmonic`, of K A K.

    A is the diagonal matrix of the areas. The diagonal comes from the factor by selected inversion,
    on small meshes from solves for every column of K.

    Let B be the inverse of the pinned matrix, u = B a / sum(a), and P the projection to functions
    of zero mean. Then K = P B P^T = B - u 1^T - 1 u^T + 1 1^T (a^T u) / sum(a). In the same way,
    K A K follows from B P^T A P B = B A B - sum(a) u u^T.
    """
    n = len(areas)
    if n < _COMPILED_PAYS:
        green = green_operator(stiffness, areas)
        diagonal = np.empty(n)
        for part in slices(n, _AT_ONCE):
            columns = by_columns(green, np.eye(n, part.stop - part.start, -part.start))
            diagonal[part] = areas @ columns**2 if biharmonic else columns[part].diagonal()
        return green, diagonal
    factor = factorize(pinned(stiffness), diagonal=True)
    total = areas.sum()
    solved = factor.solve(areas) / total  # u
    diagonals = factor.inverse_diagonals(areas if biharmonic else None)
    diagonal, mixed = diagonals[-1], solved
    if biharmonic:
        diagonal = diagonal - total * solved**2
        mixed = factor.solve(areas * solved) - solved * (areas @ solved)
    diagonal = diagonal - 2 * mixed + areas @ mixed / total
    return on_zero_means(factor.solve, areas), diagonal


def pinned(stiffness: SparseMatrix) -> SparseMatrix:
    """Enlarge one diagonal entry of W, which makes it definite; solutions move by a constant."""
    fixed = sp.csr_array(stiffness, dtype=np.float64).T  # symmetric, and now in compressed columns
    return fixed + sp.csc_array(([fixed.diagonal().max()], ([0], [0])), shape=fixed.shape)


def on_zero_means(solve: _Operator, areas: FloatArray) -> _Operator:
    """Make K of a function that solves ``W x = load`` up to a constant, for loads of sum 0."""
    total = areas.sum()
    ones = np.ones(len(areas))  # products with it are faster than sums over an axis

    def green(rhs: FloatArray) -> FloatArray:
        load = np.einsum("i,...->i...", areas, ones @ rhs / -total)  # faster than their outer
        load += rhs
        solution = solve(load)
        solution -= areas @ solution / total
        return solution

    return green
