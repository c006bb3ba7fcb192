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
_MOST_TIPS = 7
# At least so many tips must correspond, and at most so many of the shape with fewer may not.
_FEWEST, _LEFT_OUT = 3, 2
# What leaving a tip out costs, in the deviation of the logarithms of the ways.
_LEAVING_OUT = 0.04
_KEPT = 60
# Functions of the maps that are fitted to the tips, and the weight of commuting with the Laplacian.
_SIZE, _COMMUTING = 7, 0.1


class Tips(NamedTuple):
    """Tips of limbs.

    Attributes
    ----------
    vertices : (t,) ndarray of int64
        The most remote first.
    ways : (t, t) ndarray of float64
        Lengths of the shortest ways between them along edges.
    """

    vertices: IntArray
    ways: FloatArray


def find_tips(shape: Shape) -> Tips:
    """Find the local maxima of the mean squared biharmonic distance that are far apart."""
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
    for tip in tips[np.argsort(-remoteness[tips], kind="stable")]:
        if len(kept) < _MOST_TIPS and (ways[:, tip] > _APART).all():
            kept.append(int(tip))
            ways = np.vstack([ways, dijkstra(graph, directed=False, indices=tip)])
    chosen = np.array(kept, dtype=np.int64)
    return Tips(chosen, (ways[:, chosen] + ways[:, chosen].T) / 2)


def maps_from_tips(source: Shape, target: Shape) -> FloatArray:
    """Functional maps under which tips correspond whose ways deviate least, best first: (h, k, k).

    Empty where a shape has too few tips.
    """
    ours, theirs = find_tips(source), find_tips(target)
    size = min(_SIZE, source.k, target.k)
    maps = [
        _fitted(source, target, ours.vertices[mine], theirs.vertices[other], size)
        for mine, other in _assignments(ours.ways, theirs.ways)
    ]
    return np.array(maps).reshape(-1, size, size)


def _assignments(ours: FloatArray, theirs: FloatArray) -> list[tuple[IntArray, IntArray]]:
    """Tips of both shapes that may correspond, least deviation first."""
    if len(ours) > len(theirs):
        return [(mine, other) for other, mine in _assignments(theirs, ours)]
    few, many = (np.log(ways + np.eye(len(ways))) for ways in (ours, theirs))
    n = len(few)
    found = []
    for m in range(max(_FEWEST, n - _LEFT_OUT), n + 1):
        rows, columns = np.triu_indices(m, 1)
        others = np.array(list(itertools.permutations(range(len(many)), m)))
        ways = many[others[:, rows], others[:, columns]]
        whitening = _whitening(m, rows, columns)
        for mine in itertools.combinations(range(n), m):
            own = np.array(mine)
            apart = (ways - few[own[rows], own[columns]]) @ whitening
            deviation = np.sqrt((apart**2).mean(axis=1)) + _LEAVING_OUT * (n - m)
            best = np.argsort(deviation, kind="stable")[:_KEPT]
            found += [(float(deviation[i]), own, others[i]) for i in best]
    found.sort(key=lambda one: one[0])
    return [(own, other) for _, own, other in found[:_KEPT]]


def _whitening(n: int, rows: IntArray, columns: IntArray) -> FloatArray:
    """Square root of the inverse covariance of the ways' logarithms, a common factor taken out."""
    limbs = np.zeros((len(rows), n))
    limbs[np.arange(len(rows)), rows] = limbs[np.arange(len(rows)), columns] = 1
    values, vectors = np.linalg.eigh(np.eye(len(rows)) + limbs @ limbs.T)
    root = vectors / np.sqrt(values) @ vectors.T
    return np.asarray(root - root.mean(axis=0))


def _fitted(source: Shape, target: Shape, ours: IntArray, theirs: IntArray, k: int) -> FloatArray:
    """Orthogonal map of k functions that fits pairs of vertices and nearly commutes."""
    left, right = source.basis[ours, :k], target.basis[theirs, :k]
    ours_scaled = source.eigenvalues[:k] / source.eigenvalues[k - 1]
    theirs_scaled = target.eigenvalues[:k] / target.eigenvalues[k - 1]
    apart = (ours_scaled[:, None] - theirs_scaled) ** 2
    unit = len(ours) * (right**2).mean()
    gram, load = left.T @ left / unit, left.T @ right / unit
    tiny = 1e-6 * np.eye(k)  # a function that no tip sees and that commutes with none
    columns = [
        np.linalg.solve(gram + _COMMUTING * np.diag(apart[:, j]) + tiny, load[:, j])
        for j in range(k)
    ]
    u, _, v = np.linalg.svd(np.stack(columns, axis=1))
    return np.asarray(u @ v)
