"""Carry points from the skin of one body onto that of another with the same bones.

The bones change in small steps. At each, a point goes with the bones near it, keeping its place
along each bone and its distance in bone radii, and then straight onto the new skin: a smooth map
that commutes with the left-right symmetry.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from unbend._types import FloatArray
from unbend.datasets._cones import newton_step
from unbend.datasets._skeleton import Bone, cones_of, skin_weights

_N_STEPS = 16


def carry(points: FloatArray, bones: Sequence[Bone], onto: Sequence[Bone]) -> FloatArray:
    """Carry points (n, 3) of a resting skin onto the skin of a body with other proportions.

    `bones` and `onto` are the same bones in the same order, of other places and sizes.
    """
    now = list(bones)
    for step in range(1, _N_STEPS + 1):
        following = [_between(a, b, step / _N_STEPS) for a, b in zip(bones, onto, strict=True)]
        points = _go_along(now, following, points)
        field, _ = cones_of(following).local_field(points)
        for _ in range(3):
            points = newton_step(field, points)
        now = following
    return points


def _between(one: Bone, other: Bone, share: float) -> Bone:
    sizes = ("head", "tail", "head_radius", "tail_radius", "flat")
    pairs = {name: np.array([getattr(one, name), getattr(other, name)]) for name in sizes}
    return one._replace(**{name: (1 - share) * a + share * b for name, (a, b) in pairs.items()})


def _go_along(now: Sequence[Bone], after: Sequence[Bone], points: FloatArray) -> FloatArray:
    weights = skin_weights(now, points)
    moved = np.zeros_like(points)
    for b, (old, new) in enumerate(zip(now, after, strict=True)):
        near = np.flatnonzero(weights[:, b])
        head, axis = np.array(old.head), np.subtract(old.tail, old.head)
        new_axis = np.subtract(new.tail, new.head)
        length = float(np.linalg.norm(axis))
        along = np.clip((points[near] - head) @ axis / length**2, 0, 1)[:, None]
        offset = points[near] - head - along * axis
        radius = old.head_radius + along * (old.tail_radius - old.head_radius)
        new_radius = new.head_radius + along * (new.tail_radius - new.head_radius)
        turn = _turn(axis / length, new_axis / np.linalg.norm(new_axis))
        place = np.array(new.head) + along * new_axis + new_radius / radius * (offset @ turn.T)
        moved[near] += weights[near, b, None] * place
    return moved


def _turn(a: FloatArray, b: FloatArray) -> FloatArray:
    """Turn one unit vector into another, less than half a turn away, the shortest way."""
    v = np.cross(a, b)
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + a @ b))
