"""Eight-armed animals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from unbend.datasets._skeleton import Bone, Point, Pose, both_sides, chain_of
from unbend.datasets.shape import Maker, Shape, make_shape

_SPECIES: dict[str, dict[str, float]] = {
    "octopus": {},
    "squid": {"arms": 0.72, "mantle": 1.9, "girth": 0.8, "eyes": 0.85},
}
_DEFAULTS = dict.fromkeys(("arms", "mantle", "girth", "eyes", "limbs"), 1.0)
_N_SEGMENTS = 9
_AZIMUTHS = {1: 22.5, 2: 67.5, 3: 112.5, 4: 157.5}  # of the left arms, degrees from the front


def _curled(bend: Callable[[float, int, int], tuple[float, float]], **others: Point) -> Pose:
    """Make a pose from a rule for the arms, 1 (front) to 4 (back), on the side +1 (left) or -1.

    ``bend(s, arm, side)`` gives droop and turn to the back, in degrees, at share s of an arm.
    """
    pose: dict[str, Sequence[float]] = dict(others)
    for side, word in ((1, "left"), (-1, "right")):
        for arm, azimuth in _AZIMUTHS.items():
            angle = np.deg2rad(azimuth) * side
            axis = np.array([np.cos(angle), 0, -np.sin(angle)])
            for segment in range(_N_SEGMENTS):
                droop, turn = bend(segment / (_N_SEGMENTS - 1), arm, side)
                rotation = Rotation.from_rotvec(np.deg2rad(droop * axis + [0, turn * side, 0]))
                pose[f"{word}_arm_{arm}_{segment + 1}"] = rotation.as_euler("xyz", degrees=True)
    return pose


def _wave(s: float, arm: int, side: int) -> tuple[float, float]:
    phase = 1.7 * arm + (0.9 if side < 0 else 0)
    droop = 26 * (s < 0.2) - 13 * (0.2 < s < 0.6)
    return droop, 15 * np.sin(phase + 5 * s) * (s > 0.1)


def _spiral(s: float, arm: int, side: int) -> tuple[float, float]:
    return 24 * (s < 0.2) - 16 * (0.2 < s < 0.5), side * (6 + 24 * s) * (s > 0.2)


def _reach(s: float, arm: int, side: int) -> tuple[float, float]:
    if arm == 1:
        return -14 * (0.1 < s < 0.7) + 16 * (s > 0.7), 3 * (s < 0.6)
    return _wave(s, arm, side)


# "floating" is the rest pose: arms spread flat like the rays of a star.
_POSES: dict[str, Pose] = {
    "floating": {},
    "crawling": _curled(_wave),
    "resting": _curled(lambda s, arm, side: (30 * (s < 0.2) - 15 * (0.2 < s < 0.6), 9 * s)),
    "swimming": _curled(
        lambda s, arm, side: (34 * (s < 0.2) - 2 + 3 * (arm - 2.5) * s, 2.0), body=(38, 0, 0)
    ),
    "curled": _curled(_spiral, body=(-6, 0, 0)),
    "reaching": _curled(_reach, body=(-8, 0, 0), mantle=(10, 0, 0)),
    "dancing": _curled(
        lambda s, arm, side: (-16 * np.cos(5 * s + arm), 12 * np.sin(4 * s + 2 * arm + side)),
        mantle=(0, 0, 8),
    ),
    "standing": _curled(lambda s, arm, side: (22 * (s < 0.45) - 26 * (s > 0.6), 0.0)),
}


def make_octopus(
    pose: str | Pose | None = "crawling",
    *,
    n_vertices: int = 5000,
    species: str = "octopus",
    meshing: int = 0,
    random_state: int | None = None,
    **proportions: float,
) -> Shape:
    """Make an eight-armed animal: octopus, squid, or one of your own proportions.

    Parameters
    ----------
    pose : str, mapping, or None, default="crawling"
        "floating" (the rest pose), "crawling", "resting", "swimming", "curled", "reaching",
        "dancing" or "standing"; or as for :func:`make_quadruped`, with bones such as ``"arm_1_2"``.
    species : str, default="octopus"
        "octopus" or "squid".
    n_vertices, meshing, random_state
        See :func:`make_quadruped`.
    **proportions : float
        Factors on the species' proportions: ``arms``, ``mantle`` (their lengths),
        ``girth``, ``eyes``, ``limbs`` (how thick the arms are). From about 0.7 to 1.4 of the
        species' own they look natural.

    Returns
    -------
    Shape
        Arms are about 1 unit long.

    Raises
    ------
    InputError
        As for :func:`make_quadruped`.

    See Also
    --------
    make_quadruped, make_biped, rest_map

    Examples
    --------
    >>> from unbend.datasets import make_octopus
    >>> shape = make_octopus("curled", n_vertices=600)
    >>> shape.mesh
    Mesh(600 vertices, 1196 faces)
    >>> bool((shape.mirror[shape.mirror] == range(600)).all())
    True
    """
    return make_shape(OCTOPUS, pose, n_vertices, species, meshing, random_state, proportions)


def _bones(p: Mapping[str, float]) -> list[Bone]:
    girth, mantle, eye = p["girth"], p["mantle"], 0.045 * p["eyes"]
    end = (0.0, 0.36 + 0.34 * mantle, -0.06 - 0.2 * mantle)
    left = [
        Bone("body", None, (0, 0.19, 0), (0, 0.33, 0.01), 0.14, 0.135 * girth, "head"),
        Bone("mantle", "body", (0, 0.36, -0.02), end, 0.135 * girth, 0.205 * girth, "mantle"),
        Bone("left_eye", "body", (0.09 * girth, 0.355, 0.075), (0.115 * girth, 0.38, 0.1), eye,
             eye, "head"),
    ]  # fmt: skip
    share = np.linspace(0, 1, _N_SEGMENTS + 1)
    radii = p["limbs"] * (0.07 - 0.044 * share**0.8)
    for arm, degrees in _AZIMUTHS.items():
        azimuth = np.deg2rad(degrees)
        outward = np.array([np.sin(azimuth), 0, np.cos(azimuth)])
        joints = np.array([0, 0.15, 0]) + (0.1 + 0.95 * p["arms"] * share)[:, None] * outward
        left += chain_of(f"left_arm_{arm}", "body", joints, radii)
    return both_sides(left)


OCTOPUS = Maker(_SPECIES, _DEFAULTS, _POSES, _bones)
