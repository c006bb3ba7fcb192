"""Hypotheses from points with similar surroundings, for parts that share no extremities.

Some points of either shape, far apart, are paired with those of the other whose surroundings are
alike. Pairs support each other that are as far apart on one shape as on the other; from every pair
in turn the ones that support it, and each other, are gathered, by the power method on the matrix
of that support (Leordeanu & Hebert, "A spectral technique for correspondence problems using
pairwise constraints", ICCV 2005), while pairs of one point compete.
"""

from __future__ import annotations

import functools
import itertools
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import dijkstra

from unbend._arrays import snap
from unbend._parallel import run_all
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.alignment import nearest_pairs
from unbend.matching import _constants as constants
from unbend.matching._extremities import Guess
from unbend.matching._shape import Shape

# Surroundings are described within so many distances, from `PATCH` on, each by this factor longer
# than the last. Sizes of a part beside the whole are tried by the same factor, so many.
_FACTOR, _N_RADII, _SIZES = 2**0.25, 9, 6
_DEVIATION = 0.25  # relative difference of distances at which pairs do not support each other
_ROUNDS = 5  # of the power method
_HALF = 0.5  # of support: what has less than half of the best is not gathered; of pairs: the same
_FEWEST = 4  # pairs
_LEAST = 1e-6  # support that is not rounding


class Points(NamedTuple):
    """Points of a shape, far apart.

    Attributes
    ----------
    fields : (n, p) ndarray of float64
        Geodesic distances from every vertex to them, along edges.
    distances : (p, p) ndarray of float64
        Geodesic distances between them.
    surroundings : (p, r, 6) ndarray of float64
        What lies around each, within each of some distances, in their unit.
    whole : (p, r) ndarray of bool
        Whether it does not reach a boundary.
    """

    fields: FloatArray
    distances: FloatArray
    surroundings: FloatArray
    whole: BoolArray


def sizes_to_try(source: Shape, target: Shape) -> range:
    """How much larger the same may be on the target, of unit area as the source, in factors.

    Of two parts either may be.
    """
    both = source.partial and target.partial
    most = _SIZES // 2 if both else _SIZES
    return range(-most * source.partial, most * target.partial + 1)


def find_points(shape: Shape, count: int) -> Points:
    """Find points as far from each other as possible, and describe what is around them."""
    lengths = shape.edge_lengths
    chosen = [int(shape.samples[0])]
    fields = [dijkstra(lengths, directed=False, indices=chosen[0])]
    nearest = snap(fields[0])  # of equally far ones the first is taken, on every processor
    while len(chosen) < min(count, len(shape.areas)):
        chosen.append(int(nearest.argmax()))
        fields.append(dijkstra(lengths, directed=False, indices=chosen[-1]))
        nearest = np.minimum(nearest, snap(fields[-1]))
    distances = np.array(fields)[:, chosen]
    described = [_describe(shape, one, field) for one, field in zip(chosen, fields, strict=True)]
    surroundings, whole = (np.array(part) for part in zip(*described, strict=True))
    return Points(
        np.ascontiguousarray(np.transpose(fields)),
        (distances + distances.T) / 2,
        surroundings,
        whole,
    )


def point_maps(ours: FloatArray, theirs: FloatArray, size: float) -> tuple[IntArray, IntArray]:
    """Map vertices both ways by their distances (n, p) and (m, p) from points that correspond."""
    left, right = (
        np.exp(-(size**0.5) * ours / constants.LIMB),
        np.exp(-(size**-0.5) * theirs / constants.LIMB),
    )
    pairs = nearest_pairs(left[None], right)
    return pairs.forward[0], pairs.backward[0]


