"""The order of many shapes by average linkage: similar shapes are neighbours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from unbend._types import FloatArray, IntArray


class Tree(NamedTuple):
    """A dendrogram: leaves in their order, and for each join the heights and places of a bracket.

    `heights` and `places`, (n - 1, 4), lead from one branch up to the join, along it, and down to
    the other. Leaf ``order[i]`` is at place `i`.
    """

    order: IntArray
    heights: FloatArray
    places: FloatArray


def apart(similarities: FloatArray) -> FloatArray:
    """Turn similarities, 1 for the same and NaN where unknown, into distances."""
    distances = np.where(np.isfinite(similarities), 1 - similarities, 1.0)
    distances = np.maximum(distances + distances.T, 0) / 2
    np.fill_diagonal(distances, 0)
    return np.asarray(distances)


def join_alike(distances: FloatArray) -> Tree:
    """Cluster two shapes or more by average linkage, from distances (n, n)."""
    from scipy.cluster.hierarchy import dendrogram, linkage
    from scipy.spatial.distance import squareform

    near = squareform(distances, checks=False)
    tree = linkage(near, "average", optimal_ordering=len(distances) <= 1000)
    drawn = dendrogram(tree, no_plot=True)
    # SciPy puts leaf i at 10 i + 5.
    places = (np.array(drawn["icoord"]) - 5) / 10
    return Tree(np.array(drawn["leaves"], dtype=np.int64), np.array(drawn["dcoord"]), places)
