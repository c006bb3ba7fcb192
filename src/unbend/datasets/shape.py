"""What the makers of synthetic shapes return, and how two of them correspond."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from unbend._arrays import check_choice, check_whole, is_number, nearest_rows
from unbend._display import Brief
from unbend._types import FloatArray, IntArray
from unbend.datasets._skeleton import Bone, Pose, carry, cones_of, move_skin, restore_lengths
from unbend.datasets._surface import skin
from unbend.errors import InputError
from unbend.mesh import Mesh


@dataclass(frozen=True, eq=False, repr=False)
class Shape(Brief):
    """A posed synthetic body with everything that is known about it.

    Attributes
    ----------
    mesh : Mesh
        The body in its pose: one closed surface without handles, faces oriented outward.
        x points to its left, y up, z forward.
    rest : (n, 3) ndarray of float64, read-only
        The same vertices in the rest pose.
    mirror : (n,) ndarray of int64, read-only
        ``mirror[i]`` is the left-right mirror image of vertex ``i``, exactly so in the rest
        pose.
    labels : (n,) ndarray of int64, read-only
        The body part of each vertex, an index into ``parts``.
    parts : tuple of str
        Names of the body parts.
    bones, plain_bones : tuple of Bone
        The resting skeleton, and that of the same maker without any proportions given.
    """

    mesh: Mesh
    rest: FloatArray
    mirror: IntArray
    labels: IntArray
    parts: tuple[str, ...]
    bones: tuple[Bone, ...]
    plain_bones: tuple[Bone, ...]

    @cached_property
    def reference(self) -> FloatArray:
        """Where the vertices lie on the plain body of the maker at rest, (n, 3), read-only.

        The same point of two bodies, whatever their proportions, poses and meshings, lies at the
        same place there.
        """
        if self.bones == self.plain_bones:
            return self.rest
        reference = carry(self.rest, self.bones, self.plain_bones)
        reference.setflags(write=False)
        return reference


def rest_map(source: Shape, target: Shape) -> IntArray:
    """Map one shape truly to another of its kind, whatever their proportions, poses and meshings.

    Parameters
    ----------
    source, target : Shape
        Made by the same maker.

    Returns
    -------
    source_to_target : (n_source,) ndarray of int64
        For each source vertex, the target vertex nearest to it in the rest pose; where the
        proportions differ, nearest on the plain body of the maker, onto which both are carried
        bone by bone. The mirrored truth is ``target.mirror[source_to_target]``.

    Raises
    ------
    InputError
        If the two are bodies of different kinds.

    Examples
    --------
    >>> from unbend.datasets import make_octopus, rest_map
    >>> source = make_octopus("swimming", n_vertices=600)
    >>> target = make_octopus("crawling", n_vertices=600, meshing=1)
    >>> rest_map(source, target).shape
    (600,)
    """
    for one in (source, target):
        if not isinstance(one, Shape):
            raise InputError(f"rest_map needs two Shapes, not {type(one).__name__}")
    if source.plain_bones != target.plain_bones:
        raise InputError("bodies of different makers have no points in common")
    points = source.rest, target.rest
    if source.bones != target.bones:
        points = source.reference, target.reference
    return nearest_rows(*points)


class Maker(NamedTuple):
    """What a kind of animals has in common: proportions by species, poses, and bones of sizes."""

    species: Mapping[str, Mapping[str, float]]
    defaults: Mapping[str, float]
    poses: Mapping[str, Pose]
    bones: Callable[[Mapping[str, float]], list[Bone]]


def make_shape(
    maker: Maker,
    pose: str | Pose | None,
    n_vertices: int,
    species: str,
    meshing: int,
    random_state: int | None,
    proportions: Mapping[str, float],
) -> Shape:
    """Mesh a body at rest and move it into a pose; see `make_quadruped` for the parameters."""
    sizes = _sizes(maker, species, proportions)
    bones, plain = (tuple(maker.bones(one)) for one in (sizes, maker.defaults))
    n_vertices = check_whole(n_vertices, "n_vertices", 500, 200_000)
    meshing = check_whole(meshing, "meshing")
    if random_state is not None:
        check_whole(random_state, "random_state")
    angles = _angles(maker.poses, pose, random_state)
    rest, faces, mirror, labels, parts = _rest_body(bones, n_vertices, meshing)
    posed = restore_lengths(rest, move_skin(bones, rest, angles), faces) if angles else rest
    return Shape(Mesh(posed, faces, name=species), rest, mirror, labels, parts, bones, plain)


def _sizes(maker: Maker, species: str, given: Mapping[str, float]) -> dict[str, float]:
    """Combine the default, the species' and the caller's proportions, and check their names."""
    check_choice(species, "species", maker.species)
    for key, value in given.items():
        check_choice(key, "a proportion", maker.defaults)
        low, high = (-180, 180) if key == "tail_lift" else (0, 10)
        if not (is_number(value) and low < value <= high):
            raise InputError(f"{key} must be above {low} and at most {high}, not {value!r}")
    return {**maker.defaults, **maker.species[species], **given}


def _angles(poses: Mapping[str, Pose], pose: str | Pose | None, random_state: int | None) -> Pose:
    """Look up a named pose; for None, mix two and move every joint in use a little further."""
    if isinstance(pose, Mapping):
        return pose
    if pose is not None:
        check_choice(pose, "pose", poses)
        return poses[pose]
    rng = np.random.default_rng(random_state)
    names = list(poses)
    first, second = rng.choice(len(names), 2, replace=False)
    share = rng.uniform(0.2, 0.8)
    joints = sorted({joint for given in poses.values() for joint in given})
    angles = {}
    for joint in joints:
        a, b = (np.array(poses[names[i]].get(joint, (0, 0, 0))) for i in (first, second))
        angles[joint] = (share * a + (1 - share) * b + rng.normal(0, 4, 3)).tolist()
    return angles


@lru_cache(maxsize=16)
def _rest_body(
    bones: tuple[Bone, ...], n_vertices: int, meshing: int
) -> tuple[FloatArray, IntArray, IntArray, IntArray, tuple[str, ...]]:
    """Posing is quick and meshing is not: the poses of one body share its resting mesh."""
    cones = cones_of(bones)
    rest, faces, mirror = skin(cones, n_vertices, meshing=meshing)
    parts = tuple(dict.fromkeys(bone.part for bone in bones))
    part_of_bone = np.array([parts.index(bone.part) for bone in bones])
    labels = part_of_bone[cones.distances(rest).argmin(axis=0)]
    for array in (rest, faces, mirror, labels):
        array.setflags(write=False)
    return rest, faces, mirror, labels, parts
