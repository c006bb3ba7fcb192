"""Bones: what gives a body its shape at rest, and moves its skin into a pose or another body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from unbend._arrays import numbers_of
from unbend._types import FloatArray, IntArray
from unbend.alignment import nearest_rotation
from unbend.datasets._cones import Cones, newton_step
from unbend.deformation import ElasticSurface
from unbend.errors import InputError
from unbend.mesh import measure_corners

Point = tuple[float, float, float]
Pose = Mapping[str, Sequence[float]]

_BLEND = 0.016  # how far two parts reach to flow into each other
_SPREAD = 0.03  # the same for the motion of two bones
_REACH = 0.2  # features of a pose larger than this keep their places where lengths are restored
_N_STEPS = 12  # of restoring lengths
_N_BETWEEN = 16  # bodies on the way from one to another


class Bone(NamedTuple):
    """A rounded cone that turns about its head.

    Lengths are in units of roughly a body's length; x points to the animal's left, y up,
    z forward. ``flat`` is the direction in which the cone is flattened, its length the factor.
    """

    name: str
    parent: str | None
    head: Point
    tail: Point
    head_radius: float
    tail_radius: float
    part: str
    flat: Point = (1.0, 0.0, 0.0)
    chain: str = ""  # bones of one chain meet without the swelling where other parts flow together


def chain_of(part: str, parent: str, joints: FloatArray, radii: FloatArray) -> list[Bone]:
    """Make a part of bones between joints (n, 3): ``part_1``, ``part_2`` and so on."""
    names = [parent, *(f"{part}_{i + 1}" for i in range(len(joints) - 1))]
    points: list[Point] = [(x, y, z) for x, y, z in joints.tolist()]
    r = radii.tolist()
    return [
        Bone(names[i + 1], names[i], points[i], points[i + 1], r[i], r[i + 1], part, chain=part)
        for i in range(len(points) - 1)
    ]


def _mirrored(bone: Bone) -> Bone:
    """Make the right-hand twin of a left-hand bone."""
    twin: dict[str, Any] = bone._asdict()
    for name, value in twin.items():
        if isinstance(value, str):
            twin[name] = value.replace("left", "right")
        elif isinstance(value, tuple):
            twin[name] = (-value[0], *value[1:])
    return Bone(**twin)


def both_sides(bones: Sequence[Bone]) -> list[Bone]:
    """Follow each bone whose name speaks of the left by its twin."""
    doubled = [(b, _mirrored(b)) if "left" in b.name else (b,) for b in bones]
    return [bone for pair in doubled for bone in pair]


def cones_of(bones: Sequence[Bone], *, for_motion: bool = False) -> Cones:
    """Give the body its shape; or, for motion, the same with bones pulled back from their joints.

    Pulling back makes the difference of two bones' distances grow linearly across their joint,
    so that a bend is spread evenly over the skin around it.
    """
    heads = np.array([bone.head for bone in bones], dtype=np.float64)
    tails = np.array([bone.tail for bone in bones], dtype=np.float64)
    head_radii = np.array([bone.head_radius for bone in bones])
    tail_radii = np.array([bone.tail_radius for bone in bones])
    if for_motion:
        axes = tails - heads
        lengths = np.linalg.norm(axes, axis=1)
        axes /= np.maximum(lengths, 1e-9)[:, None]
        heads = heads + np.minimum(0.35 * lengths, head_radii)[:, None] * axes
        tails = tails - np.minimum(0.35 * lengths, tail_radii)[:, None] * axes
    flats = np.array([bone.flat for bone in bones], dtype=np.float64)
    factors = np.linalg.norm(flats, axis=1)
    flats /= factors[:, None]
    names = [bone.chain or bone.name for bone in bones]
    order = list(dict.fromkeys(names))
    chains = np.array([order.index(name) for name in names])
    return Cones(heads, tails, head_radii, tail_radii, flats, factors - 1, chains, _BLEND)


def pose_of(**angles: float | Sequence[float]) -> Pose:
    """Make a pose from a bone's angles about x, y and z, or that about x alone."""
    return {bone: (x, 0, 0) if isinstance(x, float | int) else x for bone, x in angles.items()}


