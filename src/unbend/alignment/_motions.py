"""Motions that lay one oriented surface onto another, whatever was cut off either."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from unbend._arrays import snap, unit_vectors
from unbend._compiled import compiled
from unbend._parallel import run_all
from unbend._types import BoolArray, FloatArray, IntArray

_POINTS = 16, 48  # of the source, and of the target, that are laid onto each other
_TURNS = 16  # about a normal
# Motions are compared by so many samples, and so many are kept: more of both at once takes long.
_LAID = (16, 6000), (64, 1500)
_DIFFERENT, _CELL = 0.75, 0.25  # of the reach: so far apart; so large a cell of the grid
_MOST_CELLS = 2**20  # as of a box of 5.5 square roots of the area; wires reach farther

Grid = tuple[IntArray, FloatArray, float]  # (a, b, c) of points, its first middle, a cell's length


class OrientedSurface(NamedTuple):
    """Points of a surface, and which way they face.

    Motions are compared by some points, far apart, of which the first are laid.
    """

    points: FloatArray  # (n, 3)
    normals: FloatArray  # (n, 3)
    samples: IntArray  # (s,) of the points
    areas: FloatArray  # (s,) what each of them stands for
    on_boundary: BoolArray  # (n,) where the surface may go on


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


def find_motions(
    source: OrientedSurface,
    target: OrientedSurface,
    sizes: Sequence[float],
    count: int,
    reach: float,
    pairs: tuple[IntArray, IntArray] | None = None,
) -> Motions:
    """Find at most so many motions that differ, the best first.

    ``sizes`` are tried: how much longer the same is on the target. What is farther off than
    ``reach`` is not near. Without pairs of points, which are laid onto each other, every one of
    some samples is laid onto every one.
    """
    if pairs is None:
        ours, theirs = source.samples[: _POINTS[0]], target.samples[: _POINTS[1]]
        pairs = np.repeat(ours, len(theirs)), np.tile(theirs, len(ours))
    motions = _motions_to_try(source, target, pairs, sizes)
    grids = run_all(functools.partial(_grid_around, one, reach) for one in (target, source))
    for n_samples, most in _LAID:
        ways = (source, target, motions, grids[0]), (target, source, motions.inverse(), grids[1])
        laid = run_all(functools.partial(_areas_laid, *way, reach, n_samples) for way in ways)
        motions = motions.taken(np.argsort(-snap(laid[0] + laid[1]), kind="stable")[:most])
    places = motions.moved(source.points[source.samples[: _POINTS[0]]])
    left = np.ones(len(places), dtype=bool)
    kept: list[int] = []
    while left.any() and len(kept) < count:
        kept.append(int(left.argmax()))
        apart = np.linalg.norm(places - places[kept[-1]], axis=2).mean(axis=1)
        left &= apart > _DIFFERENT * reach
    return motions.taken(np.array(kept))


def _motions_to_try(
    source: OrientedSurface,
    target: OrientedSurface,
    pairs: tuple[IntArray, IntArray],
    sizes: Sequence[float],
) -> Motions:
    """Lay points onto points, normal onto normal, turned about it by every angle."""
    ours, theirs = pairs
    mine, other = _frames(source.normals[ours]), _frames(target.normals[theirs])
    angles = 2 * np.pi * np.arange(_TURNS) / _TURNS
    turns = Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0]).as_matrix()
    rotations = np.einsum("pji,ajk,pkl->pail", other, turns, mine).reshape(-1, 3, 3)
    of = np.repeat(source.points[ours], _TURNS, axis=0)
    onto = np.repeat(target.points[theirs], _TURNS, axis=0)
    turned = np.einsum("hij,hj->hi", rotations, of)
    return Motions(
        np.tile(rotations, (len(sizes), 1, 1)),
        np.concatenate([onto - size * turned for size in sizes]),
        np.repeat(np.array(sizes, dtype=np.float64), len(rotations)),
    )


def _frames(normals: FloatArray) -> FloatArray:
    """Rotations (n, 3, 3) that bring normals to the third axis."""
    other = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = unit_vectors(np.cross(other, normals))
    return np.stack([first, np.cross(normals, first), normals], axis=1)


def _grid_around(goal: OrientedSurface, reach: float) -> Grid:
    """Look up the nearest point of a surface in every cell; -1 where it is on the boundary."""
    corner = goal.points.min(axis=0) - reach
    extent = goal.points.max(axis=0) + reach - corner
    cell = max(_CELL * reach, float(np.cbrt(extent.prod() / _MOST_CELLS)))
    cells = np.ceil(extent / cell).astype(np.int64) + 1
    middles = corner + cell * np.moveaxis(np.indices(tuple(cells)), 0, -1)
    grid = cKDTree(goal.points).query(middles)[1]
    grid[goal.on_boundary[grid]] = -1
    return grid, corner, cell


def _areas_laid(
    one: OrientedSurface,
    goal: OrientedSurface,
    motions: Motions,
    grid: Grid,
    reach: float,
    n_samples: int,
) -> FloatArray:
    """Area (h,) around the first samples that motions lay near a goal, facing as that does."""
    samples = one.samples[:n_samples]
    laid = np.zeros(len(motions.sizes))
    of = one.points[samples], one.normals[samples], one.areas
    lay(of, tuple(motions), grid, goal.points, goal.normals, reach, laid)
    return laid


@compiled
def lay(samples, motions, grid_at, goal, goal_normals, reach, laid):  # type: ignore[no-untyped-def]
    """Add to areas (h,) by how near to the goal motions lay points, and how they face there."""
    points, normals, areas = samples
    rotations, shifts, sizes = motions
    grid, corner, cell = grid_at
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
