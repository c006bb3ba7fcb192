"""Hypotheses from hypotheses: where a vertex belongs, by the ways to vertices far from it.

Ways agree where a map is right. A limb that it swaps with another, or twists, disagrees with the
rest, which says where the limb belongs; what is near a vertex went astray with it and is not asked.
Either all the rest is asked, or the trunk above all.
"""

from __future__ import annotations

import numpy as np

from unbend._arrays import snap
from unbend._types import FloatArray, IntArray
from unbend.matching._registration import Registered
from unbend.matching._shape import Shape

# What is nearer to a vertex than this, in sqrt(area), is not asked; ways count as no shorter than
# the second, for their logarithms are compared.
_BESIDE, _SHORTEST_WAY = 0.25, 0.02
# How much less a vertex counts whose mean way to all others is twice that of the most central one,
# as the logarithm: nothing, so that all are asked alike; and so much that the trunk is asked.
EVERYWHERE, TRUNK = 0.0, 10.0
_TIMES = 3


def relocate(
    source: Shape,
    target: Shape,
    found: Registered,
    asked: float,
) -> tuple[IntArray, IntArray]:
    """Place the vertices of either shape anew, some times, by the ways to those far away.

    Parameters
    ----------
    source, target : Shape
    found : Registered
        What has no partner there is not asked.
    asked : float
        How much less what is not central counts, `EVERYWHERE` or `TRUNK`.
    """
    forward, backward = found[:2]
    here, there = (np.log(np.maximum(one, _SHORTEST_WAY)) for one in (source.ways, target.ways))
    longer = np.log(found.source.size)
    here, there = here + longer / 2, there - longer / 2
    weights = np.concatenate(
        [
            _central(shape.areas * pose.within, shape.ways, asked)
            for shape, pose in zip((source, target), found[2:], strict=True)
        ]
    )
    for _ in range(_TIMES):
        left, right = np.hstack([here, here[:, backward]]), np.hstack([there[:, forward], there])
        forward, backward = _place(left, right, weights), _place(right, left, weights)
    return forward, backward


def _central(areas: FloatArray, ways: FloatArray, asked: float) -> FloatArray:
    """Weights (n,) of vertices: their areas, less the further they are from all others."""
    remote = ways @ areas
    return np.asarray(areas * np.exp(asked * (1 - remote / max(remote.min(), _SHORTEST_WAY))))


def _place(left: FloatArray, right: FloatArray, weights: FloatArray) -> IntArray:
    """Where the mean square of the ways' differences is least."""
    counted = np.where(left > np.log(_BESIDE), weights, 0.0)
    costs = counted @ (right**2).T - 2 * (counted * left) @ right.T
    return np.asarray(snap(costs).argmin(axis=1))