def skin_weights(bones: Sequence[Bone], points: FloatArray) -> FloatArray:
    """Shares of bones in the motion of points on the resting skin, (n_points, n_bones)."""
    distances = cones_of(bones, for_motion=True).distances(points)
    weights = np.exp((distances.min(axis=0) - distances) / _SPREAD)
    weights = np.maximum(weights - 0.01, 0).T
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _joint_rotations(bones: Sequence[Bone], pose: Pose) -> FloatArray:
    """Each bone's own rotation, (n_bones, 3, 3), from angles in degrees about x, y and z.

    A name without its side ("thigh" for "left_thigh" and "right_thigh") turns both, mirrored.
    """
    angles = {bone.name: np.zeros(3) for bone in bones}
    for name, given in pose.items():
        turn = numbers_of(given, f"the angles of {name!r}")
        if turn.shape != (3,) or not np.isfinite(turn).all():
            raise InputError(f"the angles of {name!r} must be three finite numbers, not {given!r}")
        if name in angles:
            angles[name] += turn
        elif f"left_{name}" in angles:
            angles[f"left_{name}"] += turn
            angles[f"right_{name}"] += turn * [1, -1, -1]
        else:
            raise InputError(f"no bone is called {name!r}; the bones are {', '.join(angles)}")
    stacked = np.stack(list(angles.values()))
    return np.asarray(Rotation.from_euler("xyz", stacked, degrees=True).as_matrix())


def move_skin(bones: Sequence[Bone], points: FloatArray, pose: Pose) -> FloatArray:
    """Carry points of the resting skin into a pose, by dual quaternions (Kavan et al. 2007)."""
    motions: dict[str | None, tuple[FloatArray, FloatArray]] = {None: (np.eye(3), np.zeros(3))}
    for bone, own in zip(bones, _joint_rotations(bones, pose), strict=True):
        turn, shift = motions[bone.parent]
        head, turned = np.array(bone.head), turn @ own
        motions[bone.name] = turned, turn @ head + shift - turned @ head
    turns, shifts = (np.stack([motions[bone.name][i] for bone in bones]) for i in range(2))
    weights = skin_weights(bones, points)
    real = Rotation.from_matrix(turns).as_quat()  # scalar last
    u, a = np.split(real, [3], axis=1)
    dual = np.hstack([a * shifts + np.cross(shifts, u), -(shifts * u).sum(axis=1, keepdims=True)])
    leader = real[weights.argmax(axis=1)]
    signed = weights * np.where(leader @ real.T < 0, -1.0, 1.0)
    q, d = signed @ real, signed @ dual
    norm = np.linalg.norm(q, axis=1, keepdims=True)
    (u, a), (v, b) = (np.split(one / norm, [3], axis=1) for one in (q, d))
    return np.asarray(
        Rotation.from_quat(q).apply(np.array(points)) + a * v - b * u + np.cross(u, v)
    )


def restore_lengths(rest: FloatArray, posed: FloatArray, faces: IntArray) -> FloatArray:
    """Move posed vertices (n, 3) so that edges come closer to their resting lengths.

    Blended motions bend a limb like rubber. A few steps of as-rigid-as-possible deformation, held
    close to the posed skin, take out most of the stretch.
    """
    n = len(rest)
    dots, _, double_areas = measure_corners(rest, faces)
    cotangents = np.clip(dots / (2 * np.maximum(double_areas, 1e-12))[:, None], 0.02, 5).ravel()
    ends = [faces[:, [1, 2, 0]].ravel(), faces[:, [2, 0, 1]].ravel()]
    weights = sp.csr_matrix((np.tile(cotangents, 2), np.hstack([ends, ends[::-1]])), shape=(n, n))
    areas: FloatArray = np.bincount(faces.ravel(), np.repeat(double_areas, 3), n) / 6
    surface = ElasticSurface(rest, faces, areas).with_edge_weights(weights)
    system = surface.system(1 / _REACH**2)
    force = areas[:, None] * posed / _REACH**2
    moved = posed
    for _ in range(_N_STEPS):
        turns = nearest_rotation(surface.covariances(moved).transpose(0, 2, 1))
        moved = surface.fit_places(system, force, turns)
    return moved


def carry(points: FloatArray, bones: Sequence[Bone], onto: Sequence[Bone]) -> FloatArray:
    """Carry points (n, 3) of a resting skin onto that of the same bones of other places and sizes.

    The bones change in small steps. At each, a point goes with the bones near it, keeping its place
    along each bone and its distance in bone radii, and then straight onto the new skin: a smooth
    map that commutes with the left-right symmetry.
    """
    now = list(bones)
    for step in range(1, _N_BETWEEN + 1):
        following = [_between(a, b, step / _N_BETWEEN) for a, b in zip(bones, onto, strict=True)]
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
        turn = Rotation.align_vectors(new_axis, axis)[0].as_matrix()  # the shortest one
        place = np.array(new.head) + along * new_axis + new_radius / radius * (offset @ turn.T)
        moved[near] += weights[near, b, None] * place
    return moved
