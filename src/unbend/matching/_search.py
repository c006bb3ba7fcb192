"""Hypotheses: a beam search over alignments of growing spectral canonical forms.

Eigenfunctions come with unknown signs, mix where eigenvalues are close, and the low ones of a
person do not know front from back. So nothing is decided early: every choice of signs starts a
hypothesis, each new eigenfunction branches it, and the closest ones that differ survive.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from unbend._types import FloatArray
from unbend.alignment import Pairs, nearest_pairs
from unbend.matching._shape import Shape
from unbend.matching._zoomout import orthogonal_maps, spectral_weights

_SIGNED = 6
_LAST = 20
_SAMPLES = 250
_BEAM = 16
_DESCRIPTOR_WEIGHT = 0.1
# Two maps of k functions are the same when they differ by less than this, times sqrt(k).
_SAME = 0.15
_DIGITS = 6  # of squared residuals, that are not rounding: they come of single precision


def search(
    source: Shape,
    target: Shape,
    *,
    beam: int = _BEAM,
    on_step: Callable[[float], None] | None = None,
) -> FloatArray:
    """Find the functional maps that bring two shapes' spectral forms close to each other.

    Returns
    -------
    (h, k, k) ndarray of float64
        Up to `beam` orthogonal maps between the first k (at most 20) non-constant
        eigenfunctions, closest first.
    """
    available = min(source.k, target.k)
    left = source.samples[:_SAMPLES]
    right = target.samples[:_SAMPLES]
    forms = source.basis[left], target.basis[right]
    base = _descriptor_distances(source.signature[left], target.signature[right])

    def pairs_of(maps: FloatArray) -> Pairs:
        k = maps.shape[1]
        weights = spectral_weights(source.eigenvalues, target.eigenvalues, k)
        return nearest_pairs(forms[0][:, :k] @ maps * weights, forms[1][:, :k] * weights, base)

    k = min(_SIGNED, available)
    maps = _diagonals(k)
    pairs = pairs_of(maps)
    last = min(_LAST, available)
    for size in [*range(k + 2, last, 2), last]:
        sized = forms[0][:, :size], forms[1][:, :size]
        starts = np.concatenate([orthogonal_maps(*sized, pairs), _extended(maps, size)])
        pairs = pairs_of(starts)
        closest = _closest_first(pairs)[: 4 * beam]
        pairs = pairs_of(orthogonal_maps(*sized, _take(pairs, closest)))
        maps = orthogonal_maps(*sized, pairs)
        best = _distinct(maps, _closest_first(pairs), beam)
        maps, pairs = maps[best], _take(pairs, best)
        if on_step is not None:
            on_step(size / last)
    return maps


def _descriptor_distances(source: FloatArray, target: FloatArray) -> npt.NDArray[np.float32]:
    squares = (source**2).sum(axis=1)[:, None] + (target**2).sum(axis=1) - 2 * source @ target.T
    return np.asarray(_DESCRIPTOR_WEIGHT**2 * squares, dtype=np.float32)


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
