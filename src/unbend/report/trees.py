"""Which of many shapes stand beside each other: the tree of average linkage."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from unbend._types import FloatArray, IntArray


class Tree(NamedTuple):
    """What is alike, joined step by step.

    Attributes
    ----------
    order : (n,) ndarray of int64
        The leaves, the most alike beside each other.
    heights, places : (n - 1, 4) ndarray of float64
        A bracket for each join: from one branch up to the join, along it, and down to the other.
        The leaf that `order` names at ``i`` is at the place `i`.
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
    """Join what is near by average linkage.

    Parameters
    ----------
    distances : (n, n) ndarray of float64
        Symmetric, 0 on the diagonal; two shapes at least.

    Returns
    -------
    Tree

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.report.trees import join_alike
    >>> places = np.array([0.0, 9.0, 1.0])
    >>> float(join_alike(np.abs(places[:, None] - places)).heights.max())
    8.5
    """
    from scipy.cluster.hierarchy import dendrogram, linkage
    from scipy.spatial.distance import squareform

    near = squareform(distances, checks=False)
    tree = linkage(near, "average", optimal_ordering=len(distances) <= 1000)
    drawn = dendrogram(tree, no_plot=True)
    # SciPy puts leaf i at 10 i + 5.
    places = (np.array(drawn["icoord"]) - 5) / 10
    return Tree(np.array(drawn["leaves"], dtype=np.int64), np.array(drawn["dcoord"]), places)
