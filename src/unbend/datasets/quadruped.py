"""Four-legged animals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from unbend.datasets._skeleton import Bone, Point, Pose, both_sides, chain_of, pose_of
from unbend.datasets.shape import Maker, Shape, make_shape

# Factors on the dog's proportions; ``tail_lift`` is the tail's angle above the horizontal, degrees.
_SPECIES: dict[str, dict[str, float]] = {
    "dog": {},
    "cat": {
        "legs": 0.8, "neck": 0.6, "tail": 1.6, "ears": 0.6, "muzzle": 0.42, "girth": 0.88,
        "paws": 0.85, "tail_lift": 20.0, "ear_spread": 1.15, "head": 1.05, "body": 0.92,
    },
    "horse": {
        "legs": 1.42, "neck": 1.85, "tail": 1.3, "ears": 0.6, "muzzle": 1.65, "girth": 1.3,
        "body": 1.12, "paws": 0.5, "tail_lift": -62.0, "ear_spread": 0.85, "head": 1.1,
    },
    "bear": {
        "legs": 0.85, "neck": 0.75, "tail": 0.3, "ears": 0.35, "muzzle": 0.75, "girth": 1.5,
        "paws": 1.3, "tail_lift": -30.0, "ear_spread": 1.25, "head": 1.3,
    },
    "giraffe": {
        "legs": 1.75, "neck": 3.9, "tail": 1.0, "ears": 0.5, "muzzle": 1.25, "girth": 1.15,
        "paws": 0.5, "tail_lift": -60.0, "ear_spread": 1.0, "head": 0.95,
    },
}  # fmt: skip
_DEFAULTS = dict.fromkeys(
    ("legs", "neck", "tail", "ears", "muzzle", "girth", "body", "paws", "head", "limbs",
     "tail_lift", "ear_spread"), 1.0,
) | {"tail_lift": 35.0}  # fmt: skip

# Degrees about x (positive: the top goes forward, a leg backward), y (to the left) and z.
_POSES: dict[str, Pose] = {
    "standing": pose_of(),
    "walking": pose_of(
        left_upper_arm=-28, left_forearm=-5, left_fore_paw=12, right_upper_arm=22,
        right_forearm=-12, right_pastern=25, left_thigh=24, left_shin=5, left_metatarsus=-8,
        right_thigh=-26, right_shin=22, right_metatarsus=-14, neck=(12, 6, 0), tail_1=(0, 12, 0),
        tail_2=(0, 12, 0), chest=(0, 4, 0),
    ),
    "galloping": pose_of(
        pelvis=-4, loin=5, chest=3, left_upper_arm=-62, right_upper_arm=-48, forearm=-8, pastern=14,
        left_thigh=52, right_thigh=40, shin=12, metatarsus=8, neck=30, head=-24, tail_1=-15,
    ),
    "sitting": pose_of(
        pelvis=-37, loin=-6, chest=-4, upper_arm=(38, 0, 4), forearm=4, pastern=-4, fore_paw=6,
        thigh=(-26, 8, 8), shin=74, metatarsus=-66, hind_paw=30, neck=20, head=26,
        tail_1=(-10, 20, 0), tail_2=(-10, 22, 0), tail_3=(0, 22, 0),
    ),
    "lying": pose_of(
        upper_arm=(-66, 6, 0), forearm=-14, fore_paw=12, thigh=(-58, 14, 12), shin=74,
        metatarsus=-62, hind_paw=20, loin=4, chest=-4, neck=(-6, 24, 0), head=(6, 10, 0),
        tail_1=(24, -18, 0), tail_2=(8, -20, 0), tail_3=(4, -22, 0),
    ),
    "stretching": pose_of(
        pelvis=22, loin=10, chest=-4, upper_arm=-78, forearm=-14, pastern=10, thigh=-24, shin=4,
        metatarsus=-2, neck=-28, head=-8, tail_1=30, tail_2=12,
    ),
    "howling": pose_of(pelvis=-8, neck=-30, head=-48, thigh=8, upper_arm=8, tail_1=-20),
    "grazing": pose_of(
        chest=10, neck=74, head=22, upper_arm=(-10, 0, 3), left_upper_arm=-18, right_upper_arm=14,
    ),
    "rearing": pose_of(
        pelvis=-58, loin=-4, thigh=44, shin=8, metatarsus=6, left_upper_arm=-34, right_upper_arm=-8,
        left_forearm=18, right_forearm=8, pastern=60, neck=24, head=28,
    ),
    "scratching": pose_of(
        pelvis=-40, loin=(-6, 14, 0), chest=(-4, 16, 0), neck=(16, 26, 0), head=(18, 16, 10),
        upper_arm=42, right_thigh=(-26, -8, -8), right_shin=74, right_metatarsus=-66,
        right_hind_paw=30, left_thigh=(-66, 0, 24), left_shin=50, left_metatarsus=-50,
        tail_1=(-6, -20, 0),
    ),
}  # fmt: skip


def make_quadruped(
    pose: str | Pose | None = "standing",
    *,
    n_vertices: int = 5000,
    species: str = "dog",
    meshing: int = 0,
    random_state: int | None = None,
    **proportions: float,
) -> Shape:
    """Make a four-legged animal: dog, cat, horse, or one of your own proportions.

    Parameters
    ----------
    pose : str, mapping, or None, default="standing"
        "standing", "walking", "galloping", "sitting", "lying", "stretching", "howling", "grazing",
        "rearing" or "scratching"; a mapping from bone names to angles in degrees about x, y and z
        (``"thigh"`` turns both sides, ``"left_thigh"`` one; an unknown name lists them all); or
        None: a random pose between two named ones.
    n_vertices : int, default=5000
        Number of vertices, met exactly; 500 to 200000.
    species : str, default="dog"
        "dog", "cat", "horse", "bear" or "giraffe".
    meshing : int, default=0
        Any larger number: other vertices and triangles on the same surface. :func:`rest_map`
        relates meshings. Posed surfaces of two meshings agree up to about an edge length.
    random_state : int or None, default=None
        Seed of a random pose; unused otherwise. None: another pose each time.
    **proportions : float
        Factors on the species' proportions: ``legs``, ``neck``, ``tail``, ``ears``,
        ``muzzle``, ``girth``, ``body`` (its length), ``paws``, ``head``, ``ear_spread``,
        ``limbs`` (how thick the legs are); and ``tail_lift``, the resting tail's angle above
        the horizontal in degrees. From about 0.7 to 1.4 of the species' own they look natural.

    Returns
    -------
    Shape
        Vertices and faces are numbered alike in all poses of one body and meshing. A standing dog
        is 1.5 units long, with its tail, and 1.0 high.

    Raises
    ------
    InputError
        If a pose, bone, species or proportion does not exist (the message lists those that do),
        a number is out of range, or the proportions make parts of the body touch or come off.

    See Also
    --------
    make_biped, make_octopus, rest_map

    Examples
    --------
    >>> from unbend.datasets import make_quadruped
    >>> shape = make_quadruped("galloping", n_vertices=600)
    >>> shape.mesh
    Mesh(600 vertices, 1196 faces)
    >>> bool((shape.mirror[shape.mirror] == range(600)).all())
    True
    """
    return make_shape(QUADRUPED, pose, n_vertices, species, meshing, random_state, proportions)


def _bones(p: Mapping[str, float]) -> list[Bone]:
    legs, girth, paws, head = p["legs"], p["girth"], p["paws"], p["head"]
    limbs = p["limbs"]
    drop = 0.55 * (legs - 1)  # how much higher longer legs carry the body

    def trunk(x: float, y: float, z: float) -> Point:
        return (x * girth, y + drop, z * p["body"])

    def leg(x: float, y: float, z: float, ahead: float = 0.0) -> Point:
        middle = 0.25 if z > 0 else -0.36
        return (x * girth, y * legs, middle * p["body"] + (z - middle) * legs**0.5 + ahead)

    _, base_y, base_z = trunk(0, 0.59, 0.30)
    top_y, top_z = base_y + 0.155 * p["neck"], base_z + 0.135 * p["neck"]
    thick = girth * (0.75 + 0.25 * p["neck"])

    def face(x: float, y: float, z: float) -> Point:
        return (x * head, top_y + 0.035 + y * head, top_z + 0.03 + z * head)

    m = p["muzzle"]
    long = max(0.0, m - 1)  # a long muzzle points down, as a horse's does
    tip = (0.0, -0.035 - 0.19 * long, 0.11 + 0.11 * min(m, 1.0) + 0.06 * long)
    ears, spread = p["ears"] * head, p["ear_spread"]
    ear = face(0.058 * spread, 0.055, -0.01)
    ear_tip = (ear[0] + 0.035 * ears, ear[1] + 0.125 * ears, ear[2] - 0.02 * ears)
    narrow = (1.18, 0.0, 0.0)
    lift = np.deg2rad(p["tail_lift"])
    step = 0.085 * p["tail"] * np.array([0, np.sin(lift), -np.cos(lift)])
    tail = np.array(trunk(0, 0.59, -0.45)) + np.arange(5)[:, None] * step
    bones = [
        Bone("pelvis", None, trunk(0, 0.55, -0.38), trunk(0, 0.56, -0.2), 0.09 * girth,
             0.092 * girth, "torso", chain="spine"),
        Bone("loin", "pelvis", trunk(0, 0.56, -0.2), trunk(0, 0.55, 0), 0.092 * girth,
             0.11 * girth, "torso", chain="spine"),
        Bone("chest", "loin", trunk(0, 0.55, 0), trunk(0, 0.535, 0.26), 0.12 * girth,
             0.13 * girth, "torso", narrow, "spine"),
        Bone("neck", "chest", (0.0, base_y, base_z), (0.0, top_y, top_z), 0.088 * thick,
             0.066 * girth, "head"),
        Bone("head", "neck", face(0, 0, 0), face(0, 0, 0.075), 0.08 * head, 0.07 * head, "head"),
        Bone("muzzle", "head", face(0, -0.018, 0.08), face(*tip), 0.058 * head,
             0.037 * head * m**0.5, "head"),
        Bone("left_eye", "head", face(0.05, 0.032, 0.103), face(0.051, 0.034, 0.106), 0.023 * head,
             0.023 * head, "head"),
        Bone("left_ear", "head", ear, ear_tip, 0.046 * head, 0.019 * head, "head",
             (0.25, -0.2, 1.75)),
        *chain_of("tail", "pelvis", tail, np.linspace(0.034, 0.022, 5)),
        Bone("left_upper_arm", "chest", leg(0.085, 0.5, 0.25), leg(0.1, 0.335, 0.21),
             0.07 * girth, 0.045 * limbs, "left_foreleg", chain="left_foreleg"),
        Bone("left_forearm", "left_upper_arm", leg(0.1, 0.335, 0.21), leg(0.1, 0.125, 0.235),
             0.045 * limbs, 0.031 * limbs, "left_foreleg", chain="left_foreleg"),
        Bone("left_pastern", "left_forearm", leg(0.1, 0.125, 0.235), leg(0.1, 0.05, 0.245),
             0.032 * limbs, 0.031 * limbs, "left_foreleg", chain="left_foreleg"),
        Bone("left_fore_paw", "left_pastern", leg(0.1, 0.04, 0.25),
             leg(0.1, 0.034, 0.25, 0.055 * paws), 0.037 * limbs, 0.034 * limbs,
             "left_foreleg", chain="left_foreleg"),
        Bone("left_thigh", "pelvis", leg(0.075, 0.5, -0.37), leg(0.1, 0.34, -0.31),
             0.088 * girth, 0.052 * limbs, "left_hindleg", (1.15, 0, 0), "left_hindleg"),
        Bone("left_shin", "left_thigh", leg(0.1, 0.34, -0.31), leg(0.1, 0.175, -0.43),
             0.05 * limbs, 0.032 * limbs, "left_hindleg", chain="left_hindleg"),
        Bone("left_metatarsus", "left_shin", leg(0.1, 0.175, -0.43), leg(0.1, 0.05, -0.41),
             0.032 * limbs, 0.031 * limbs, "left_hindleg", chain="left_hindleg"),
        Bone("left_hind_paw", "left_metatarsus", leg(0.1, 0.04, -0.405),
             leg(0.1, 0.034, -0.405, 0.055 * paws), 0.037 * limbs, 0.034 * limbs,
             "left_hindleg", chain="left_hindleg"),
    ]  # fmt: skip
    return both_sides(bones)


QUADRUPED = Maker(_SPECIES, _DEFAULTS, _POSES, _bones)
