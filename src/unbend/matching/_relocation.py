"""Hypotheses from hypotheses: where a vertex belongs, by how far it is from all that is far away.

A limb that a map swaps with another, or twists, disagrees with the rest of the body about the ways
between them, and the rest says where it belongs. What is near a vertex went astray with it and is
not asked.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import dijkstra

from unbend._arrays import snap
from unbend._types import FloatArray, IntArray
from unbend.matching._registration import Registered
from unbend.matching._shape import Shape
from unbend.matching._tips import edge_graph

# What is nearer to a vertex than this, in sqrt(area), is not asked; ways count as no shorter than
# the second, for their logarithms are compared.
_FAR, _SHORTEST = 0.3, 0.02
_ROUNDS = 3


def ways_between(shape: Shape) -> FloatArray:
    """Lengths (n, n) of the shortest ways along edges between all vertices of a small shape."""
    return np.asarray(dijkstra(edge_graph(shape), directed=False))


def relocate(
    source: Shape, target: Shape, found: Registered, ways: tuple[FloatArray, FloatArray]
) -> tuple[IntArray, IntArray]:
    """Place the vertices of either shape anew, some times, by the ways to all vertices far away.

    Parameters
    ----------
    source, target : Shape
    found : Registered
        What has no partner there is not asked.
    ways : two ndarrays of float64
        See :func:`ways_between`.
    """
    forward, backward = found[:2]
    here, there = (np.log(np.maximum(one, _SHORTEST)) for one in ways)
    longer = np.log(found.source.size)
    here, there = here + longer / 2, there - longer / 2
    asked = np.concatenate([source.areas * found.source.within, target.areas * found.target.within])
    for _ in range(_ROUNDS):
        left, right = np.hstack([here, here[:, backward]]), np.hstack([there[:, forward], there])
        forward, backward = _place(left, right, asked), _place(right, left, asked)
    return forward, backward


def _place(left: FloatArray, right: FloatArray, asked: FloatArray) -> IntArray:
    """Where the mean square of the ways' differences is least."""
    counted = np.where(left > np.log(_FAR), asked, 0.0)
    costs = counted @ (right**2).T - 2 * (counted * left) @ right.T
    return np.asarray(snap(costs).argmin(axis=1))
