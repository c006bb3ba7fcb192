"""Nearest neighbours of many placements of a point set at once, and points far apart."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from unbend._compiled import compiled
from unbend._parallel import run_all, slices
from unbend._types import FloatArray, IntArray

_TASK = 500_000  # inner products that a thread computes and searches at a time


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
    backward, back = np.zeros((h, n), np.int32), np.full((h, n), np.inf, np.float32)

    def search(some: slice) -> None:
        products = (left[some].reshape(-1, d) @ right.T).reshape(-1, m, n)
        found = forward[some], ahead[some], backward[some], back[some]
        squares, least = (left[some] ** 2).sum(axis=2), np.empty(n, np.float32)
        _find_nearest(products, squares, right_squares, *found, least)

    run_all(functools.partial(search, some) for some in slices(h, max(1, _TASK // (m * n))))
    squares = np.maximum(ahead, 0).mean(axis=1) + np.maximum(back, 0).mean(axis=1)
    return Pairs(forward, backward.astype(np.int64), np.sqrt(squares / 2).astype(np.float64))


@compiled
def _find_nearest(  # type: ignore[no-untyped-def]
    products, left, right, forward, ahead, backward, back, least
):
    """Search all placements; their inner products are overwritten by distances.

    Loops without branches, over numbers of one width, are done in vector registers.
    """
    n_placements, m, n = products.shape
    for h in range(n_placements):
        for i in range(m):
            line = products[h, i]
            number, shift = np.int32(i), left[h, i]
            for j in range(n):
                line[j] = shift + right[j] - np.float32(2) * line[j]
                least[j] = line[j]
                nearer = line[j] < back[h, j]
                back[h, j] = line[j] if nearer else back[h, j]
                backward[h, j] = number if nearer else backward[h, j]
            # Halves are compared side by side, which one minimum is not.
            count = n
            while count > 1:
                half = (count + 1) // 2
                for j in range(count - half):
                    least[j] = min(least[j], least[half + j])
                count = half
            ahead[h, i] = least[0]
            first = np.int32(n)
            for j in range(n):
                first = min(first, np.int32(j) if line[j] == least[0] else np.int32(n))
            forward[h, i] = first


def farthest_points(points: FloatArray, count: int, start: int) -> IntArray:
    """Choose ``count`` rows, each as far as possible from those before it (Gonzalez 1985)."""
    columns = np.ascontiguousarray(points.T)
    squares = np.full(len(points), np.inf)
    chosen = np.full(count, start, dtype=np.int64)
    for i in range(1, count):
        apart = sum((column - column[chosen[i - 1]]) ** 2 for column in columns)
        np.minimum(squares, apart, out=squares)
        chosen[i] = squares.argmax()
    return chosen
