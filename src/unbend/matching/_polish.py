"""From the proxies to the shapes themselves: the polish, and who has a partner at all."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from unbend._arrays import snap
from unbend._parallel import run_all
from unbend._types import BoolArray
from unbend.matching import _constants as constants
from unbend.matching._partners import keep_matched
from unbend.matching._plan import MEDIUM, Sides, precompute
from unbend.matching._registration import Registered, lift, limited, register
from unbend.matching._score import FLOOR, Candidate, nearly_as_good, ranked, scored
from unbend.matching._shape import Shape

_PASSES = 3  # over the data weights


def as_taken(sides: Sides, candidate: Candidate) -> Sides:
    """Take the target as a candidate does: as it is, or as its mirror image."""
    return sides if candidate.reflected == sides.turned else sides.reflected()


def refined(sides: Sides, candidate: Candidate, *, polish: bool = True) -> Candidate:
    """Bring a candidate from the proxies to the shapes themselves, and register these.

    For whole shapes data weights rise several times over: what had slid while shapes were soft
    returns when they are stiff again. Parts would drift.
    """
    sides = as_taken(sides, candidate)
    ours, theirs = sides.source.shape, sides.target.shape
    proxies = sides.source.proxies[MEDIUM], sides.target.proxies[MEDIUM]
    found = lift(candidate.registered, *proxies, ours, theirs)
    if polish:
        data_weights = limited(ours, theirs, constants.DATA_WEIGHTS[4:], constants.EDGES)
        run_all(functools.partial(precompute, one, data_weights) for one in (ours, theirs))
        for _ in range(1 if sides.partial else _PASSES):
            (found,) = register(ours, theirs, [found], data_weights, constants.STEPS // 2)
    return scored(ours, theirs, found, candidate.reflected)


def exact(sides: Sides, candidate: Candidate) -> Candidate:
    """Map every vertex of the shapes themselves to what is closest, with little regard to normals.

    Normals keep a leg from catching the leg beside it, and tell candidates apart. But they differ
    between two meshes of one surface, so that a finished map is more exact when they count little.
    """
    sides = as_taken(sides, candidate)
    ours, theirs = sides.source.shape, sides.target.shape
    (found,) = register(
        ours, theirs, [candidate.registered], (), 0, normal_weight=constants.NORMAL_WEIGHTS[1]
    )
    return scored(ours, theirs, found, candidate.reflected)


def reranked(
    sides: Sides, ranks: list[Candidate], *, polish: bool = True
) -> tuple[list[Candidate], dict[Candidate, Candidate]]:
    """Re-rank candidates of nearly the same cost on the full meshes, unless there is no polish.

    The ranking stays if either shape is partial and the bodies differ so much that registration on
    the full meshes explains less than on the proxies. Energies of those that are re-ranked are
    scaled so that the former best keeps its own. What :func:`refined` makes of some comes second,
    of the best at least.
    """
    most = constants.BEAM // 2 if polish else 1
    nearly = [one for one in ranks[:most] if nearly_as_good(one, ranks[0])]
    fine = run_all(functools.partial(refined, sides, one, polish=polish) for one in nearly)
    if len(nearly) == 1 or (sides.partial and min(one.energy for one in fine) > ranks[0].energy):
        return ranks, dict(zip(nearly, fine, strict=True))
    unit = ranks[0].energy / max(fine[0].energy, FLOOR)
    known = {
        replace(rough, energy=unit * one.energy): one
        for rough, one in zip(nearly, fine, strict=True)
    }
    return ranked([*known, *ranks[len(nearly) :]]), known


def with_partners(candidate: Candidate, sides: Sides, least: float) -> Candidate:
    """Give vertices a partner, or none, as most around them have.

    Only patches that end at a boundary of the other shape have none, what only one shape has, and
    what leads there; and only if they are more than the share `least` of the area.
    """
    found = candidate.registered
    ours, theirs = sides.source.shape, sides.target.shape
    poses = []
    for pose, other, shape, goal, point_map in (
        (found.source, found.target, ours, theirs, found.forward),
        (found.target, found.source, theirs, ours, found.backward),
    ):
        overlap = _as_most_around(shape, pose.overlap)[:, None]
        near = shape.edge + goal.edge  # maps are no longer rough
        size, maps = np.array([pose.size]), point_map[:, None]
        overlap = keep_matched(shape, goal, overlap, size, maps, near)[:, 0]
        extra = pose.extra | np.broadcast_to(other.extra, len(goal.areas))[point_map]
        overlap &= ~_as_most_around(shape, extra)
        none = float(shape.areas @ ~overlap)
        poses.append(pose._replace(overlap=overlap if none > least else np.ones_like(overlap)))
    return replace(candidate, registered=Registered(*found[:2], *poses))


def _as_most_around(shape: Shape, overlap: BoolArray) -> BoolArray:
    """Decide by majority with the neighbours: the outline of an overlap is ragged."""
    neighbors, share = shape.edge_weights != 0, overlap.astype(np.float64)
    share = (share + neighbors @ share) / (1 + np.diff(neighbors.indptr))
    return np.asarray(snap(share) > 0.5)
