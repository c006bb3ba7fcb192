"""Hypotheses from the tips of limbs, for bodies whose eigenfunctions do not correspond.

A tip is where the biharmonic distance to the rest of the surface is greatest nearby. Which tip is
which is guessed from the ways between them: on another body every way is longer or shorter by a
factor of its own, and by one for the limb at either end, all of them unknown and equally variable.
"""

from __future__ import annotations

import itertools
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
# At least so many tips must correspond, and at most so many of the shape with fewer may not.
_FEWEST, _LEFT_OUT = 3, 2
# What leaving a tip out costs, in the deviation of the logarithms of the ways.
_LEAVING_OUT = 0.04
_KEPT = 60


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


class Limbs(NamedTuple):
    """A guess which tips correspond.

    Attributes
    ----------
    source, target : (m,) ndarray of int64
        Rows of the shapes' tips.
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
    rows, columns = spokes.nonzero()
    lengths = np.linalg.norm(shape.vertices[rows] - shape.vertices[columns], axis=1)
    graph = sp.csr_array((lengths, (rows, columns)), shape=spokes.shape)
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


def guess_limbs(source: Tips, target: Tips, n_landmarks: int = 0) -> list[Limbs]:
    """Guess which tips correspond: those between which the ways deviate least, the best first.

    Empty where a shape has too few tips. With landmarks, the first guesses are those with all of
    them, then with each alone, then with none: one of them may be wrong.
    """
    known = [set(range(n_landmarks)), *({i} for i in range(n_landmarks)), set()]
    return [
        Limbs(mine, other, size)
        for fixed in known[0 if n_landmarks > 1 else 1 :]
        for _, mine, other, size in _assignments(source.ways, target.ways, fixed)
    ]


def _assignments(
    ours: FloatArray, theirs: FloatArray, fixed: set[int]
) -> list[tuple[float, IntArray, IntArray, float]]:
    """Tips of both shapes that may correspond, least deviation first; of the fixed ones, i to i."""
    if len(ours) > len(theirs):
        swapped = _assignments(theirs, ours, fixed)
        return [(d, mine, other, 1 / size) for d, other, mine, size in swapped]
    few, many = (np.log(np.maximum(ways + np.eye(len(ways)), _NEAR)) for ways in (ours, theirs))
    n = len(few)
    found = []
    for m in range(max(_FEWEST, n - _LEFT_OUT), n + 1):
        rows, columns = np.triu_indices(m, 1)
        others = np.array(list(itertools.permutations(range(len(many)), m)))
        ways = many[others[:, rows], others[:, columns]]
        whitening = _whitening(m, rows, columns)
        for mine in itertools.combinations(range(n), m):
            if not fixed <= set(mine):
                continue
            own = np.array(mine)
            held = np.isin(own, list(fixed))
            free = (others[:, held] == own[held]).all(axis=1)
            longer = ways[free] - few[own[rows], own[columns]]
            deviation = np.sqrt(((longer @ whitening) ** 2).mean(axis=1)) + _LEAVING_OUT * (n - m)
            best = np.argsort(deviation, kind="stable")[:_KEPT]
            sizes = np.exp(np.median(longer[best], axis=1))
            found += [
                (float(deviation[i]), own, others[free][i], float(size))
                for i, size in zip(best, sizes, strict=True)
            ]
    found.sort(key=lambda one: one[0])
    return found[:_KEPT]


def _whitening(n: int, rows: IntArray, columns: IntArray) -> FloatArray:
    """Square root of the inverse covariance of the ways' logarithms, a common factor taken out."""
    limbs = np.zeros((len(rows), n))
    limbs[np.arange(len(rows)), rows] = limbs[np.arange(len(rows)), columns] = 1
    values, vectors = np.linalg.eigh(np.eye(len(rows)) + limbs @ limbs.T)
    root = vectors / np.sqrt(values) @ vectors.T
    return np.asarray(root - root.mean(axis=0))
