"""Clusters of shapes, without labels."""

from __future__ import annotations

import numpy as np

from unbend._arrays import is_whole, numbers_of, snap
from unbend._types import FloatArray, IntArray
from unbend.errors import InputError

_MOST_TRIED = 50
_ROUNDING = 1e-9  # share of the largest distance by which a table may not be symmetric


def find_groups(distances: FloatArray, n_groups: int | None = None) -> IntArray:
    """Group shapes by Ward's linkage, cut where the groups are most distinct.

    Parameters
    ----------
    distances : (n, n) ndarray of float64
        Symmetric, 0 on the diagonal.
    n_groups : int, optional
        How many groups; by default, of 2 to 50, the number with the largest mean silhouette. That
        is of ranks instead of distances (how many others are nearer), so that a few shapes that
        are far from all others do not decide. One group if there are two shapes, or all are equally
        far apart.

    Returns
    -------
    (n,) ndarray of int64
        Number of each one's group, from 0, the largest group first.

    Raises
    ------
    InputError
        If there are fewer than `n_groups`, equal distances do not allow that number, or the table
        is not one of distances.

    References
    ----------
    Ward, "Hierarchical grouping to optimize an objective function", Journal of the American
    Statistical Association 58, 1963.
    Rousseeuw, "Silhouettes: a graphical aid to the interpretation and validation of cluster
    analysis", Journal of Computational and Applied Mathematics 20, 1987.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.collection import find_groups
    >>> places = np.array([0.0, 0.1, 9.0, 0.2, 9.1])
    >>> find_groups(np.abs(places[:, None] - places))
    array([0, 0, 1, 0, 1])
    """
    from scipy.cluster.hierarchy import fcluster, linkage
    from scipy.spatial.distance import squareform
    from scipy.stats import rankdata

    distances = np.atleast_1d(numbers_of(distances, "distances"))
    n = len(distances)
    if n_groups is not None and not (is_whole(n_groups) and 1 <= n_groups <= n):
        bounds = f"from 1 to {n:,}, the number of shapes"
        raise InputError(f"n_groups must be a whole number {bounds}, not {n_groups!r}")
    if distances.shape != (n, n) or not (np.isfinite(distances) & (distances >= 0)).all():
        raise InputError("distances must be a square table of finite numbers, none negative")
    skew = np.abs(distances - distances.T).max(initial=0) + distances.diagonal().max(initial=0)
    if skew > _ROUNDING * distances.max(initial=0):
        raise InputError(f"distances must be symmetric and 0 on the diagonal, not off by {skew:g}")
    if n < 3:
        return np.arange(n) % (n_groups or 1)
    tree = linkage(squareform(distances, checks=False), "ward")
    tried = [n_groups] if n_groups else range(2, min(_MOST_TRIED, n - 1) + 1)
    cuts = [fcluster(tree, count, "maxclust") for count in tried]
    best = cuts[0]
    if len(cuts) > 1:
        ranks = rankdata(snap(distances), axis=1)
        ranks += ranks.T.copy()
        np.fill_diagonal(ranks, 0)
        best = max(cuts, key=lambda labels: silhouette(ranks, labels))
    _, firsts, group, sizes = np.unique(
        best, return_index=True, return_inverse=True, return_counts=True
    )
    if n_groups and len(sizes) < n_groups:
        raise InputError(
            f"{n_groups} groups would separate some that are equally far apart; ask for "
            f"{len(sizes)}, or another number"
        )
    rank = np.lexsort([firsts, -sizes]).argsort()
    return rank[group].astype(np.int64)


def silhouette(distances: FloatArray, labels: IntArray) -> float:
    """Mean over all of ``(b - a) / max(a, b)``; whoever is alone in a group counts 0.

    `a` is the mean distance to the others of one's group, `b` to those of the nearest other group.
    """
    own = labels[:, None] == np.unique(labels)
    sizes = own.sum(axis=0)
    if len(sizes) < 2:
        return 0.0
    sums = distances @ own.astype(float)
    others = np.where(own, np.inf, sums / sizes).min(axis=1)
    size = sizes[own.argmax(axis=1)]
    inner = sums[own] / np.maximum(size - 1, 1)
    larger = np.maximum(np.maximum(inner, others), np.finfo(float).tiny)
    return float(np.where(size > 1, (others - inner) / larger, 0.0).mean())