def _describe(shape: Shape, vertex: int, field: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Describe what lies within each radius: how much, how high, how wide, and how it is turned."""
    normal, radii = shape.normals[vertex], constants.PATCH * _FACTOR ** np.arange(_N_RADII)
    offsets, facing = shape.vertices - shape.vertices[vertex], shape.normals @ normal
    inside = np.clip((radii[:, None] - field) / shape.edge + 0.5, 0, 1) * shape.areas
    seen = inside * np.maximum(facing, 0)
    # A vertex whose faces lie back to back faces nowhere, and sees nothing.
    total = np.maximum(seen.sum(axis=1, keepdims=True), _LEAST**2)
    means = seen @ offsets / total
    squares = np.einsum("rn,ni,nj->rij", seen, offsets, offsets) / total[:, :, None]
    spread = np.linalg.eigvalsh(squares - means[:, :, None] * means[:, None])
    widths = 2 * np.sqrt(np.maximum(spread, 0)) / radii[:, None]
    described = np.column_stack(
        [
            np.sqrt(inside.sum(axis=1) / np.pi) / radii,
            2 * means @ normal / radii,
            widths,
            seen @ facing / total[:, 0],
        ]
    )
    ends = field[shape.on_boundary]
    return described, radii < (ends.min() if len(ends) else np.inf)


def guess_points(ours: Points, theirs: Points, sizes: range, count: int) -> list[Guess]:
    """Guess which points of two shapes correspond, at most so many times, for sizes to be tried."""
    some = run_all(functools.partial(_consistent, ours, theirs, size) for size in sizes)
    found = list(itertools.chain.from_iterable(some))
    found.sort(key=lambda one: -round(one[0], constants.DIGITS))
    kept: list[tuple[set[int], Guess]] = []
    for _, guess in found:
        pairs = set((guess.source * len(theirs.distances) + guess.target).tolist())
        if all(len(pairs & other) < _HALF * len(pairs) for other, _ in kept):
            kept.append((pairs, guess))
            if len(kept) == count:
                break
    return [guess for _, guess in kept]


def _consistent(ours: Points, theirs: Points, step: int) -> list[tuple[float, Guess]]:
    """Gather pairs that support each other, and the support, if sizes differ by so many factors."""
    size = _FACTOR**step
    unlike = _unlike(ours, theirs, step)
    n, k = len(unlike), min(constants.BEAM, unlike.shape[1])
    partners = np.argsort(snap(unlike), axis=1, kind="stable")[:, :k]
    usual = max(float(np.median(unlike.min(axis=1))), _LEAST)
    alike = np.exp(-np.take_along_axis(unlike, partners, 1) / (2 * usual))
    mine, other, alike = np.arange(n).repeat(k), partners.ravel(), alike.ravel()
    here = ours.distances[np.ix_(mine, mine)] * size**0.5
    there = theirs.distances[np.ix_(other, other)] / size**0.5
    deviation = np.abs(here - there) / np.maximum(np.minimum(here, there), constants.PATCH)
    support = np.maximum(1 - (deviation / _DEVIATION) ** 2, 0)
    support *= np.exp(-(here + there) / (8 * constants.LIMB)) * np.sqrt(alike[:, None] * alike)
    support[(mine[:, None] == mine) | (other[:, None] == other)] = 0
    shares = np.eye(n * k)
    for _ in range(_ROUNDS):
        gathered = (shares @ support).reshape(-1, n, k)
        best = gathered.max(axis=2, keepdims=True)
        gathered *= (gathered / np.maximum(best, _LEAST)) ** 2
        shares = gathered.reshape(-1, n * k)
        shares /= np.maximum(np.linalg.norm(shares, axis=1, keepdims=True), _LEAST)
    gathered = shares.reshape(-1, n, k)
    best = gathered.max(axis=2, keepdims=True)
    least = _HALF * best.max(axis=1, keepdims=True)
    chosen = np.unique(((gathered == best) & (best > least)).reshape(-1, n * k), axis=0)
    chosen = chosen[chosen.any(axis=1)]
    # The better supported half: the others may be beyond what both have.
    supported = np.where(chosen, chosen @ support, np.nan)
    chosen &= supported >= np.nanmedian(supported, axis=1, keepdims=True)
    numbers = chosen.sum(axis=1)
    totals = ((chosen @ support) * chosen).sum(axis=1) / np.maximum(numbers, 1)
    return [
        (float(total), Guess(mine[one], other[one], size))
        for total, number, one in zip(totals, numbers, chosen, strict=True)
        if number >= _FEWEST
    ]


def _unlike(ours: Points, theirs: Points, step: int) -> FloatArray:
    """Mean difference of surroundings, (p, q), of a shape that is so many steps larger."""
    difference, weight = np.zeros((2, len(ours.distances), len(theirs.distances)))
    for i in range(max(0, -step), min(_N_RADII, _N_RADII - step)):
        apart = np.abs(ours.surroundings[:, None, i] - theirs.surroundings[:, i + step])
        whole = ours.whole[:, None, i] & theirs.whole[:, i + step]
        # Near a boundary the area says nothing, and the other features count half.
        difference += np.where(whole, apart.sum(axis=2), apart[:, :, 1:].sum(axis=2) / 2)
        weight += np.where(whole, 1, 0.5)
    return np.asarray(difference / weight, dtype=np.float64)
