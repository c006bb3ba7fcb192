"""Nearest neighbours both ways, for many placements of a point set at once."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from unbend._compiled import compiled
from unbend._parallel import run_all
from unbend._types import FloatArray, IntArray

_Floats32 = npt.NDArray[np.float32]

# Bytes of inner products held at once.
_BLOCK_BYTES = 64_000_000
_TASK = 500_000  # inner products that a thread looks through at a time


class Pairs(NamedTuple):
    """Nearest neighbours in both directions, for h maps between m and n points.

    Attributes
    ----------
    forward : (h, m) ndarray of int64
        For each source point, its target point.
    backward : (h, n) ndarray of int64
        For each target point, its source point.
    residual : (h,) ndarray of float64
        Root mean square distance over both directions.
    """

    forward: IntArray
    backward: IntArray
    residual: FloatArray


def nearest_pairs(source: FloatArray, target: FloatArray) -> Pairs:
    """Nearest neighbours both ways, for several placements of the source at once.

    Parameters
    ----------
    source : (h, m, d) ndarray of float64
        The source points under each of h maps.
    target : (n, d) ndarray of float64

    Returns
    -------
    Pairs

    Examples
    --------
    >>> import numpy as np
    >>> nearest_pairs(np.array([[[0.0], [2.0]]]), np.array([[2.1], [0.1]])).forward
    array([[1, 0]])
    """
    left = np.ascontiguousarray(source, dtype=np.float32)
    right = np.ascontiguousarray(target, dtype=np.float32)
    right_norms = (right**2).sum(axis=1)
    h, m, d = left.shape
    step = max(1, _BLOCK_BYTES // (4 * m * len(right)))
    forward = np.empty((h, m), dtype=np.int64)
    backward = np.empty((h, len(right)), dtype=np.int64)
    residual = np.empty(h)
    for i in range(0, h, step):
        part = slice(i, i + step)
        block = left[part]
        products = (block.reshape(-1, d) @ right.T).reshape(len(block), m, len(right))
        forward[part], ahead, backward[part], back = _both_ways(
            products, (block**2).sum(axis=2), right_norms
        )
        squares = np.maximum(ahead, 0).mean(axis=1) + np.maximum(back, 0).mean(axis=1)
        residual[part] = np.sqrt(squares / 2)
    return Pairs(forward, backward, residual)


def _both_ways(
    products: _Floats32, left: _Floats32, right: _Floats32
) -> tuple[IntArray, _Floats32, IntArray, _Floats32]:
    """Nearest pairs both ways from inner products; ``products`` (h, m, n) is overwritten.

    The squared distance of rows i and j under hypothesis h is
    ``left[h, i] + right[j] - 2 products[h, i, j]``.
    """
    hypotheses, m, n = products.shape
    forward = np.empty((hypotheses, m), np.int64)
    forward_distance = np.empty((hypotheses, m), np.float32)
    backward = np.zeros((hypotheses, n), np.int64)
    backward_distance = np.full((hypotheses, n), np.float32(np.inf))
    found = forward, forward_distance, backward, backward_distance
    step = max(1, _TASK // (m * n))
    run_all(
        functools.partial(
            _nearest_both_ways, products, left, right, *found, i, min(i + step, hypotheses)
        )
        for i in range(0, hypotheses, step)
    )
    return found


@compiled
def _nearest_both_ways(  # type: ignore[no-untyped-def]
    products, left, right, forward, ahead, backward, back, first, last
):
    _, m, n = products.shape
    for h in range(first, last):
        for i in range(m):
            line = products[h, i]
            offset = left[h, i]
            best = np.float32(np.inf)
            for j in range(n):
                line[j] = offset + right[j] - np.float32(2) * line[j]
            for j in range(n):
                best = min(best, line[j])
            for j in range(n):
                if line[j] == best:
                    forward[h, i] = j
                    break
            for j in range(n):
                if line[j] < back[h, j]:
                    back[h, j] = line[j]
                    backward[h, j] = i
            ahead[h, i] = best
