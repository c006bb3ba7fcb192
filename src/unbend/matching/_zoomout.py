"""Spectral upsampling: alignments of eigenbases that grow in dimension.

An orthogonal matrix between two eigenbases is a functional map, and at the same time a rotation
that aligns two area-weighted canonical forms. Nearest neighbours under it give pairs of points,
pairs give a larger matrix, and so on (Melzi et al., "ZoomOut", ACM TOG 2019).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from unbend._types import FloatArray
from unbend.alignment import Pairs, nearest_pairs, nearest_rotation


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
    return nearest_rotation(cross, reflect=True)


def grow(
    source: tuple[FloatArray, FloatArray],
    target: tuple[FloatArray, FloatArray],
    functional_map: FloatArray,
    sizes: Sequence[int],
) -> FloatArray:
    """Grow one orthogonal functional map through a sequence of sizes.

    Parameters
    ----------
    source, target : pair of ndarrays
        Non-constant eigenvalues (K,) at unit area, and eigenfunctions (m, K) at sampled points.
    functional_map : (k, k) ndarray of float64
        Orthogonal; ``source @ functional_map`` corresponds to ``target``.
    sizes : sequence of int
        Growing, the last one at most K.

    Returns
    -------
    (sizes[-1], sizes[-1]) ndarray of float64

    References
    ----------
    Melzi, Ren, Rodolà, Sharma, Wonka, Ovsjanikov, "ZoomOut: spectral upsampling for efficient
    shape correspondence", ACM TOG 38(6), 2019.
    """
    (source_values, left), (target_values, right) = source, target

    def pairs_of(matrix: FloatArray) -> Pairs:
        k = len(matrix)
        weights = spectral_weights(source_values, target_values, k)
        return nearest_pairs((left[:, :k] @ matrix * weights)[None], right[:, :k] * weights)

    for k in sizes:
        pairs = pairs_of(functional_map)
        functional_map = orthogonal_maps(left[:, :k], right[:, :k], pairs)[0]
    return functional_map
