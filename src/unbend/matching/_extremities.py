"""Hypotheses from the tips of limbs, for bodies whose eigenfunctions do not correspond.

A tip is where the biharmonic distance to the rest of the surface is greatest nearby. Which tip is
which is guessed from the ways between them, in two senses: limbs are longer or shorter by a factor
of their own, as any way is; or they may be of any length, and only where they begin tells.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import dijkstra

from unbend._arrays import snap
from unbend._types import FloatArray, IntArray
from unbend.alignment import nearest_pairs
from unbend.matching import _constants as constants
from unbend.matching._shape import Shape

MOST_LANDMARKS = 7
_WIDTH = 3000  # Assignments kept after each tip; with ten tips, hundreds lose good ones.
_FEWEST = 3  # tips that must correspond: fewer do not tell left from right
_NEAR = 1e-3  # landmarks may be nearer than this, or one; then they are taken to be so far apart


class Tips(NamedTuple):
    """Tips of limbs.

    Attributes
    ----------
    vertices : (t,) ndarray of int64
        Landmarks first, then the most remote.
    ways : (t, t) ndarray of float64
        Lengths of the shortest ways between them along edges.
    fields : (n, t) ndarray of float64
        And from every vertex to them.
    """

    vertices: IntArray
    ways: FloatArray
    fields: FloatArray

    def taken(self, tips: IntArray, kept: IntArray) -> Tips:
        """Take some of the tips, and some of the vertices' ways to them."""
        return Tips(
            self.vertices[tips], self.ways[np.ix_(tips, tips)], self.fields[np.ix_(kept, tips)]
        )


class Guess(NamedTuple):
    """A guess which points of two shapes correspond.

    Attributes
    ----------
    source, target : (m,) ndarray of int64
        Rows of the shapes' tips, or other points.
    size : float
        How much longer ways are on the target.
    """

    source: IntArray
    target: IntArray
    size: float


# Of ways between so many tips, (r, p), from others: (r,).
Deviation = Callable[[int, FloatArray, FloatArray], FloatArray]


def find_tips(shape: Shape) -> Tips:
    """Find landmarks, and far apart local maxima of the mean squared biharmonic distance."""
    # Of equally remote vertices the first is taken, on every processor.
    remoteness = snap(((shape.basis / shape.eigenvalues) ** 2).sum(axis=1))
    edges = shape.edge_weights
    highest = np.maximum.reduceat(remoteness[edges.indices], edges.indptr[:-1])
    tips = np.flatnonzero(remoteness >= highest)
    kept: list[int] = []
    ways = np.empty((0, len(remoteness)))
    sought = [*shape.landmarks, *tips[np.argsort(-remoteness[tips], kind="stable")]]
    for i, tip in enumerate(sought):
        given = i < len(shape.landmarks)
        if given or (len(kept) < constants.N_TIPS and (ways[:, tip] > constants.LIMB).all()):
            kept.append(int(tip))
            ways = np.vstack([ways, dijkstra(shape.edge_lengths, directed=False, indices=tip)])
    chosen = np.array(kept, dtype=np.int64)
    return Tips(chosen, (ways[:, chosen] + ways[:, chosen].T) / 2, np.ascontiguousarray(ways.T))


def limb_maps(ours: Tips, theirs: Tips) -> tuple[IntArray, IntArray]:
    """Map both ways by how far along a limb vertices are, and where it begins; tip i is tip i.

    Limbs may differ in length, each as it will, and what they begin at by one factor.
    """
    (limb, along, trunk), (other, there, beyond) = (_coordinates(one) for one in (ours, theirs))
    lengths = np.sqrt(limb * other)
    between = [
        np.maximum(one.ways - ends - ends[:, None], _NEAR)[np.triu_indices(len(ends), 1)].sum()
        for one, ends in ((ours, limb), (theirs, other))
    ]
    size = np.sqrt(between[1] / between[0])
    left = np.hstack([along * lengths / limb, size * trunk])
    right = np.hstack([there * lengths / other, beyond / size])
    pairs = nearest_pairs(left[None], right)
    return pairs.forward[0], pairs.backward[0]


