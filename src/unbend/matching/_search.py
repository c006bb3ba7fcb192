"""Hypotheses: a beam search over alignments of growing spectral canonical forms.

Eigenfunctions have unknown signs and mix where eigenvalues are close, so nothing is decided early.
"""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

from unbend._types import FloatArray
from unbend.alignment import Pairs, nearest_pairs, nearest_rotation
from unbend.matching import _constants as constants
from unbend.matching._shape import Shape

# Two maps of k functions are the same when they differ by less than this, times sqrt(k).
_SAME = 0.15
_DIGITS = 6  # of squared residuals, that are not rounding: they come of single precision


def search(source: Shape, target: Shape) -> FloatArray:
    """Find the functional maps that bring two shapes' spectral forms close to each other.

    They are up to twice `BEAM` orthogonal maps (h, k, k) between the first k (at most 20)
    non-constant eigenfunctions, closest first.
    """
    available, beam = min(source.k, target.k), 2 * constants.BEAM
    forms = source.basis[source.samples], target.basis[target.samples]

    def pairs_of(maps: FloatArray) -> Pairs:
        k = maps.shape[1]
        weights = spectral_weights(source.eigenvalues, target.eigenvalues, k)
        return nearest_pairs(forms[0][:, :k] @ maps * weights, forms[1][:, :k] * weights)

    k = min(constants.FUNCTIONS[0], available)
    maps = _diagonals(k)
    pairs = pairs_of(maps)
    last = min(constants.FUNCTIONS[1], available)
    for size in [*range(k + 2, last, 2), last]:
        sized = forms[0][:, :size], forms[1][:, :size]
        starts = np.concatenate([orthogonal_maps(*sized, pairs), _extended(maps, size)])
        pairs = pairs_of(starts)
        closest = _closest_first(pairs)[: 4 * beam]
        pairs = pairs_of(orthogonal_maps(*sized, _take(pairs, closest)))
        maps = orthogonal_maps(*sized, pairs)
        best = _distinct(maps, _closest_first(pairs), beam)
        maps, pairs = maps[best], _take(pairs, best)
    return maps


def spectral_weights(source: FloatArray, target: FloatArray, k: int) -> FloatArray:
    """Weights ``lambda^(-1/2)`` of the first k eigenfunctions, of unit total square.

    Eigenvalues of both shapes count alike, by their geometric mean.
    """
    weights = (source[:k] * target[:k]) ** -0.25
    return np.asarray(weights / np.linalg.norm(weights))


def orthogonal_maps(source: FloatArray, target: FloatArray, pairs: Pairs) -> FloatArray:
    """Orthogonal matrices C that bring ``source @ C`` nearest to ``target`` over given pairs.

    The orthogonal Procrustes problem (Schönemann 1966) on the pairs of both directions. Of h maps
    in ``pairs``, the matrices are (h, k, k).
    """
    cross = np.matmul(source.T, target[pairs.forward])
    cross += np.matmul(source[pairs.backward].transpose(0, 2, 1), target)
    return nearest_rotation(cross, reflect=True)


def _diagonals(k: int) -> FloatArray:
    signs = np.array(list(itertools.product([1.0, -1.0], repeat=k)))
    return np.asarray(signs[:, :, None] * np.eye(k))


def _extended(maps: FloatArray, k: int) -> FloatArray:
    """Every map with every choice of signs appended: (h 2^(k - old), k, k)."""
    old = maps.shape[1]
    tails = _diagonals(k - old)
    extended = np.zeros((len(maps), len(tails), k, k))
    extended[:, :, :old, :old] = maps[:, None]
    extended[:, :, old:, old:] = tails
    return extended.reshape(-1, k, k)


def _closest_first(pairs: Pairs) -> npt.NDArray[np.intp]:
    """Order of squared residuals; of those that a symmetry makes equal the first is first."""
    return np.argsort((pairs.residual**2).round(_DIGITS), kind="stable")


def _take(pairs: Pairs, rows: npt.NDArray[np.intp] | list[int]) -> Pairs:
    return Pairs(pairs.forward[rows], pairs.backward[rows], pairs.residual[rows])


def _distinct(maps: FloatArray, order: npt.NDArray[np.intp], count: int) -> list[int]:
    """Go through `order` and keep the first `count` maps that differ from those kept."""
    k = maps.shape[1]
    flat = maps.reshape(len(maps), -1)
    # Orthogonal matrices all have squared norm k, so distances follow from inner products.
    squares = 2 * k - 2 * flat @ flat.T
    kept: list[int] = []
    for i in order:
        if all(squares[i, j] >= k * _SAME**2 for j in kept):
            kept.append(int(i))
        if len(kept) == count:
            break
    return kept
