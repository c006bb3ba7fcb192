"""What a finished map shows of itself: where it is in disorder it is wrong, however well it fits.

A right map keeps the surface right side out, leads back to where it began, and spreads one shape
over the other evenly. On full meshes right maps have a disorder of less than a tenth.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from unbend._types import BoolArray, IntArray
from unbend.errors import warn
from unbend.matching import _constants as constants
from unbend.matching._judge import Candidate
from unbend.matching._result import Match
from unbend.matching._shape import Shape

# The target is divided into at most so many patches, of at least so many vertices of either shape
# in the mean. A patch is crowded that takes in so many times its own area.
_PATCHES, _PATCH_VERTICES, _CROWDED = 300, 6, 3.0


def confidence_bound(source: Shape, target: Shape, found: Candidate) -> float:
    """Compute the highest confidence, 0 to 1, that a finished map's disorder allows.

    The disorder is the largest of three shares of the area that has partners: what is turned inside
    out (twice), what does not return, and what lands in crowded patches; in the worse direction.
    """
    forward, backward, mine, other = found.registered
    ahead = source, target, forward, backward, mine.within, other.within
    back = target, source, backward, forward, other.within, mine.within
    disorder = max(
        1 - found.orientation,
        *(measure(*way) for measure in (_not_returning, _crowded) for way in (ahead, back)),
    )
    orderly, chaotic = constants.DISORDER
    return float(np.clip((chaotic - disorder) / (chaotic - orderly), 0, 1))


def warn_of_disorder(match: Match) -> None:
    """Warn of a map that cannot be right everywhere."""
    if match.confidence_bound < 1:
        warn(
            "the map is in disorder: in places it turns the surface inside out, crowds it together "
            f"or does not lead back (orientation {match.orientation:+.2f}, confidence at most "
            f"{match.confidence_bound:.2f}); look at it, and give landmarks"
        )


def _not_returning(
    shape: Shape,
    goal: Shape,
    there: IntArray,
    back: IntArray,
    within: BoolArray,
    goal_within: BoolArray,
) -> float:
    """Share of the area with partners that does not return to where it began."""
    off = np.linalg.norm(shape.vertices - shape.vertices[back[there]], axis=1)
    near = max(constants.THIN, constants.EDGES * max(shape.edge, goal.edge))
    lost = (off > near) | ~goal_within[there]
    return _share(shape, lost, within)


def _crowded(
    shape: Shape,
    goal: Shape,
    there: IntArray,
    back: IntArray,
    within: BoolArray,
    goal_within: BoolArray,
) -> float:
    """Share of the area with partners that lands in patches which take in too much."""
    fewest = min(len(shape.areas), len(goal.areas))
    middles = goal.samples[: max(min(_PATCHES, fewest // _PATCH_VERTICES), 1)]
    patch = cKDTree(goal.vertices[middles]).query(goal.vertices)[1]
    taken, room = (
        np.bincount(patches, areas, len(middles)) / max(areas.sum(), np.finfo(float).tiny)
        for patches, areas in (
            (patch[there], shape.areas * within),
            (patch, goal.areas * goal_within),
        )
    )
    return _share(shape, (taken > _CROWDED * room)[patch[there]], within)


def _share(shape: Shape, some: BoolArray, within: BoolArray) -> float:
    areas = shape.areas * within
    return float(areas @ some / max(areas.sum(), np.finfo(float).tiny))
