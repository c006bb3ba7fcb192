"""Hypotheses from hypotheses: hold what a map explains best, and extrapolate it to the rest.

A map of a part is often right on much of it and wrong on the rest: half a leg lies on the neck.
Either piece may be right, and fit well. One piece is held where it is. The rest follows it as
rigidly as possible, and then lies near where it belongs.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from unbend._arrays import snap
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.matching import _constants as constants
from unbend.matching._registration import Pose, Registered
from unbend.matching._score import unexplained
from unbend.matching._shape import Shape
from unbend.mesh import vertex_normals

# The better explained half is held: all of it, and each of its two largest pieces, unless small.
_HELD, _PIECES, _LEAST_PIECE = 0.5, 2, 0.1


def patches_to_hold(
    source: Shape, target: Shape, found: Registered
) -> list[tuple[BoolArray, BoolArray]]:
    """Choose which vertices of either shape to hold: one or more pairs of masks.

    The list is empty if nothing has a partner.
    """
    ours, theirs = (
        _best_explained(shape.areas * pose.overlap, shares)
        for shape, pose, shares in zip(
            (source, target), found[2:], unexplained(source, target, found), strict=True
        )
    )
    if not (ours.any() and theirs.any()):
        return []
    rows = np.flatnonzero(ours)
    _, pieces = connected_components(source.edge_weights[rows][:, rows], directed=False)
    areas = snap(np.asarray(np.bincount(pieces, source.areas[rows]), dtype=np.float64))
    largest = np.argsort(-areas, kind="stable")[:_PIECES]
    held = [(ours, theirs)]
    for piece in largest[areas[largest] >= _LEAST_PIECE * areas.sum()]:
        mine = np.zeros_like(ours)
        mine[rows[pieces == piece]] = True
        other = theirs & mine[found.backward]
        if other.any() and not np.array_equal(mine, ours):
            held.append((mine, other))
    return held


def extrapolate(
    source: Shape,
    target: Shape,
    found: Registered,
    held: tuple[BoolArray, BoolArray],
) -> Registered:
    """Place what is not held where it is carried to, and map it to what is nearest there."""
    ours, forward = _carried(source, target, found.source, found.forward, held[0])
    theirs, backward = _carried(target, source, found.target, found.backward, held[1])
    return Registered(forward, backward, ours, theirs)


def _best_explained(areas: FloatArray, shares: FloatArray) -> BoolArray:
    order = np.argsort(snap(np.where(areas > 0, shares, np.inf)), kind="stable")
    before = np.cumsum(areas[order]) - areas[order]
    held = np.zeros(len(areas), dtype=bool)
    held[order[before < _HELD * areas.sum()]] = True
    return held


def _carried(
    shape: Shape, goal: Shape, pose: Pose, point_map: IntArray, held: BoolArray
) -> tuple[Pose, IntArray]:
    """Hold vertices at their images, carry the others along, and map these to what is nearest.

    What is nearest there faces as they do. They begin turned as what is held nearest to them.
    """
    data_weights = constants.DATA_WEIGHTS[3] * shape.areas * held
    system = shape.system_of(data_weights)
    force = data_weights[:, None] * goal.vertices[point_map]
    nearest = np.flatnonzero(held)[snap(shape.distances[:, held]).argmin(axis=1)]
    rotations = pose.rotations[nearest]
    for _ in range(constants.STEPS):
        places, *_ = shape.step(system, force, rotations, pose.size)
    normals = vertex_normals(places, shape.faces), goal.normals
    there, here = (
        np.hstack([points, constants.NORMAL_WEIGHT * directions])
        for points, directions in zip((places, goal.vertices), normals, strict=True)
    )
    overlap = np.ones(len(places), dtype=bool)
    moved = Pose(places, rotations, overlap, pose.size)
    return moved, np.where(held, point_map, cKDTree(here).query(there)[1])
