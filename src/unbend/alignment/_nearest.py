"""Nearest neighbours in both directions, for many placements of a point set at once."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from unbend._compiled import compiled
from unbend._parallel import run_all
from unbend._types import FloatArray, IntArray

# Bytes of inner products held at once.
_BLOCK_BYTES = 64_000_000
_TASK = 500_000  # inner products that a thread searches at a time


class Pairs(NamedTuple):
    """Nearest neighbours in both directions, for h placements of m points among n points."""

    forward: IntArray  # (h, m) the target point nearest to each source point
    backward: IntArray  # (h, n) the reverse
    residual: FloatArray  # (h,) root mean square distance over both directions


def nearest_pairs(source: FloatArray, target: FloatArray) -> Pairs:
    """Find nearest neighbours of placements (h, m, d) of the source and a target (n, d).

    Distances are computed in single precision; of equally near points, the first is taken.
    """
    left = np.ascontiguousarray(source, dtype=np.float32)
    right = np.ascontiguousarray(target, dtype=np.float32)
    right_squares = (right**2).sum(axis=1)
    h, m, d = left.shape
    n = len(right)
    forward, ahead = np.empty((h, m), np.int64), np.empty((h, m), np.float32)
    backward, back = np.zeros((h, n), np.int64), np.full((h, n), np.inf, np.float32)
    block_size, task_size = (max(1, most // (m * n)) for most in (_BLOCK_BYTES // 4, _TASK))
    for start in range(0, h, block_size):
        block = slice(start, start + block_size)
        placed = left[block]
        products = (placed.reshape(-1, d) @ right.T).reshape(-1, m, n)
        found = forward[block], ahead[block], backward[block], back[block]
        arrays = products, (placed**2).sum(axis=2), right_squares, *found
        run_all(
            functools.partial(_find_nearest, *arrays, i, min(i + task_size, len(placed)))
            for i in range(0, len(placed), task_size)
        )
    squares = np.maximum(ahead, 0).mean(axis=1) + np.maximum(back, 0).mean(axis=1)
    return Pairs(forward, backward, np.sqrt(squares / 2).astype(np.float64))


@compiled
def _find_nearest(  # type: ignore[no-untyped-def]
    products, left, right, forward, ahead, backward, back, first, last
):
    """Search placements from first to last; their inner products are overwritten by distances."""
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
