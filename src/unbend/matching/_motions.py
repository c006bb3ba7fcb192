"""Hypotheses from the shapes as they stand: motions that lay one onto the other.

Two animals that stand are much alike after a motion of space, whatever was cut off them. Points of
one shape are laid onto points of the other, normal onto normal, and the shape is turned about the
normal. A motion is the better, the more of both shapes it lays near the other one, facing as that
does. What it lays beyond a boundary may be missing there, and counts half.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from unbend._arrays import snap
from unbend._compiled import compiled
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.alignment import nearest_pairs
from unbend.matching import _constants as constants
from unbend.matching._registration import Pose, Registered
from unbend.matching._shape import Shape

_POINTS = 16, 48  # of the source, and of the target, that are laid onto each other
_TURNS = 16  # about a normal
_SAMPLES = 64  # points of a shape, by which motions are compared
_COMPARED = 1500  # motions, the best first, of which those that differ are taken


class Motions(NamedTuple):
    """Similarities of space: ``size * vertices @ rotation.T + shift``."""

    rotations: FloatArray  # (h, 3, 3)
    shifts: FloatArray  # (h, 3)
    sizes: FloatArray  # (h,)

    def inverse(self) -> Motions:
        """Return the motions back."""
        back, sizes = np.ascontiguousarray(self.rotations.transpose(0, 2, 1)), 1 / self.sizes
        return Motions(back, -np.einsum("hij,hj,h->hi", back, self.shifts, sizes), sizes)

    def moved(self, points: FloatArray) -> FloatArray:
        """Move points (n, 3): (h, n, 3)."""
        turned = np.einsum("hij,nj->hni", self.rotations, points)
        return np.asarray(turned * self.sizes[:, None, None] + self.shifts[:, None])

    def taken(self, rows: npt.NDArray[np.intp] | IntArray) -> Motions:
        """Select some."""
        return Motions(*(one[rows] for one in self))


def find_motions(source: Shape, target: Shape, sizes: Sequence[float], count: int) -> Motions:
    """Find at most so many motions that differ, the best first.

    ``sizes`` are tried: how much longer the same is on the target.
    """
    motions = _motions_to_try(source, target, sizes)
    laid = _share_laid(source, target, motions) + _share_laid(target, source, motions.inverse())
    motions = motions.taken(np.argsort(-snap(laid), kind="stable")[:_COMPARED])
    places = motions.moved(source.vertices[source.samples[: _POINTS[0]]])
    left = np.ones(len(places), dtype=bool)
    kept: list[int] = []
    while left.any() and len(kept) < count:
        kept.append(int(left.argmax()))
        apart = np.linalg.norm(places - places[kept[-1]], axis=2).mean(axis=1)
        left &= apart > 2 * constants.PATCH
    return motions.taken(np.array(kept))


def laid_starts(source: Shape, target: Shape, motions: Motions) -> list[Registered]:
    """Poses that motions lead to, and maps to what is nearest there."""
    back = motions.inverse()
    there, here = motions.moved(source.vertices), back.moved(target.vertices)
    facing = np.einsum("hij,nj->hni", motions.rotations, source.normals)
    pairs = nearest_pairs(
        np.concatenate([there, constants.NORMAL_WEIGHT * facing], axis=2),
        np.hstack([target.vertices, constants.NORMAL_WEIGHT * target.normals]),
    )
    return [
        Registered(
            forward,
            backward,
            _posed(there[i], motions, i, ~target.on_boundary[forward]),
            _posed(here[i], back, i, ~source.on_boundary[backward]),
        )
        for i, (forward, backward) in enumerate(zip(pairs.forward, pairs.backward, strict=True))
    ]


def _posed(places: FloatArray, motions: Motions, i: int, overlap: BoolArray) -> Pose:
    rotations = np.tile(motions.rotations[i], (len(places), 1, 1))
    return Pose(places, rotations, overlap, float(motions.sizes[i]))


def _motions_to_try(source: Shape, target: Shape, sizes: Sequence[float]) -> Motions:
    """Lay points onto points, normal onto normal, turned about it by every angle."""
    ours, theirs = source.samples[: _POINTS[0]], target.samples[: _POINTS[1]]
    mine, other = _frames(_smooth_normals(source)[ours]), _frames(_smooth_normals(target)[theirs])
    angles = 2 * np.pi * np.arange(_TURNS) / _TURNS
    turns = Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0]).as_matrix()
    rotations = np.einsum("qji,ajk,pkl->pqail", other, turns, mine).reshape(-1, 3, 3)
    of = np.repeat(source.vertices[ours], len(theirs) * _TURNS, axis=0)
    onto = np.tile(np.repeat(target.vertices[theirs], _TURNS, axis=0), (len(ours), 1))
    turned = np.einsum("hij,hj->hi", rotations, of)
    return Motions(
        np.tile(rotations, (len(sizes), 1, 1)),
        np.concatenate([onto - size * turned for size in sizes]),
        np.repeat(np.array(sizes, dtype=np.float64), len(rotations)),
    )


def _smooth_normals(shape: Shape) -> FloatArray:
    normals = shape.averaged(shape.areas[:, None] * shape.normals, constants.PATCH)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.maximum(lengths, 1e-300))


def _frames(normals: FloatArray) -> FloatArray:
    """Rotations (n, 3, 3) that bring normals to the third axis."""
    other = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(other, normals)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    return np.stack([first, np.cross(normals, first), normals], axis=1)


def _share_laid(shape: Shape, goal: Shape, motions: Motions) -> FloatArray:
    """Share of a shape's area (h,) that motions lay near its goal, facing as the goal does."""
    samples = shape.samples[:_SAMPLES]
    nearest = cKDTree(shape.vertices[samples]).query(shape.vertices)[1]
    areas = np.bincount(nearest, shape.areas, len(samples))
    # The goal's nearest vertex is looked up in a grid around it; -1 on the boundary.
    corner = goal.vertices.min(axis=0) - constants.LIMB
    extent = goal.vertices.max(axis=0) + constants.LIMB - corner
    cells = np.ceil(extent / constants.THIN).astype(np.int64) + 1
    middles = corner + constants.THIN * np.moveaxis(np.indices(tuple(cells)), 0, -1)
    grid = cKDTree(goal.vertices).query(middles)[1]
    grid[goal.on_boundary[grid]] = -1
    found: FloatArray = lay(
        *(shape.vertices[samples], _smooth_normals(shape)[samples], areas),
        *motions,
        *(grid, corner, constants.THIN),
        *(goal.vertices, _smooth_normals(goal), constants.LIMB),
    )
    return found


@compiled
def lay(  # type: ignore[no-untyped-def]
    points, normals, areas, rotations, shifts, sizes, grid, corner, cell, goal, goal_normals, reach
):
    """Add up areas (h,) by how near to the goal motions lay points, and how they face there."""
    laid = np.zeros(len(sizes))
    place, at = np.empty(3), np.empty(3, np.int64)
    for h in range(len(sizes)):
        rotation, size = rotations[h], sizes[h]
        for i in range(len(points)):
            for a in range(3):
                place[a] = shifts[h, a]
                for b in range(3):
                    place[a] += size * rotation[a, b] * points[i, b]
                at[a] = round((place[a] - corner[a]) / cell)
                at[a] = min(max(at[a], 0), grid.shape[a] - 1)
            j = grid[at[0], at[1], at[2]]
            if j < 0:
                laid[h] += areas[i] / 2
                continue
            off = facing = 0.0
            for a in range(3):
                off += (place[a] - goal[j, a]) ** 2
                for b in range(3):
                    facing += rotation[a, b] * normals[i, b] * goal_normals[j, a]
            # Between the lengths of the one shape and those of the other.
            laid[h] += areas[i] * facing * max(1 - off / (size * reach**2), 0.0)
    return laid
