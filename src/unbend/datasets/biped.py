"""Two-legged, human-like figures."""

from __future__ import annotations

from collections.abc import Mapping

from unbend.datasets._skeleton import Bone, Point, Pose, both_sides, pose_of
from unbend.datasets.shape import Maker, Shape, make_shape

_SPECIES: dict[str, dict[str, float]] = {
    "human": {},
    "child": {"legs": 0.72, "arms": 0.72, "torso": 0.78, "head": 1.02, "girth": 0.88},
    "ape": {"legs": 0.66, "arms": 1.3, "torso": 1.02, "head": 1.0, "girth": 1.25},
}
_DEFAULTS = dict.fromkeys(("legs", "arms", "torso", "head", "girth", "hands", "limbs"), 1.0)

# Degrees about x (positive: the top goes forward, a leg backward), y (to the left) and z.
_POSES: dict[str, Pose] = {
    "standing": pose_of(upper_arm=(0, 0, -26), forearm=(-8, -6, 4), thigh=(0, 0, -3)),
    "spread": pose_of(upper_arm=(0, 0, 42), thigh=(0, 0, 8)),
    "walking": pose_of(
        left_upper_arm=(26, 0, -24), right_upper_arm=(-30, 0, 24), left_forearm=(-12, -9, 0),
        right_forearm=(-22, 17, 0), left_thigh=(-26, 0, -3), left_shin=8, left_foot=-8,
        right_thigh=(20, 0, 3), right_shin=24, right_foot=14, chest=(2, -8, 0), head=(0, 4, 0),
    ),
    "running": pose_of(
        pelvis=8, waist=(4, 4, 0), chest=(4, 8, 0), head=(-10, -6, 0), left_upper_arm=(-44, 0, -24),
        right_upper_arm=(46, 0, 26), left_forearm=(-58, -42, 0), right_forearm=(-56, 40, 0),
        left_thigh=(26, 0, -3), left_shin=52, left_foot=24, right_thigh=(-54, 0, 3), right_shin=58,
        right_foot=-6,
    ),
    "sitting": pose_of(
        waist=-2, chest=4, upper_arm=(-22, 0, -24), forearm=(-38, -28, 0), thigh=(-82, 0, 2),
        shin=82,
    ),
    "squatting": pose_of(
        pelvis=22, waist=8, chest=6, head=-22, thigh=(-86, 12, 4), shin=82, foot=-16,
        upper_arm=(-64, 0, -16), forearm=(-16, -12, 0),
    ),
    "waving": pose_of(
        left_upper_arm=(-6, 0, 52), left_forearm=(0, 0, 68), left_hand=(0, 0, 8),
        right_upper_arm=(0, 0, 26), chest=(0, 0, -4), head=(0, 8, -4),
    ),
    "kicking": pose_of(
        pelvis=(-10, 10, 0), chest=6, left_thigh=-72, left_shin=10, left_foot=14,
        right_thigh=(8, 0, 6), right_shin=6, left_upper_arm=(16, 14, 16),
        right_upper_arm=(-44, 14, -10), forearm=(-22, -18, 0), head=(12, -8, 0),
    ),
    "lunging": pose_of(
        left_thigh=(-60, 0, 2), left_shin=58, right_thigh=(34, 0, 4), right_shin=6, right_foot=-24,
        upper_arm=(0, 0, 44), chest=(0, 16, 0), waist=(0, 8, 0), head=(0, -10, 0),
    ),
    "bowing": pose_of(
        pelvis=26, waist=16, chest=14, neck=8, head=8, thigh=(-26, 0, -3), upper_arm=(-20, 0, -24),
        forearm=(-8, -6, 0),
    ),
    "dancing": pose_of(
        waist=(0, 8, 6), chest=(-4, 10, 8), head=(0, -8, -8), left_upper_arm=(0, -12, 66),
        left_forearm=(-22, -26, 22), right_upper_arm=(0, -18, -26), right_forearm=(-24, 24, 0),
        left_thigh=(-38, -24, 22), left_shin=76, left_foot=24, right_thigh=(0, 0, 8),
    ),
}  # fmt: skip


def make_biped(
    pose: str | Pose | None = "standing",
    *,
    n_vertices: int = 5000,
    species: str = "human",
    meshing: int = 0,
    random_state: int | None = None,
    **proportions: float,
) -> Shape:
    """Make a two-legged figure: human, child, ape, or one of your own proportions.

    Parameters
    ----------
    pose : str, mapping, or None, default="standing"
        "standing", "spread", "walking", "running", "sitting", "squatting", "waving", "kicking",
        "lunging", "bowing" or "dancing"; or as for :func:`make_quadruped`.
    species : str, default="human"
        "human", "child" or "ape".
    n_vertices, meshing, random_state
        See :func:`make_quadruped`.
    **proportions : float
        Factors on the species' proportions: ``legs``, ``arms``, ``torso``, ``head``,
        ``girth``, ``hands``, ``limbs`` (how thick arms and legs are). From about 0.7 to 1.4 of
        the species' own they look natural.

    Returns
    -------
    Shape
        A human is 1.7 units (metres) tall.

    Raises
    ------
    InputError
        As for :func:`make_quadruped`.

    See Also
    --------
    make_quadruped, make_octopus, rest_map

    Examples
    --------
    >>> from unbend.datasets import make_biped
    >>> shape = make_biped("walking", n_vertices=600)
    >>> shape.mesh
    Mesh(600 vertices, 1196 faces)
    >>> bool((shape.mirror[shape.mirror] == range(600)).all())
    True
    """
    return make_shape(BIPED, pose, n_vertices, species, meshing, random_state, proportions)


