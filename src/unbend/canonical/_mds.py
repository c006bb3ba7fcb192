"""Classical scaling of a surface's distances: the exact operator, and the paper's steps 1 to 8.

It takes the leading eigenpairs of the Gram matrix ``-1/2 J D J``, D holding squared distances and J
centring them. A result is the pair (points, eigenvalues).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg

from unbend._types import FloatArray
from unbend.choices import Weighting
from unbend.linalg.lanczos import largest_eigenpairs
from unbend.linalg.signs import fix_basis, fix_signs
from unbend.spectral import Spectrum

# As shares of the largest eigenvalue: differences that count as none, and values that count as 0.
_EQUAL, _NOTHING = 1e-9, 1e-14


def exact_scaling(
    gram: Callable[[FloatArray], FloatArray], n: int, n_components: int, random_state: int
) -> tuple[FloatArray, FloatArray]:
    """Scale all n^2 distances with uniform weights to points (n, d) and eigenvalues (d,).

    If ``d_ij^2 = g_ii + g_jj - 2 g_ij``, the Gram matrix ``-1/2 J D J`` is ``J g J``. Its leading
    eigenpairs follow from products with g, which `gram` computes, and no distance is needed.
    """

    def centred(block: FloatArray) -> FloatArray:
        image = gram(block - block.mean(axis=0))
        image -= image.mean(axis=0)
        return image

    block_size = max(8, n_components + 2)  # eight columns cost little more than one
    values, vectors = largest_eigenpairs(
        centred, n, n_components, block_size=block_size, random_state=random_state
    )
    values = _without_rounding(values)
    return _points(vectors, values, np.ones(n)), values


def area_scaling(
    filtered: FloatArray, eigenfunctions: FloatArray, areas: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Scale all distances with area weights: ``phi_i sqrt(h_i)`` but for the constant phi_0."""
    return _points(eigenfunctions[:, 1:], filtered[1:], areas), filtered[1:]


def sampled_scaling(
    coefficients: FloatArray, spectrum: Spectrum, n_components: int, weighting: Weighting
) -> tuple[FloatArray, FloatArray]:
    """Scale distances given as ``D = Phi alpha Phi^T`` (the paper's steps 5 to 8).

    ``J Phi = Q R`` with orthonormal columns in Q, ``R (-1/2 alpha) R^T = W psi W^T``, and the
    points are ``Q W psi^(1/2)``. The paper takes a thin SVD instead, of which only the span
    matters. `coefficients` (k, k) are alpha, and the spectrum is at unit area.
    """
    functions = spectrum.eigenfunctions
    weights = spectrum.areas if weighting == "area" else np.ones(len(functions))
    root = np.sqrt(weights)[:, None]
    centred = functions - weights @ functions / weights.sum()
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