def _coordinates(tips: Tips) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lengths of limbs, (t,); ways to their tips, as far as they go, and beyond, (n, t) each.

    A limb is as long as it is common to the ways from its tip to any two others.
    """
    ways, n = tips.ways, len(tips.ways)
    common = (ways[:, :, None] + ways[:, None] - ways) / 2
    others = ~np.eye(n, dtype=bool)
    limbs = common.min(
        axis=(1, 2), where=others[:, :, None] & others[:, None] & others, initial=np.inf
    )
    limbs = np.maximum(limbs, constants.THIN)
    depths = np.maximum(limbs - tips.fields, 0)
    elsewhere = depths.sum(axis=1, keepdims=True) - depths
    beyond = np.maximum(tips.fields - limbs - elsewhere, 0)
    return limbs, np.minimum(tips.fields, limbs), beyond


def guess_limbs(source: Tips, target: Tips, count: int, n_landmarks: int = 0) -> list[Guess]:
    """Guess which tips correspond: those between which the ways deviate least, in either sense.

    So many guesses are made in each, or as many as there are; none where a shape has too few tips.
    With landmarks, the first are those with all of them, then with each alone, then with none: one
    of them may be wrong.
    """
    known = [set(range(n_landmarks)), *({i} for i in range(n_landmarks)), set()]
    guesses = (
        Guess(mine, other, size)
        for fixed in known[0 if n_landmarks > 1 else 1 :]
        for mine, other, size in _assignments(source.ways, target.ways, count, fixed)
    )
    return list({(*one.source, *one.target): one for one in guesses}.values())


def _assignments(
    ours: FloatArray, theirs: FloatArray, count: int, fixed: set[int]
) -> list[tuple[IntArray, IntArray, float]]:
    """Tips of both shapes that may correspond, and the size; of the fixed ones, i to i."""
    if len(ours) > len(theirs):
        swapped = _assignments(theirs, ours, count, fixed)
        return [(mine, other, 1 / size) for other, mine, size in swapped]
    n = len(ours)
    few, many = (np.maximum(ways, _NEAR) for ways in (ours, theirs))
    if n < _FEWEST:
        return []
    guesses = []
    for deviation in (_of_logarithms, _of_trunks):
        # One tip after the other is given a partner, or none, -1; the best are gone on with.
        partners = np.empty((1, 0), dtype=np.int64)
        for tip in range(n):
            partners = _with_another(partners, [tip] if tip in fixed else [*range(len(many)), -1])
            partners = partners[(partners < 0).sum(axis=1) <= n - _FEWEST]
            costs = _costs(few, many, partners, deviation)
            best = np.argsort(snap(costs), kind="stable")[: _WIDTH if tip < n - 1 else count]
            partners = partners[best]
        for row in partners:
            mine = np.flatnonzero(row >= 0)
            one, other = (
                ways[np.ix_(tips, tips)][np.triu_indices(len(mine), 1)]
                for ways, tips in ((few, mine), (many, row[mine]))
            )
            guesses.append((mine, row[mine], float(np.exp(np.median(np.log(other / one))))))
    return guesses


def _with_another(partners: IntArray, others: list[int]) -> IntArray:
    """Rows with every one of the others, that they do not have already, at the end; (r, t + 1)."""
    rows, last = np.repeat(partners, len(others), axis=0), np.tile(others, len(partners))
    free = (last < 0) | (rows != last[:, None]).all(axis=1)
    return np.hstack([rows[free], last[free, None]])


def _costs(
    few: FloatArray, many: FloatArray, partners: IntArray, deviation: Deviation
) -> FloatArray:
    """Deviation of ways between tips from those between their partners, and left out ones."""
    given = partners >= 0
    counts = given.sum(axis=1)
    costs = np.asarray(constants.LEFT_OUT * (~given).sum(axis=1), dtype=np.float64)
    for m in np.unique(counts[counts >= _FEWEST]):
        alike = counts == m
        mine = np.nonzero(given[alike])[1].reshape(-1, m)
        other = partners[alike][given[alike]].reshape(-1, m)
        rows, columns = np.triu_indices(m, 1)
        lengths, ways = (
            few[mine[:, rows], mine[:, columns]],
            many[other[:, rows], other[:, columns]],
        )
        costs[alike] += deviation(m, lengths, ways)
    return costs


def _of_logarithms(n: int, lengths: FloatArray, ways: FloatArray) -> FloatArray:
    """Every way varies by a factor of its own, and by one for the limb at either end."""
    whitening = _whitening(n, 1.0)
    whitening -= whitening.mean(axis=0)  # and all by one in common
    return _root_mean_square(np.log(ways / lengths) @ whitening)


def _of_trunks(n: int, lengths: FloatArray, ways: FloatArray) -> FloatArray:
    """Limbs may be of any length: what is left tells which of them begin beside each other."""
    whitening = _whitening(n, constants.LIMB_LENGTH)
    one, many = (rows / _root_mean_square(rows)[:, None] @ whitening for rows in (lengths, ways))
    size = (many * one).sum(axis=1) / np.maximum((many**2).sum(axis=1), _NEAR)
    return _root_mean_square(size[:, None] * many - one)


def _root_mean_square(rows: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt((rows**2).mean(axis=-1)))


def _whitening(n: int, limb: float) -> FloatArray:
    """Square root of the inverse covariance of ways: 1 each, and that of the limbs at the ends."""
    rows, columns = np.triu_indices(n, 1)
    limbs = np.zeros((len(rows), n))
    limbs[np.arange(len(rows)), rows] = limbs[np.arange(len(rows)), columns] = 1
    values, vectors = np.linalg.eigh(np.eye(len(rows)) + limb * limbs @ limbs.T)
    return np.asarray(vectors / np.sqrt(values) @ vectors.T)
