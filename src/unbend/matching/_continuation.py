"""Hypotheses from hypotheses: what a map explains best, continued as rigidly as possible.

A map of a part is often right on much of it, and caught elsewhere on the rest: a leg of which a
camera saw one side lies on the neck. Either piece may be the right one, and fit well; what joins
them does not. One is held where it is and carries along all the rest, which then lies near where
it belongs.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import connected_components

from unbend._arrays import snap
from unbend._types import BoolArray, FloatArray
from unbend.matching._judge import unexplained
from unbend.matching._registration import Registered, carried
from unbend.matching._shape import Shape

# The share of what has partners that is held, the best explained: all of it, and its largest
# pieces, so many, that have at least so much of it.
_HELD, _PIECES, _LEAST = 0.5, 2, 0.1


def patches_to_hold(
    source: Shape, target: Shape, found: Registered
) -> list[tuple[BoolArray, BoolArray]]:
    """Find what may be right of a registration, in some ways: which vertices of either shape.

    There is none where nothing has a partner.
    """
    ours, theirs = (
        _best_explained(shape.areas * pose.within, shares)
        for shape, pose, shares in zip(
            (source, target), found[2:], unexplained(source, target, found), strict=True
        )
    )
    if not (ours.any() and theirs.any()):
        return []
    rows = np.flatnonzero(ours)
    _, pieces = connected_components(source.spokes[rows][:, rows], directed=False)
    areas = snap(np.asarray(np.bincount(pieces, source.areas[rows]), dtype=np.float64))
    largest = np.argsort(-areas, kind="stable")[:_PIECES]
    held = [(ours, theirs)]
    for piece in largest[areas[largest] >= _LEAST * areas.sum()]:
        mine = np.zeros_like(ours)
        mine[rows[pieces == piece]] = True
        other = theirs & mine[found.backward]
        if other.any() and not np.array_equal(mine, ours):
            held.append((mine, other))
    return held


def continued(
    source: Shape,
    target: Shape,
    found: Registered,
    ways: tuple[FloatArray, FloatArray],
    held: tuple[BoolArray, BoolArray],
) -> Registered:
    """Place what is not held where it is carried to, and map it to what is nearest there.

    Parameters
    ----------
    source, target : Shape
    found : Registered
    ways : two ndarrays of float64
        See :func:`unbend.matching._relocation.ways_between`.
    held : two ndarrays of bool
        See :func:`patches_to_hold`.
    """
    ours, forward = carried(source, target, found.source, found.forward, held[0], ways[0])
    theirs, backward = carried(target, source, found.target, found.backward, held[1], ways[1])
    return Registered(forward, backward, ours, theirs)


def _best_explained(areas: FloatArray, shares: FloatArray) -> BoolArray:
    order = np.argsort(snap(np.where(areas > 0, shares, np.inf)), kind="stable")
    before = np.cumsum(areas[order]) - areas[order]
    held = np.zeros(len(areas), dtype=bool)
    held[order[before < _HELD * areas.sum()]] = True
    return held
