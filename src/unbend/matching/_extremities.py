"""Hypotheses from extremities, for bodies whose eigenfunctions do not correspond."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import dijkstra

from unbend._arrays import snap
from unbend._parallel import run_all
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.alignment import nearest_pairs
from unbend.matching import _constants as constants
from unbend.matching._shape import Shape

_MOST_GIVEN = 7  # Landmarks that are extremities, the first ones.
_WIDTH = 3000  # Assignments kept after each extremity; a few hundred lose good ones of ten.
_FEWEST = 3  # Extremities that must correspond: fewer do not distinguish left from right.
_NEAR = 1e-3  # Landmarks that are closer than this, or equal, count as this far apart.


class Extremities(NamedTuple):
    """Extremities of a shape, landmarks first, then the most remote; and geodesic distances."""

    vertices: IntArray  # (t,)
    distances: FloatArray  # (t, t) between them, along edges
    fields: FloatArray  # (n, t) from every vertex to them
    n_given: int = 0  # how many are landmarks

    def taken(self, extremities: IntArray, kept: IntArray) -> Extremities:
        """Select some extremities, and the distances to them of some vertices."""
        return Extremities(
            self.vertices[extremities],
            self.distances[np.ix_(extremities, extremities)],
            self.fields[np.ix_(kept, extremities)],
        )


class Guess(NamedTuple):
    """A guess which extremities of two shapes correspond."""

    source: IntArray  # (m,) among the source's extremities
    target: IntArray  # (m,) among the target's
    size: float  # ratio of distances on the target to those on the source
    rank: int  # how many guesses of its kind deviate less


# Deviation (r,) of the distances between so many extremities, (r, p), from others.
Deviation = Callable[[int, FloatArray, FloatArray], FloatArray]


def find_extremities(shape: Shape) -> Extremities:
    """Find landmarks, and far apart local maxima of the mean squared biharmonic distance."""
    # Of equally remote vertices the first is taken, on every processor.
    remoteness = snap(((shape.basis / shape.eigenvalues) ** 2).sum(axis=1))
    edges = shape.edge_weights
    highest = np.maximum.reduceat(remoteness[edges.indices], edges.indptr[:-1])
    extremities = np.flatnonzero(remoteness >= highest)
    kept: list[int] = []
    distances = np.empty((0, len(remoteness)))
    landmarks = shape.landmarks[:_MOST_GIVEN]
    sought = [*landmarks, *extremities[np.argsort(-remoteness[extremities], kind="stable")]]
    for i, extremity in enumerate(sought):
        given = i < len(landmarks)
        if given or (
            len(kept) < constants.N_EXTREMITIES and (distances[:, extremity] > constants.LIMB).all()
        ):
            kept.append(int(extremity))
            distances = np.vstack(
                [distances, dijkstra(shape.edge_lengths, directed=False, indices=extremity)]
            )
    chosen = np.array(kept, dtype=np.int64)
    return Extremities(
        chosen,
        (distances[:, chosen] + distances[:, chosen].T) / 2,
        np.ascontiguousarray(distances.T),
        len(landmarks),
    )


def limb_maps(ours: Extremities, theirs: Extremities) -> tuple[IntArray, IntArray]:
    """Map both ways by the position along each limb, and by distances between the limbs' roots.

    Extremity i corresponds to extremity i. Each limb may be longer or shorter by a factor of its
    own, and the trunk by one factor.
    """
    (limb, along, trunk), (other, there, beyond) = (_coordinates(one) for one in (ours, theirs))
    lengths = np.sqrt(limb * other)
    between = [
        np.maximum(one.distances - ends - ends[:, None], _NEAR)[_pairs(len(ends))].sum()
        for one, ends in ((ours, limb), (theirs, other))
    ]
    size = np.sqrt(between[1] / between[0])
    left = np.hstack([along * lengths / limb, size * trunk])
    right = np.hstack([there * lengths / other, beyond / size])
    pairs = nearest_pairs(left[None], right)
    return pairs.forward[0], pairs.backward[0]


def _coordinates(extremities: Extremities) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lengths of limbs, (t,); distances to their ends, within them and beyond them, (n, t) each.

    A limb is what the shortest paths from its extremity to any two others have in common.
    """
    distances, n = extremities.distances, len(extremities.distances)
    common = (distances[:, :, None] + distances[:, None] - distances) / 2
    others = ~np.eye(n, dtype=bool)
    limbs = common.min(
        axis=(1, 2), where=others[:, :, None] & others[:, None] & others, initial=np.inf
    )
    limbs = np.maximum(limbs, constants.PATCH)
    depths = np.maximum(limbs - extremities.fields, 0)
    elsewhere = depths.sum(axis=1, keepdims=True) - depths
    beyond = np.maximum(extremities.fields - limbs - elsewhere, 0)
    return limbs, np.minimum(extremities.fields, limbs), beyond


