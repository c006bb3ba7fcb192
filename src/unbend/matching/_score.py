"""The score of a map, and the probability that it is right."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from scipy.spatial import cKDTree

from unbend._arrays import unit_vectors
from unbend._parallel import run_all
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.alignment import largest_traces
from unbend.deformation import closest_faces, edge_squares
from unbend.matching import _constants as constants
from unbend.matching._registration import Registered, landing_places
from unbend.matching._shape import Shape
from unbend.mesh import vertex_normals

_PATCH_VERTICES, _CROWDED = 6, 3.0
# Share of a rotation's motion that shows. The least of a pot's is up to 0.06, and with a handle at
# least 0.1; that of animals, people, faces and bones is 0.17 or more.
_SHOWN = 0.1
_UNITS, _DOUBT = 30.0, 10.0  # ratio of areas from which on units differ, and of odds at most
_NO_INERTIA = 1e-12  # of all of it: a needle has less about its axis, of which rounding is left
FLOOR = 10.0**-constants.DIGITS  # of costs: less is rounding


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pair of maps between two shapes, registered and scored.

    The energy is the share of local shape that the maps leave unexplained, the mean of both
    directions, and what the vertices without partner add to it.
    """

    registered: Registered
    energy: float
    orientation: float  # share of the surface right side out, less the rest, in the worse direction
    reflected: bool  # whether the target was taken as its mirror image
    missed: BoolArray  # (l,) which landmarks it leads elsewhere

    @property
    def cost(self) -> float:
        """Energy, and what missed landmarks add to it."""
        return self.energy + constants.MISSED * float(self.missed.sum())


def scored(source: Shape, target: Shape, found: Registered, reflected: bool = False) -> Candidate:
    """Score a registration of two shapes."""
    ahead, back = unexplained(source, target, found)
    overlaps = [source.areas @ found.source.overlap, target.areas @ found.target.overlap]
    left_out = -np.log(np.clip(overlaps, constants.SMALLEST_PART, 1))
    energy = source.areas @ ahead + target.areas @ back + constants.WITHOUT * left_out.sum()
    ways = (source, target, found), (target, source, found.back())
    orientation = min(_right_side_out(*way) for way in ways)
    missed = missed_landmarks(source, target, *found[:2])
    return Candidate(found, float(energy) / 2, orientation, reflected, missed)


def unexplained(source: Shape, target: Shape, found: Registered) -> tuple[FloatArray, FloatArray]:
    """Shares (n,) and (m,) of patches that a registration does not explain, 0 without partner."""
    left, right = landing_places(source, target, found)
    ways = (source, target, left, right, found), (target, source, right, left, found.back())
    ahead, back = run_all(functools.partial(_unexplained_on_faces, *way) for way in ways)
    return ahead, back


def rough_costs(source: Shape, target: Shape, forward: IntArray, backward: IntArray) -> FloatArray:
    """Costs (p,) of maps as they are, (n, p) and (m, p): what registration makes less of."""
    ahead, back = (
        shape.areas @ _unexplained(shape, goal.vertices[maps], np.ones(maps.shape, dtype=bool))
        for shape, goal, maps in ((source, target, forward), (target, source, backward))
    )
    missed = [
        missed_landmarks(source, target, *maps).sum()
        for maps in zip(forward.T, backward.T, strict=True)
    ]
    return np.asarray((ahead + back) / 2 + constants.MISSED * np.array(missed))


