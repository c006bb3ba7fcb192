"""Rules for the sign of an eigenvector, and for the basis of a multiple eigenvalue's space."""

from __future__ import annotations

from typing import Any

import numpy as np

from unbend._arrays import first_largest
from unbend._types import FloatArray

# A third moment below this share of the third absolute moment is rounding, not skewness.
_SYMMETRIC = 1e-6


def fix_basis(vectors: FloatArray, values: FloatArray, tolerance: Any) -> FloatArray:
    """Give the eigenvectors (n, k) of equal eigenvalues a basis that depends on their space alone.

    Neighbouring values (k,) that differ by no more than the tolerance are equal. The first vector
    reaches the highest entry of all unit vectors in the space; each next one does so among those
    orthogonal to it. Of several entries that could be the highest, the first decides.
    """
    ends = np.append(np.flatnonzero(np.abs(np.diff(values)) > tolerance) + 1, len(values))
    fixed = vectors
    for first, end in zip(np.append(0, ends[:-1]), ends, strict=True):
        if end - first > 1:
            fixed = vectors.copy() if fixed is vectors else fixed
            fixed[:, first:end] = vectors[:, first:end] @ _rotation(vectors[:, first:end])
    return fixed


def _rotation(vectors: FloatArray) -> FloatArray:
    """Coordinates (m, m) of the basis of `fix_basis` in a given one."""
    rest = vectors.copy()
    chosen = np.empty((rest.shape[1], rest.shape[1]))
    for i in range(len(chosen)):
        # The unit vector that is highest at an entry is the projection of that entry's indicator.
        heights = np.einsum("ij,ij->i", rest, rest)
        peak = rest[first_largest(heights)]
        direction = peak - chosen[:i].T @ (chosen[:i] @ peak)  # rounding adds up
        chosen[i] = direction / np.linalg.norm(direction)
        rest -= np.multiply.outer(rest @ chosen[i], chosen[i])
    return np.asarray(chosen.T)


def fix_signs(vectors: FloatArray, weights: FloatArray) -> FloatArray:
    """Give every column (n, k) the sign that makes its weighted third moment positive.

    Where it vanishes, as for a function that is odd under a symmetry, the first entry whose
    magnitude is within rounding of the largest is made positive.
    """
    size = np.abs(vectors)
    third = weights @ (size * size * vectors)
    scale = weights @ (size * size * size)
    at_peak = vectors[first_largest(size), np.arange(vectors.shape[1])]
    deciding = np.where(np.abs(third) > _SYMMETRIC * scale, third, at_peak)
    return np.asarray(vectors * np.where(deciding < 0, -1.0, 1.0))
