"""Hypotheses from the tips of limbs, for bodies whose eigenfunctions do not correspond.

A tip is where the biharmonic distance to the rest of the surface is greatest nearby. Which tip is
which is guessed from the ways between them, in two senses: limbs are longer or shorter by a factor
of their own, as any way is; or they may be of any length, and only where they begin tells.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from unbend._arrays import snap
from unbend._types import FloatArray, IntArray
from unbend.matching._shape import Shape

# Tips that are nearer to each other than this, in sqrt(area), are one: fingers, ears.
_APART = 0.22
_MOST_TIPS = MOST_LANDMARKS = 7
_NEAR = 1e-3  # landmarks may be nearer than this, or one; then they are taken to be so far apart
# At least so many tips must correspond, and of whole shapes at most so many more may not.
_FEWEST, _LEFT_OUT = 3, 2
_LEAVING_OUT = 0.04  # what leaving one out costs, in the relative deviation of ways
# Variance of a limb's length where it may be any, and how much longer trunks are on another body.
_ANY_LENGTH, _LONGER = 64.0, 1.7


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


def find_tips(shape: Shape) -> Tips:
    """Find landmarks, and far apart local maxima of the mean squared biharmonic distance."""
    # Of equally remote vertices the first is taken, on every processor.
    remoteness = snap(((shape.basis / shape.eigenvalues) ** 2).sum(axis=1))
    spokes = shape.spokes
    highest = np.maximum.reduceat(remoteness[spokes.indices], spokes.indptr[:-1])
    tips = np.flatnonzero(remoteness >= highest)
    graph = edge_graph(shape)
    kept: list[int] = []
    ways = np.empty((0, len(remoteness)))
    sought = [*shape.landmarks, *tips[np.argsort(-remoteness[tips], kind="stable")]]
    for i, tip in enumerate(sought):
        given = i < len(shape.landmarks)
        if given or (len(kept) < _MOST_TIPS and (ways[:, tip] > _APART).all()):
            kept.append(int(tip))
            ways = np.vstack([ways, dijkstra(graph, directed=False, indices=tip)])
    chosen = np.array(kept, dtype=np.int64)
    return Tips(chosen, (ways[:, chosen] + ways[:, chosen].T) / 2, np.ascontiguousarray(ways.T))


def edge_graph(shape: Shape) -> sp.csr_array:
    """Lengths of edges, (n, n)."""
    rows, columns = shape.spokes.nonzero()
    lengths = np.linalg.norm(shape.vertices[rows] - shape.vertices[columns], axis=1)
    return sp.csr_array((lengths, (rows, columns)), shape=shape.spokes.shape)


def guess_limbs(
    source: Tips, target: Tips, count: int, n_landmarks: int = 0, partial: bool = False
) -> list[Guess]:
    """Guess which tips correspond: those between which the ways deviate least, in either sense.

    So many guesses are made in each, or as many as there are; none where a shape has too few tips.
    With landmarks, the first are those with all of them, then with each alone, then with none: one
    of them may be wrong.
    """
    known = [set(range(n_landmarks)), *({i} for i in range(n_landmarks)), set()]
    guesses = (
        Guess(mine, other, size)
        for fixed in known[0 if n_landmarks > 1 else 1 :]
        for mine, other, size in _assignments(source.ways, target.ways, count, fixed, partial)
    )
    return list({(*one.source, -1, *one.target): one for one in guesses}.values())


def _assignments(
    ours: FloatArray, theirs: FloatArray, count: int, fixed: set[int], partial: bool
) -> list[tuple[IntArray, IntArray, float]]:
    """Tips of both shapes that may correspond, and the size; of the fixed ones, i to i."""
    if len(ours) > len(theirs):
        swapped = _assignments(theirs, ours, count, fixed, partial)
        return [(mine, other, 1 / size) for other, mine, size in swapped]
    n = len(ours)
    few, many = (np.maximum(ways, _NEAR) for ways in (ours, theirs))
    senses: list[list[tuple[float, IntArray, IntArray, float]]] = [[], []]
    for m in range(_FEWEST if partial else max(_FEWEST, n - _LEFT_OUT), n + 1):
        rows, columns = np.triu_indices(m, 1)
        others = np.array(list(itertools.permutations(range(len(many)), m)))
        ways = many[others[:, rows], others[:, columns]]
        deviations = [make(m, rows, columns, ways) for make in (_of_logarithms, _of_trunks)]
        logs = np.log(ways)
        for mine in itertools.combinations(range(n), m):
            if not fixed <= set(mine):
                continue
            own = np.array(mine)
            held = np.isin(own, list(fixed))
            free = np.flatnonzero((others[:, held] == own[held]).all(axis=1))
            lengths = few[own[rows], own[columns]]
            for found, deviation in zip(senses, deviations, strict=True):
                costs = deviation(lengths)[free] + _LEAVING_OUT * (n - m)
                best = np.argsort(costs, kind="stable")[:count]
                sizes = np.exp(np.median(logs[free[best]] - np.log(lengths), axis=1))
                found += [
                    (float(costs[i]), own, others[free[i]], float(size))
                    for i, size in zip(best, sizes, strict=True)
                ]
    for found in senses:
        found.sort(key=lambda one: one[0])
    return [one[1:] for found in senses for one in found[:count]]


Deviation = Callable[[FloatArray], FloatArray]  # of many sets of ways from one


def _of_logarithms(n: int, rows: IntArray, columns: IntArray, ways: FloatArray) -> Deviation:
    """Every way varies by a factor of its own, and by one for the limb at either end."""
    whitening = _whitening(n, rows, columns, 1.0)
    whitening -= whitening.mean(axis=0)  # and all by one in common
    many = np.log(ways) @ whitening
    return lambda lengths: _root_mean_square(many - np.log(lengths) @ whitening)


def _of_trunks(n: int, rows: IntArray, columns: IntArray, ways: FloatArray) -> Deviation:
    """Limbs may be of any length: what is left tells which of them begin beside each other."""
    whitening = _whitening(n, rows, columns, _ANY_LENGTH)
    many = ways / _root_mean_square(ways)[:, None] @ whitening
    norms = np.maximum((many**2).sum(axis=1, keepdims=True), _NEAR)

    def deviation(lengths: FloatArray) -> FloatArray:
        one = lengths / _root_mean_square(lengths) @ whitening
        size = (many @ one)[:, None] / norms
        return _root_mean_square(np.clip(size, 1 / _LONGER, _LONGER) * many - one)

    return deviation


def _root_mean_square(rows: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt((rows**2).mean(axis=-1)))


def _whitening(n: int, rows: IntArray, columns: IntArray, limb: float) -> FloatArray:
    """Square root of the inverse covariance of ways: 1 each, and that of the limbs at the ends."""
    limbs = np.zeros((len(rows), n))
    limbs[np.arange(len(rows)), rows] = limbs[np.arange(len(rows)), columns] = 1
    values, vectors = np.linalg.eigh(np.eye(len(rows)) + limb * limbs @ limbs.T)
    return np.asarray(vectors / np.sqrt(values) @ vectors.T)
