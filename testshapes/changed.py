"""Bodies that have a part more than others of their kind, such as a rider, or a part less."""

import functools
from collections.abc import Callable, Sequence

import numpy as np

from testshapes.bodies import random_proportions
from unbend._types import BoolArray
from unbend.datasets import Shape
from unbend.datasets._skeleton import Bone, both_sides, chain_of
from unbend.datasets.biped import BIPED
from unbend.datasets.quadruped import QUADRUPED
from unbend.datasets.shape import make_shape

Change = Callable[[Sequence[Bone]], list[Bone]]
Steps = Sequence[tuple[float, float, float]]


def grown(where: str, steps: Steps, radii: Sequence[float], name: str = "extra") -> Change:
    """Let a part grow out of the middle of a bone; what is named left gets a twin."""

    def change(bones: Sequence[Bone]) -> list[Bone]:
        bone = next(one for one in bones if one.name == where)
        middle = (np.array(bone.head) + bone.tail) / 2
        joints = middle + np.cumsum([(0, 0, 0), *steps], axis=0)
        more = chain_of(name, where, joints, np.array(radii))
        return [*bones, *(both_sides(more) if "left" in name else more)]

    return change


def without(*parts: str) -> Change:
    """Take parts off."""
    return lambda bones: [one for one in bones if one.part not in parts]


def all_of(*changes: Change) -> Change:
    """Make changes one after the other."""
    return lambda bones: functools.reduce(lambda done, change: change(done), changes, list(bones))


_MAN = (
    grown("extra_2", [(0, 0.18, 0), (0, 0.1, 0)], [0.09, 0.07, 0.06], "extra_head"),
    grown("extra_2", [(0.1, 0.08, 0), (0.1, -0.12, 0.1), (0, -0.06, 0.18)],
          [0.05, 0.045, 0.035, 0.03], "left_extra_arm"),
)  # fmt: skip
CHANGES: dict[str, dict[str, Change]] = {
    "quadruped": {
        "rider": all_of(grown("loin", [(0, 0.2, 0), (0, 0.2, 0)], [0.09, 0.08, 0.09]), *_MAN),
        "centaur": all_of(without("head"), grown("chest", [(0, 0.2, 0.19), (0, 0.2, 0)],
                                                 [0.1, 0.085, 0.1]), *_MAN),
        "wings": grown("chest", [(0.3, 0.25, 0), (0.25, 0, -0.15)], [0.06, 0.05, 0.035],
                       "left_extra"),
        "horn": grown("head", [(0, 0.2, 0.08), (0, 0.2, 0.08)], [0.04, 0.035, 0.03]),
        "hump": grown("loin", [(0, 0.18, 0)], [0.12, 0.1]),
        "no tail": without("tail"),
        "no head": without("head"),
    },
    "biped": {
        "tail": grown("pelvis", [(0, -0.05, -0.3), (0, -0.1, -0.25), (0, 0.1, -0.25)],
                      [0.08, 0.065, 0.05, 0.04]),
        "bag": grown("chest", [(0, -0.02, -0.28)], [0.14, 0.16]),
        "wings": grown("chest", [(0.15, 0.1, -0.25), (0.35, 0.25, -0.1)], [0.06, 0.07, 0.05],
                       "left_extra"),
        "hat": grown("head", [(0, 0.2, 0), (0, 0.2, -0.02)], [0.12, 0.1, 0.06]),
        "no legs": without("left_leg", "right_leg"),
        "no arms": without("left_arm", "right_arm"),
    },
}  # fmt: skip


def make_changed(
    chance: np.random.Generator, kind: str, change: str, n_vertices: int = 2500
) -> Shape:
    """Make a body of random proportions in a random pose with one of `CHANGES`, or "" for none.

    Raises InputError if its parts touch.
    """
    maker = {"quadruped": QUADRUPED, "biped": BIPED}[kind]
    done = CHANGES[kind].get(change, list)
    left = {bone.name for bone in done(maker.bones(maker.defaults))}
    poses = {
        name: {one: pose[one] for one in pose if {one, f"left_{one}"} & left}
        for name, pose in maker.poses.items()
    }
    body, pose, meshing = (int(one) for one in chance.integers(2**31, size=3))
    sizes = {name: size**0.5 for name, size in random_proportions(kind, body).items()}
    changed = maker._replace(poses=poses, bones=lambda sizes: done(maker.bones(sizes)))
    return make_shape(changed, None, n_vertices, next(iter(maker.species)), meshing, pose, sizes)


def is_usual(shape: Shape) -> BoolArray:
    """Whether a vertex (n,) is of a part that bodies of its kind have."""
    return ~np.array(["extra" in part for part in shape.parts])[shape.labels]
