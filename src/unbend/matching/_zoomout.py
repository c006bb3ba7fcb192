"""Spectral upsampling: alignments of eigenbases that grow in dimension.

An orthogonal matrix between two eigenbases is a functional map, and at the same time a rotation
that aligns two area-weighted canonical forms. Nearest neighbours under it give pairs of points,
pairs give a larger matrix, and so on (Melzi et al., "ZoomOut", ACM TOG 2019).
"""

from __future__ import annotations

import numpy as np

from unbend._types import FloatArray
from unbend.alignment import Pairs


def spectral_weights(source: FloatArray, target: FloatArray, k: int) -> FloatArray:
    """Weights ``lambda^(-1/2)`` of the first k eigenfunctions, of unit total square.

    Parameters
    ----------
    source, target : (>= k,) ndarray of float64
        Eigenvalues of the non-constant eigenfunctions; their geometric mean is used, so that
        both directions weigh alike.
    k : int
    """
    weights = (source[:k] * target[:k]) ** -0.25
    return np.asarray(weights / np.linalg.norm(weights))


def orthogonal_maps(source: FloatArray, target: FloatArray, pairs: Pairs) -> FloatArray:
    """Orthogonal matrices C that bring ``source @ C`` nearest to ``target`` over given pairs.

    The orthogonal Procrustes problem (Schönemann 1966) on the pairs of both directions.

    Parameters
    ----------
    source : (m, k) ndarray of float64
    target : (n, k) ndarray of float64
    pairs : Pairs
        Of h maps.

    Returns
    -------
    (h, k, k) ndarray of float64
    """
    cross = np.matmul(source.T, target[pairs.forward])
    cross += np.matmul(source[pairs.backward].transpose(0, 2, 1), target)
    left, _, right = np.linalg.svd(cross)
    return np.asarray(np.matmul(left, right))