def _bones(p: Mapping[str, float]) -> list[Bone]:
    girth, head, torso = p["girth"], p["head"], p["torso"]
    crotch = 0.9 * p["legs"]
    wide = 0.5 + 0.5 * girth
    limb = wide * p["limbs"]

    def trunk(x: float, y: float, z: float) -> Point:
        return (x * girth, crotch + (y - 0.9) * torso, z)

    def leg(x: float, y: float, z: float) -> Point:
        return (x * girth, y * p["legs"], z)

    shoulder = trunk(0.175, 1.375, -0.01)

    def arm(x: float, y: float, z: float) -> Point:
        s = p["arms"]
        return (shoulder[0] + s * (x - 0.175), shoulder[1] + s * (y - 1.375), z)

    top = trunk(0, 1.5, 0)[1]

    def face(x: float, y: float, z: float) -> Point:
        return (x * head, top + (y - 1.5) * head, z * head)

    flat, palm = (0.0, 0.0, 1.42), (1.25, 1.0, 0.0)
    hand = p["hands"]
    left = [
        Bone("pelvis", None, trunk(0, 0.93, 0), trunk(0, 1.0, 0), 0.158 * girth, 0.155 * girth,
             "torso", flat, "spine"),
        Bone("waist", "pelvis", trunk(0, 1.0, 0), trunk(0, 1.13, 0), 0.155 * girth, 0.14 * girth,
             "torso", flat, "spine"),
        Bone("chest", "waist", trunk(0, 1.13, 0), trunk(0, 1.31, -0.005), 0.14 * girth,
             0.168 * girth, "torso", flat, "spine"),
        Bone("left_collar", "chest", trunk(0.06, 1.375, -0.015), trunk(0.15, 1.38, -0.01),
             0.062 * girth, 0.06 * wide, "torso"),
        Bone("neck", "chest", trunk(0, 1.40, -0.015), face(0, 1.53, 0.005), 0.06 * wide,
             0.054 * wide, "head"),
        Bone("head", "neck", face(0, 1.585, 0), face(0, 1.64, -0.004), 0.088 * head, 0.1 * head,
             "head", (1.2, 0, 0)),
        Bone("jaw", "head", face(0, 1.575, 0.03), face(0, 1.535, 0.065), 0.06 * head,
             0.034 * head, "head"),
        Bone("nose", "head", face(0, 1.61, 0.085), face(0, 1.585, 0.104), 0.013 * head,
             0.019 * head, "head"),
        Bone("left_ear", "head", face(0.082, 1.60, -0.01), face(0.09, 1.625, -0.02), 0.024 * head,
             0.03 * head, "head", (1.7, 0, 0.4)),
        Bone("left_upper_arm", "left_collar", arm(0.175, 1.375, -0.01), arm(0.36, 1.16, -0.015),
             0.06 * limb, 0.044 * limb, "left_arm", chain="left_arm"),
        Bone("left_forearm", "left_upper_arm", arm(0.36, 1.16, -0.015), arm(0.53, 0.955, 0.005),
             0.046 * limb, 0.031 * limb, "left_arm", chain="left_arm"),
        Bone("left_hand", "left_forearm", arm(0.545, 0.935, 0.01), arm(0.585, 0.885, 0.012),
             0.042 * hand, 0.046 * hand, "left_arm", palm),
        Bone("left_fingers", "left_hand", arm(0.585, 0.885, 0.012), arm(0.637, 0.818, 0.012),
             0.046 * hand, 0.03 * hand, "left_arm", palm),
        Bone("left_thumb", "left_hand", arm(0.552, 0.925, 0.03), arm(0.585, 0.895, 0.085),
             0.022 * hand, 0.018 * hand, "left_arm"),
        Bone("left_thigh", "pelvis", leg(0.085, 0.9, 0), leg(0.125, 0.5, 0.012), 0.098 * girth,
             0.062 * limb, "left_leg", chain="left_leg"),
        Bone("left_shin", "left_thigh", leg(0.125, 0.5, 0.012), leg(0.15, 0.1, -0.025),
             0.062 * limb, 0.037 * limb, "left_leg", chain="left_leg"),
        Bone("left_calf", "left_shin", leg(0.128, 0.4, -0.018), leg(0.138, 0.27, -0.022),
             0.05 * limb, 0.04 * limb, "left_leg"),
        Bone("left_foot", "left_shin", leg(0.15, 0.055, -0.04), leg(0.165, 0.04, 0.08),
             0.042 * p["limbs"], 0.04 * p["limbs"], "left_leg"),
        Bone("left_toes", "left_foot", leg(0.165, 0.04, 0.08), leg(0.17, 0.034, 0.145),
             0.042 * p["limbs"], 0.032 * p["limbs"], "left_leg"),
    ]  # fmt: skip
    return both_sides(left)


BIPED = Maker(_SPECIES, _DEFAULTS, _POSES, _bones)