def ranked(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Lowest cost first, of those that keep the right side out if any does.

    Of those that a symmetry of the shapes makes equal, which differ by rounding only, the one that
    came first stays first.
    """
    kept = [one for one in candidates if one.orientation > 0]
    return sorted(kept or candidates, key=lambda one: round(one.cost, constants.DIGITS))


def nearly_as_good(one: Candidate, first: Candidate) -> bool:
    """Whether a candidate costs hardly more than the best."""
    return one.cost <= (1 + constants.NEARLY) * max(first.cost, FLOOR)


def lead_shares(
    costs: FloatArray, partial: bool, lead: float = constants.CONFIDENCE[3]
) -> FloatArray:
    """Probability of each of some distinct maps, the least cost first, that no other is right.

    Maps of one cost share it. The fewer features the shapes have, the more of a lead is chance; and
    more of it is if either is partial. What a copy costs says nothing: its coarse meshes differ.
    """
    lead *= constants.PARTIAL_LEAD if partial else 1.0
    lead *= max(1.0, constants.FEATURES / max(costs[min(1, len(costs) - 1)], FLOOR)) ** 2
    shares = np.exp((costs[0] - costs) / (lead * max(costs[0], constants.FEATURES / 2)))
    return np.asarray(shares / shares.sum())


def alike_share(shares: FloatArray, differences: FloatArray) -> float:
    """Add up the probabilities of those of some maps that hardly differ from one of them."""
    return float(shares @ (differences < constants.ALIKE))


def plausibility(
    energy: float, disorder: float, fitted: Sequence[float] = constants.CONFIDENCE[:3]
) -> float:
    """Probability that a finished map moves the surface as one body in two poses moves.

    It falls with the energy of its candidate, and with the disorder that shows on the full meshes.
    """
    even, spread, weight = fitted
    return float(1 / (1 + np.exp((energy + weight * disorder - even) / spread)))


def expected_errors(
    source: Shape, target: Shape, found: Candidate, elsewhere: FloatArray, doubt: float
) -> FloatArray:
    """Bounds (n,) that the errors of a finished map stay below at about nine vertices in ten.

    They grow with the gap to the partner, added up over both poses, with what a patch's shape
    leaves unexplained, with how far other maps that may be right lead ``elsewhere`` (n,), and with
    the ``doubt`` in the map, one less its confidence.
    """
    gap, unlike, other, none = constants.EXPECTED_ERROR
    target = target.reflected() if found.reflected else target
    forward, overlap = found.registered.forward, found.registered.source.overlap
    left, right = landing_places(source, target, found.registered)
    apart = np.linalg.norm((left - right[forward]).reshape(-1, 2, 3), axis=2).sum(axis=1)
    shares = _unexplained_on_faces(source, target, left, right, found.registered)
    errors = gap * apart + unlike * np.sqrt(shares) + other * elsewhere + none * doubt
    return np.where(overlap, errors, np.nan)


def _unexplained_on_faces(
    shape: Shape, goal: Shape, left: FloatArray, right: FloatArray, found: Registered
) -> FloatArray:
    """Shares (n,) of patches that where they land on the goal's faces does not explain."""
    faces, weights = closest_faces(left, right, goal.faces, goal.fans, found.forward)
    images = np.einsum("ij,ijk->ik", weights, goal.vertices[goal.faces[faces]])
    return _unexplained(shape, images, found.source.overlap)


def _unexplained(shape: Shape, images: FloatArray, overlap: BoolArray) -> FloatArray:
    """Shares (n, ...) of patches that their images (n, ..., 3), turned and scaled, do not explain.

    One less the correlation of a patch's edges with their images after the best rotation (Kabsch
    1976), weighted by area; a patch that collapses is not explained at all. What has no partner
    does not count.
    """
    n = len(images)
    common = shape.covariances(images).reshape(n, -1, 9)
    theirs = edge_squares(shape.edge_weights, images).reshape(n, -1, 1)
    own = np.broadcast_to(shape.edge_squares[:, None, None], theirs.shape)
    terms = np.concatenate([common, own, theirs], axis=2) * overlap.reshape(n, -1, 1)
    averaged = shape.averaged(terms, shape.detail)
    cross = np.ascontiguousarray(averaged[..., :9]).reshape(-1, 3, 3)
    size = np.sqrt(np.maximum(averaged[..., 9:].prod(axis=2), np.finfo(float).tiny))
    explained = (largest_traces(cross).reshape(size.shape) / size).reshape(overlap.shape)
    return np.where(overlap, np.maximum(1 - explained, 0), 0)


def missed_landmarks(
    source: Shape, target: Shape, forward: IntArray, backward: IntArray
) -> BoolArray:
    """Tell which landmarks (l,) maps lead to another limb, in either direction."""
    ours, theirs = source.landmarks, target.landmarks
    if not len(ours):
        return np.zeros(0, dtype=bool)
    every = np.arange(len(ours))
    off = np.maximum(
        target.landmark_distances[every, forward[ours]],
        source.landmark_distances[every, backward[theirs]],
    )
    return np.asarray(off > constants.LIMB)


def _right_side_out(shape: Shape, goal: Shape, found: Registered) -> float:
    normals = vertex_normals(found.source.places, shape.faces)
    own = shape.areas * found.source.overlap
    agree = np.sign((normals * goal.normals[found.forward]).sum(axis=1))
    return float(own @ agree / max(own.sum(), np.finfo(float).tiny))


def disorder(source: Shape, target: Shape, found: Candidate) -> float:
    """Measure how far a finished map is from one that can be right: 0 to 2.

    The largest of three shares of the area that has partners: what is turned inside out (twice),
    what does not return, and what lands in crowded patches; in the worse direction.
    """
    one = found.registered
    ways = (source, target, one), (target, source, one.back())
    shares = run_all(functools.partial(_share_in_disorder, *way) for way in ways)
    return float(max(1 - found.orientation, *shares))


def confidence_bound(disorder: float) -> float:
    """Compute the highest confidence, 0 to 1, that the disorder of a finished map allows."""
    orderly, chaotic = constants.DISORDER
    return float(np.clip((chaotic - disorder) / (chaotic - orderly), 0, 1))


def in_one_unit(confidence: float, ratio: float) -> float:
    """Lower the confidence in a map of parts if one of them has so many times the other's area.

    A small part may be laid onto a larger one that looks like it. Of right maps between shapes in
    one unit, ratios are below 1.7, or 4.2 if they are of two kinds, most of which are sure enough;
    shapes whose ratio is very large are in different units.
    """
    if not 1 / _UNITS < ratio < _UNITS:
        return confidence
    odds = 1 / min(1 + (np.log(ratio) / constants.STRETCH) ** 4, _DOUBT)
    return float(confidence * odds / (1 - confidence + confidence * odds))


def roundness_bound(shape: Shape) -> float:
    """Compute the highest confidence, 0 to 1, that a shape allows whose turn hardly shows.

    What shows of a rotation is its motion across the surface or its boundary: nothing, if a round
    pot turns about its axis (Gelfand & Guibas, "Shape segmentation using local slippage analysis",
    SGP 2004).
    """
    open_shape = replace(shape, partial=True)
    start, end, _ = open_shape.boundary_edges.T
    halves = np.linalg.norm(shape.vertices[end] - shape.vertices[start], axis=1) / 2
    lengths = np.bincount(np.append(start, end), np.tile(halves, 2), len(shape.vertices))
    points, weights = np.tile(shape.vertices, (2, 1)), np.append(shape.areas, lengths)
    points -= weights @ points / weights.sum()
    outward = open_shape.conormals
    if len(start):  # whatever runs in zigzags where faces were left out
        outward = unit_vectors(shape.averaged(lengths[:, None] * outward, constants.LIMB))
    across = np.cross(points, np.vstack([shape.normals, outward]))
    extent = (1 + _NO_INERTIA) * (weights @ (points**2).sum(axis=1))
    inertia = extent * np.eye(3) - (points.T * weights) @ points
    least = scipy.linalg.eigh((across.T * weights) @ across, inertia, eigvals_only=True)[0]
    return float(min(np.sqrt(max(least, 0.0)) / _SHOWN, 1.0))


def _share_in_disorder(shape: Shape, goal: Shape, found: Registered) -> float:
    """Share of the area with partners that does not return, or lands in patches with too much."""
    there, back = found.forward, found.backward
    overlap, goal_overlap = found.source.overlap, found.target.overlap
    off = np.linalg.norm(shape.vertices - shape.vertices[back[there]], axis=1)
    near = max(constants.PATCH, constants.EDGES * max(shape.edge, goal.edge))
    astray = (off > near) | ~goal_overlap[there]
    fewest = min(len(shape.areas), len(goal.areas))
    middles = goal.samples[: max(fewest // _PATCH_VERTICES, 1)]
    patch = cKDTree(goal.vertices[middles]).query(goal.vertices)[1]
    areas, goal_areas = shape.areas * overlap, goal.areas * goal_overlap
    total, goal_total = (max(one.sum(), np.finfo(float).tiny) for one in (areas, goal_areas))
    taken = np.bincount(patch[there], areas, len(middles)) / total
    room = np.bincount(patch, goal_areas, len(middles)) / goal_total
    crowded = (taken > _CROWDED * room)[patch[there]]
    return max(float(areas @ some / total) for some in (astray, crowded))
