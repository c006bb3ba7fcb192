"""Classical scaling of a surface's distances: the exact operator, and the paper's steps 1 to 8.

Classical scaling takes the leading eigenpairs of the Gram matrix ``-1/2 J D J``, D holding
squared distances and J centring them. A result is the pair (points, eigenvalues).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg

from unbend._types import FloatArray
from unbend.choices import Weighting
from unbend.linalg.lanczos import largest_eigenpairs
from unbend.linalg.signs import fix_basis, fix_signs

# Eigenvalues that differ by no more than this share of the largest are equal; what is not more than
# the second is what rounding leaves of 0.
_EQUAL, _NOTHING = 1e-9, 1e-14


def exact_scaling(
    gram: Callable[[FloatArray], FloatArray],
    n: int,
    n_components: int,
    *,
    random_state: int = 0,
) -> tuple[FloatArray, FloatArray]:
    """Classical scaling of all n^2 distances with uniform weights, through products alone.

    Where ``d_ij^2 = g_ii + g_jj - 2 g_ij``, the Gram matrix ``-1/2 J D J`` is ``J g J``: its
    leading eigenpairs follow from products with g, and no distance is ever computed.

    Parameters
    ----------
    gram : callable
        Product with g, (n, r) to (n, r).
    n, n_components : int
        Number of vertices; dimension d.
    random_state : int, default=0
        Seed of the first Lanczos vectors.

    Returns
    -------
    points : (n, d) ndarray of float64
        Centred; column i has squared norm ``eigenvalues[i]``.
    eigenvalues : (d,) ndarray of float64
        Descending.
    """

    def centred(block: FloatArray) -> FloatArray:
        image = gram(block - block.mean(axis=0))
        image -= image.mean(axis=0)
        return image

    values, vectors = largest_eigenpairs(
        centred,
        n,
        n_components,
        random_state=random_state,
        block_size=max(8, n_components + 2),  # eight columns cost little more than one
    )
    values = _without_rounding(values)
    return _points(vectors, values, np.ones(n)), values


def area_scaling(
    filtered: FloatArray, eigenfunctions: FloatArray, areas: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Classical scaling with area weights, which is closed form: ``phi_i sqrt(h(lambda_i))``.

    Parameters
    ----------
    filtered : (d + 1,) ndarray of float64
        h(lambda) of the distance; the constant eigenfunction's comes first and is left out.
    eigenfunctions : (n, d + 1) ndarray of float64
    areas : (n,) ndarray of float64

    Returns
    -------
    points : (n, d) ndarray of float64
        Centred by area; column i has squared norm ``eigenvalues[i]`` by area.
    eigenvalues : (d,) ndarray of float64
        Descending.
    """
    return _points(eigenfunctions[:, 1:], filtered[1:], areas), filtered[1:]


def sampled_scaling(
    coefficients: FloatArray,
    eigenfunctions: FloatArray,
    areas: FloatArray,
    n_components: int,
    weighting: Weighting,
) -> tuple[FloatArray, FloatArray]:
    """Classical scaling of distances given as ``D = Phi alpha Phi^T`` (the paper's steps 5 to 8).

    ``J Phi = Q R`` with orthonormal columns in Q, ``R (-1/2 alpha) R^T = W psi W^T``, and the
    points are ``Q W psi^(1/2)``. The paper takes a thin SVD instead, of which only the span
    matters; where singular values are all but equal, as by area, it need not converge.

    Parameters
    ----------
    coefficients : (k, k) ndarray of float64
        alpha, for squared distances.
    eigenfunctions : (n, k) ndarray of float64
    areas : (n,) ndarray of float64
        Sum to one.
    n_components : int
    weighting : {"uniform", "area"}

    Returns
    -------
    points : (n, d) ndarray of float64
        A column whose eigenvalue is negative is zero.
    eigenvalues : (d,) ndarray of float64
        The d largest psi, descending; negative where the distances are not Euclidean.
    """
    weights = areas if weighting == "area" else np.full(len(areas), 1.0)
    root = np.sqrt(weights)[:, None]
    centred = eigenfunctions - weights @ eigenfunctions / weights.sum()
    frame, half = scipy.linalg.qr(root * centred, mode="economic")
    values, rotation = scipy.linalg.eigh(half @ (-0.5 * coefficients) @ half.T)
    largest = np.argsort(-values, kind="stable")[:n_components]
    values = _without_rounding(values[largest])
    return _points(frame @ rotation[:, largest] / root, values, weights), values


def _without_rounding(values: FloatArray) -> FloatArray:
    return np.where(np.abs(values) > _NOTHING * np.abs(values).max(), values, 0.0)


def _points(vectors: FloatArray, values: FloatArray, weights: FloatArray) -> FloatArray:
    vectors = fix_basis(vectors, values, _EQUAL * np.abs(values).max())
    return fix_signs(vectors, weights) * np.sqrt(np.maximum(values, 0.0))
