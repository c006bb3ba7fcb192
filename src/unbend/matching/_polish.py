"""Register the best candidates on the full meshes, and leave out what only one shape has."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from unbend._arrays import snap
from unbend._parallel import run_all
from unbend._types import BoolArray, FloatArray
from unbend.matching import _constants as constants
from unbend.matching._partners import keep_matched
from unbend.matching._plan import MEDIUM, Sides, precompute
from unbend.matching._registration import Registered, lift, limited, register
from unbend.matching._score import FLOOR, Candidate, nearly_as_good, ranked, scored, unexplained
from unbend.matching._shape import Shape
from unbend.mesh import measure_corners, minimum_cut

_PASSES = 3  # over the data weights
# Share of a patch that is not explained, from which on it may be of a part that only one shape
# has. The outline counts as a strip of a patch's radius of which nothing is explained but that.
_UNLIKE = 0.35
# Share of the area. Tails and ears of two animals may be as unlike as what only one has.
_SMALLEST_EXTRA, _LARGEST_EXTRA = 0.08, 0.5
_UNIT = 1e-7  # of areas, of a minimum cut


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


def without_extras(
    sides: Sides, ranks: list[Candidate], may_lack: Sequence[bool]
) -> list[Candidate]:
    """Leave out what only one of the shapes has, if the first candidate shows any, and rank again.

    Until then the best map is the one that hides such a part best. It stays the first if another is
    hardly better: wrong maps leave out what does not fit, too. ``may_lack`` says whether the
    source, and the target, may lack what the other has.
    """
    if not any(may_lack) or (first := _without(sides, may_lack, ranks[0])) is ranks[0]:
        return ranks
    others = ranks[1 : constants.BEAM]
    cut = run_all(functools.partial(_without, sides, may_lack, one) for one in others)
    found = ranked([first, *cut, *ranks[constants.BEAM :]])
    if nearly_as_good(first, found[0]):
        found.sort(key=lambda one: one is not first)
    return found


def _without(sides: Sides, may_lack: Sequence[bool], candidate: Candidate) -> Candidate:
    """Leave out such parts of a candidate between the finer proxies; it itself if it has none."""
    shapes = as_taken(sides, candidate).at(MEDIUM)
    if (rough := _cut_off(*shapes, candidate.registered, may_lack)) is None:
        return candidate
    (found,) = register(*shapes, [rough], constants.DATA_WEIGHTS[2:], constants.STEPS)
    left = _cut_off(*shapes, found, may_lack)
    return candidate if left is None else scored(*shapes, left, candidate.reflected)


def _cut_off(
    source: Shape, target: Shape, found: Registered, may_lack: Sequence[bool]
) -> Registered | None:
    """Find such parts anew, and leave them out; None if there are none."""
    poses = found.source, found.target
    ours, theirs = (one.without(np.zeros_like(one.overlap)) for one in poses)
    shares = unexplained(source, target, found._replace(source=ours, target=theirs))
    mine, other = (
        _extra(shape, share) & lacks
        for shape, share, lacks in zip((source, target), shares, may_lack[::-1], strict=True)
    )
    if not (mine.any() or other.any()):
        return None
    return found._replace(source=found.source.without(mine), target=found.target.without(other))


def _extra(shape: Shape, shares: FloatArray) -> BoolArray:
    """Vertices (n,) whose patches are explained so badly that leaving them out pays."""
    gains = shape.areas * (shares - _UNLIKE)
    if shape.areas @ (gains > 0) < _SMALLEST_EXTRA:
        return np.zeros(len(shares), dtype=bool)
    # An outline that parts a corner from the two others leads through the middles of two sides.
    sides = np.sqrt(measure_corners(shape.vertices, shape.faces)[1])
    lengths = np.tile((sides.sum(axis=1, keepdims=True) / 4 - sides / 2).ravel(), 2)
    ends = [shape.faces[:, [1, 2, 0]].ravel(), shape.faces[:, [2, 0, 1]].ravel()]
    links = np.stack([np.concatenate(ends), np.concatenate(ends[::-1])])
    costs = _UNLIKE * constants.PATCH * np.maximum(lengths, 0)
    found = minimum_cut(gains, links, costs, _UNIT)
    return np.asarray(found & (_SMALLEST_EXTRA <= shape.areas @ found <= _LARGEST_EXTRA))


def with_partners(candidate: Candidate, sides: Sides, least: float) -> Candidate:
    """Give vertices a partner, or none, as most around them have.

    Only patches that end at a boundary of the other shape have none, what only one shape has, and
    what leads there; and only if they are more than the share `least` of the area.
    """
    found = candidate.registered
    ours, theirs = sides.source.shape, sides.target.shape
    poses = []
    for shape, goal, way in ((ours, theirs, found), (theirs, ours, found.back())):
        pose, other, point_map = way.source, way.target, way.forward
        overlap = _as_most_around(shape, pose.overlap)[:, None]
        edges = shape.edge + goal.edge
        near = edges, max(constants.PATCH, edges)
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