def guess_limbs(source: Extremities, target: Extremities, count: int) -> list[Guess]:
    """Guess which extremities correspond: those whose distances deviate least.

    At most `count` guesses of a kind are made, and none if a shape has too few extremities. There
    is a kind for each of the two assumptions; with landmarks, for all of them, for each alone and
    for none, because one of them may be wrong.
    """
    given = range(source.n_given)
    known = [set(given), *({i} for i in given), set()]
    found = run_all(
        functools.partial(_assignments, source.distances, target.distances, count, fixed, deviation)
        for fixed in known[0 if len(given) > 1 else 1 :]
        for deviation in (_of_logarithms, _of_lengths)
    )
    guesses = [
        Guess(mine, other, size, rank)
        for some in found
        for rank, (mine, other, size) in enumerate(some)
    ]
    likeliest: dict[tuple[int, ...], Guess] = {}
    for one in sorted(guesses, key=lambda one: one.rank):
        likeliest.setdefault((*one.source, *one.target), one)
    return list(likeliest.values())


def _assignments(
    ours: FloatArray, theirs: FloatArray, count: int, fixed: set[int], deviation: Deviation
) -> list[tuple[IntArray, IntArray, float]]:
    """Extremities that may correspond, and the size; of the fixed ones, i to i."""
    if len(ours) > len(theirs):
        swapped = _assignments(theirs, ours, count, fixed, deviation)
        return [(mine, other, 1 / size) for other, mine, size in swapped]
    n = len(ours)
    few, many = (np.maximum(distances, _NEAR) for distances in (ours, theirs))
    if n < _FEWEST:
        return []
    # A beam search: each extremity in turn is given a partner, or none, -1.
    partners = np.empty((1, 0), dtype=np.int64)
    for extremity in range(n):
        others = [extremity] if extremity in fixed else [*range(len(many)), -1]
        rows, last = np.repeat(partners, len(others), axis=0), np.tile(others, len(partners))
        free = (last < 0) | (rows != last[:, None]).all(axis=1)
        partners = np.hstack([rows[free], last[free, None]])
        partners = partners[(partners < 0).sum(axis=1) <= n - _FEWEST]
        costs = _costs(few, many, partners, deviation)
        best = np.argsort(snap(costs), kind="stable")[: _WIDTH if extremity < n - 1 else count]
        partners = partners[best]
    sizes = np.empty(len(partners))
    for _, alike, lengths, distances in _between(few, many, partners):
        sizes[alike] = np.exp(np.median(np.log(distances / lengths), axis=1))
    return [
        (np.flatnonzero(row >= 0), row[row >= 0], size)
        for row, size in zip(partners, sizes.tolist(), strict=True)
    ]


def _costs(
    few: FloatArray, many: FloatArray, partners: IntArray, deviation: Deviation
) -> FloatArray:
    """Deviation of distances between extremities, and what those without partner cost."""
    costs = np.asarray(constants.LEFT_OUT * (partners < 0).sum(axis=1), dtype=np.float64)
    for m, alike, lengths, distances in _between(few, many, partners):
        costs[alike] += deviation(m, lengths, distances)
    return costs


def _between(
    few: FloatArray, many: FloatArray, partners: IntArray
) -> Iterator[tuple[int, BoolArray, FloatArray, FloatArray]]:
    """Give numbers of partners, which rows have so many, and distances (r, p) on either side."""
    given = partners >= 0
    counts = given.sum(axis=1)
    for m in np.unique(counts[counts >= _FEWEST]):
        alike = counts == m
        mine = np.nonzero(given[alike])[1].reshape(-1, m)
        other = partners[alike][given[alike]].reshape(-1, m)
        i, j = _pairs(m)
        yield m, alike, few[mine[:, i], mine[:, j]], many[other[:, i], other[:, j]]


@functools.cache  # of few numbers, but asked for often
def _pairs(n: int) -> tuple[IntArray, IntArray]:
    """Give the pairs of n extremities, each once."""
    return np.triu_indices(n, 1)


def _of_logarithms(n: int, lengths: FloatArray, distances: FloatArray) -> FloatArray:
    """Every distance varies by a factor of its own, and by one for the limb at either end."""
    rows, columns = _pairs(n)
    limbs = np.zeros((len(rows), n))
    limbs[np.arange(len(rows)), rows] = limbs[np.arange(len(rows)), columns] = 1
    values, vectors = np.linalg.eigh(np.eye(len(rows)) + limbs @ limbs.T)
    whitening = vectors / np.sqrt(values) @ vectors.T  # root of the inverse covariance
    whitening -= whitening.mean(axis=0)  # and all by one in common
    return _root_mean_square(np.log(distances / lengths) @ whitening)


def _of_lengths(n: int, lengths: FloatArray, distances: FloatArray) -> FloatArray:
    """Every distance varies by the same length, so that long ones must agree best."""
    one, many = (rows / _root_mean_square(rows)[:, None] for rows in (lengths, distances))
    size = (many * one).sum(axis=1) / np.maximum((many**2).sum(axis=1), _NEAR)
    return _root_mean_square(size[:, None] * many - one)


def _root_mean_square(rows: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt((rows**2).mean(axis=-1)))
