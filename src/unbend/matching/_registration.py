"""Registration: deform each shape onto the other as rigidly as possible, from a rough map.

A map through smooth functions slides a little along featureless parts. Deforming the shapes takes
the slide out (Sorkine & Alexa, "As-rigid-as-possible surface modeling", SGP 2007).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from unbend._parallel import run_all
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.alignment import Motions, OrientedSurface, nearest_pairs
from unbend.deformation import normals_into, scatter, walk
from unbend.matching import _constants as constants
from unbend.matching._partners import cycle_consistent, keep_matched
from unbend.matching._search import spectral_weights
from unbend.matching._shape import Proxy, Shape

_LEAST_SIZE = 0.05  # of one shape's lengths in the other's pose: less is collapse
_NEAR = constants.LIMB, constants.LIMB  # to a boundary; what moves is not there yet
_POSITIONS = [0, 1, 2, 6, 7, 8]  # columns of the rows in which closest points are sought


class Pose(NamedTuple):
    """A shape on its way into another's pose.

    What is extra is of a part that the other shape has not, and has no partner, whatever boundaries
    there are. Nor has what lies beyond the boundary of a partial shape.
    """

    places: FloatArray  # (n, 3)
    rotations: FloatArray  # (n, 3, 3), how the neighbourhood of each vertex is turned
    overlap: BoolArray  # (n,) whether a vertex has a partner
    size: float = 1.0  # how much longer things are in the pose
    extra: BoolArray | bool = False  # (n,)

    def without(self, extra: BoolArray) -> Pose:
        """Leave a part (n,) out, instead of any that was."""
        return self._replace(overlap=(self.overlap | self.extra) & ~extra, extra=extra)


class Registered(NamedTuple):
    """Two shapes, each in the other's pose, and the maps between them."""

    forward: IntArray  # the target vertex of each source vertex
    backward: IntArray
    source: Pose  # in the target's pose
    target: Pose

    def back(self) -> Registered:
        """Return the same, of the target to the source."""
        return Registered(self.backward, self.forward, self.target, self.source)


def rough_start(source: Shape, target: Shape, functional_map: FloatArray) -> Registered:
    """Poses and maps as a functional map (k, k) knows them, which may be of few functions.

    ``source.basis[:, :k] @ functional_map`` corresponds to ``target.basis[:, :k]``.
    """
    k = len(functional_map)
    weights = spectral_weights(source.eigenvalues, target.eigenvalues, k)
    left = source.basis[:, :k] @ functional_map * weights
    pairs = nearest_pairs(left[None], target.basis[:, :k] * weights)
    ways = (source, target, functional_map), (target, source, functional_map.T)
    poses = run_all(functools.partial(_smooth_pose, *way) for way in ways)
    return Registered(pairs.forward[0], pairs.backward[0], *poses)


def mapped_start(
    source: Shape,
    target: Shape,
    forward: IntArray,
    backward: IntArray,
    size: float,
    *,
    inside: bool = False,
) -> Registered:
    """Poses that maps between vertices lead to; parts are taken to be so much longer on target.

    With ``inside``, what is led to a boundary has no partner.
    """
    if not (source.partial or target.partial):
        size = 1.0
    ours = _placed(source, target, forward, size)
    theirs = _placed(target, source, backward, 1 / size)
    if inside:
        ours = ours._replace(overlap=~target.on_boundary[forward])
        theirs = theirs._replace(overlap=~source.on_boundary[backward])
    return Registered(forward, backward, ours, theirs)


def laid_maps(
    source: OrientedSurface, target: OrientedSurface, motions: Motions
) -> list[tuple[IntArray, IntArray]]:
    """Map to what is nearest after each motion and faces the same way, forward and backward."""
    weight = constants.NORMAL_WEIGHTS[0]
    facing = np.einsum("hij,nj->hni", motions.rotations, source.normals)
    pairs = nearest_pairs(
        np.concatenate([motions.moved(source.points), weight * facing], axis=2),
        np.hstack([target.points, weight * target.normals]),
    )
    return list(zip(pairs.forward, pairs.backward, strict=True))


def laid_starts(
    source: Shape, target: Shape, maps: Sequence[tuple[IntArray, IntArray]], motions: Motions
) -> list[Registered]:
    """Poses that motions of the shapes as they stand lead to, with their maps."""
    back = motions.inverse()
    there, here = motions.moved(source.vertices), back.moved(target.vertices)
    return [
        Registered(
            forward,
            backward,
            _laid(there[i], motions, i, ~target.on_boundary[forward]),
            _laid(here[i], back, i, ~source.on_boundary[backward]),
        )
        for i, (forward, backward) in enumerate(maps)
    ]


def _laid(places: FloatArray, motions: Motions, i: int, overlap: BoolArray) -> Pose:
    rotations = np.tile(motions.rotations[i], (len(places), 1, 1))
    return Pose(places, rotations, overlap, float(motions.sizes[i]))


def _placed(shape: Shape, goal: Shape, point_map: IntArray, size: float) -> Pose:
    """Pose of vertices at the images that a map gives, averaged over patches."""
    both = np.hstack([shape.vertices, goal.vertices[point_map]])
    averaged = shape.averaged(shape.areas[:, None] * both, 2 * constants.PATCH)
    rest, places = (np.ascontiguousarray(one) for one in np.hsplit(averaged, 2))
    rotations = shape.fit_rotations(places, rest)
    return Pose(places, rotations, np.ones(len(places), dtype=bool), size)


def lift(found: Registered, source: Proxy, target: Proxy, ours: Shape, theirs: Shape) -> Registered:
    """Carry a registration of two proxies over to the shapes that they stand for."""
    return Registered(
        target.kept[found.forward[source.parents]],
        source.kept[found.backward[target.parents]],
        _lifted(found.source, source, ours),
        _lifted(found.target, target, theirs),
    )


def limited(
    source: Shape, target: Shape, data_weights: Sequence[float], edges: float = 1.0
) -> tuple[float, ...]:
    """Limit data weights, if either shape is partial, to those that act over so many edges or more.

    Larger ones fit the rounding of maps to vertices, and boundaries follow that.
    """
    if not (source.partial or target.partial):
        return tuple(data_weights)
    most = 1 / (edges * max(source.edge, target.edge)) ** 2
    return tuple(dict.fromkeys(min(data_weight, most) for data_weight in data_weights))


def register(
    source: Shape,
    target: Shape,
    starts: Sequence[Registered],
    data_weights: Sequence[float],
    steps: int,
    *,
    resize: bool = True,
    normal_weight: float = constants.NORMAL_WEIGHTS[0],
) -> list[Registered]:
    """Deform two shapes onto each other: so many steps for each data weight, then closest points.

    Each start is gone on with by itself, side by side, and is not changed. Data weights rise, and
    are :func:`limited`. ``resize`` says whether a part's size, next to the other shape's, is found
    anew in every step; ``normal_weight`` how much normals count for which points are closest.
    """
    if not starts:
        return []
    ours = _Moving(source, starts, normal_weight)
    theirs = _Moving(target, [one.back() for one in starts], normal_weight)
    ways = (ours, theirs), (theirs, ours)
    for data_weight in limited(source, target, data_weights):
        for _ in range(steps):
            run_all(functools.partial(one.step, data_weight, other) for one, other in ways)
            if resize and (source.partial or target.partial):
                ours.size = np.sqrt(ours.stretch() / theirs.stretch())
                theirs.size = 1 / ours.size
            _find_closest(ours, theirs)
    ours.ahead, theirs.ahead = ours.places, theirs.places
    for _ in range(2):
        _find_closest(ours, theirs)
    for one, other in ways:
        if other.shape.partial:
            one.keep_matched(one.beyond(other) > constants.SLACK * other.shape.edge, other)
    return [
        Registered(
            ours.partners[:, i].copy(), theirs.partners[:, i].copy(), ours.pose(i), theirs.pose(i)
        )
        for i in range(len(starts))
    ]


def landing_places(
    source: Shape, target: Shape, found: Registered
) -> tuple[FloatArray, FloatArray]:
    """Positions of either shape's vertices, (n, 6) and (m, 6), at rest and posed, to compare."""
    ours = np.hstack([found.source.places, source.vertices])
    return ours, np.hstack([target.vertices, found.target.places])


class _Moving:
    """A shape in poses side by side, and its partners on the other shape, its goal.

    What belongs to a pose has an axis for them after that of the vertices. `ahead` is where the
    last step leads to.
    """

    def __init__(self, shape: Shape, starts: Sequence[Registered], normal_weight: float) -> None:
        self.shape, self.normal_weight = shape, normal_weight
        self.partners = np.stack([one.forward for one in starts], axis=1)
        poses = [one.source for one in starts]
        self.places = self.ahead = np.stack([one.places for one in poses], axis=1)
        self.rotations = np.stack([one.rotations for one in poses], axis=1)
        self.overlap = np.stack([one.overlap for one in poses], axis=1)
        self.size = np.array([one.size for one in poses])
        n = len(shape.vertices)
        self.extra = np.stack([np.broadcast_to(one.extra, n) for one in poses], axis=1)
        self.resting = np.hstack([shape.vertices, normal_weight * shape.normals])
        self.covariances: FloatArray  # of the last step

    def step(self, data_weight: float, other: _Moving) -> None:
        """Draw the shape to where the maps to and from the goal say, then turn neighbourhoods."""
        shape, goal = self.shape, other.shape
        # Both directions pull, each with the whole area: twice a vertex's own on average. A pull to
        # where the vertex is makes up the difference, so that the system stays the same.
        own = shape.areas[:, None] * self.overlap
        force = own[..., None] * goal.vertices[self.partners]
        drawn, total = scatter(
            other.partners, goal.areas[:, None] * other.overlap, goal.vertices, len(shape.vertices)
        )
        force += drawn + (2 * shape.areas[:, None] - own - total)[..., None] * self.ahead
        if len(shape.landmarks):
            self.draw_landmarks(force, goal)
        before = self.places
        self.places, _, self.covariances = shape.step(
            shape.system(2 * data_weight), data_weight * force, self.rotations, self.size
        )
        self.ahead = self.places + constants.MOMENTUM * (self.places - before)

    def draw_landmarks(self, force: FloatArray, goal: Shape) -> None:
        """Draw what is around landmarks as far as they are off their partners, up to a limb."""
        shape = self.shape
        each, twice = np.arange(len(shape.landmarks))[:, None], 2 * shape.areas[:, None, None]
        near = goal.landmark_distances[each, self.partners[shape.landmarks]] < constants.LIMB
        share = shape.landmark_surroundings[..., None] * near[:, None]
        share /= np.maximum(share.sum(axis=0), 1)
        off = goal.vertices[goal.landmarks][:, None] - self.ahead[shape.landmarks]
        force += share.sum(axis=0)[..., None] * (twice * self.ahead - force)
        force += twice * np.einsum("lnp,lpi->npi", share, off)

    def stretch(self) -> FloatArray:
        """Median over what has partners of how much longer things are than at rest."""
        shape = self.shape
        stretched = np.einsum("...ba,...ab->...", self.rotations, self.covariances)
        ratio = np.maximum(stretched / shape.patch_sizes[:, None], _LEAST_SIZE)
        order = np.argsort(ratio, axis=0)
        weights = shape.areas[:, None] * self.overlap
        share = np.cumsum(np.take_along_axis(weights, order, axis=0), axis=0)
        middle, every = (share < share[-1] / 2).sum(axis=0), np.arange(share.shape[1])
        return np.asarray(ratio[order[middle, every], every])

    def beyond(self, other: _Moving) -> FloatArray:
        """How far vertices lie beyond the goal's boundary, the mean of both poses."""
        goal, forward, every = other.shape, self.partners, np.arange(len(self.size))
        conormals = [goal.conormals_in(other.places[:, i]) / other.size[i] for i in every]
        back = self.shape.vertices[:, None] - other.places[forward, every]
        there = ((self.places - goal.vertices[forward]) * goal.conormals[forward]).sum(axis=-1)
        off = (back * np.stack(conormals, axis=1)[forward, every]).sum(axis=-1)
        return np.asarray(there + off) / 2

    def keep_matched(self, off: BoolArray, other: _Moving) -> None:
        """Say who has a partner: is not off the goal, and does not lead elsewhere."""
        overlap = cycle_consistent(self.shape, self.partners, other.partners) & ~off
        given = self.shape, other.shape, overlap, self.size, self.partners, _NEAR
        self.overlap = keep_matched(*given) & ~self.extra

    def pose(self, i: int) -> Pose:
        """One of the poses."""
        places, rotations = (np.ascontiguousarray(o[:, i]) for o in (self.places, self.rotations))
        extra = self.extra[:, i].copy()
        return Pose(places, rotations, self.overlap[:, i].copy(), float(self.size[i]), extra)

    def rows(self, ahead: int, rest: int) -> FloatArray:
        """Positions and normals ahead and at rest, (n, poses, 12), from two of the columns on."""
        rows = np.empty((*self.ahead.shape[:2], 12))
        rows[..., ahead : ahead + 3] = self.ahead
        normals_into(rows, ahead + 3, self.ahead, self.shape.faces, *self.shape.fans)
        rows[..., ahead + 3 : ahead + 6] *= self.normal_weight
        rows[..., rest : rest + 6] = self.resting[:, None]
        return rows


def _find_closest(ours: _Moving, theirs: _Moving) -> None:
    """Make partners of points of either shape that are close to the other's in both poses."""
    left, right = run_all([lambda: ours.rows(0, 6), lambda: theirs.rows(6, 0)])
    ours.partners, theirs.partners = run_all(
        [lambda: _walked(ours, theirs, left, right), lambda: _walked(theirs, ours, right, left)]
    )
    # By position alone: where a surface ends, normals lead to what is not at its end.
    if ours.shape.partial or theirs.shape.partial:
        left, right = (np.ascontiguousarray(rows[..., _POSITIONS]) for rows in (left, right))
    if theirs.shape.partial:
        nearest = _walked(ours, theirs, left, right)
        ours.keep_matched(theirs.shape.on_boundary[nearest], theirs)
    if ours.shape.partial:
        nearest = _walked(theirs, ours, right, left)
        theirs.keep_matched(ours.shape.on_boundary[nearest], ours)


def _walked(one: _Moving, other: _Moving, left: FloatArray, right: FloatArray) -> IntArray:
    return walk(left, right, one.partners, one.shape.edge_weights, other.shape.edge_weights)


def _smooth_pose(shape: Shape, goal: Shape, functional_map: FloatArray) -> Pose:
    k = len(functional_map)
    basis = shape.basis[:, :k]
    places = basis @ (functional_map @ goal.position_coefficients[:k])
    rotations = shape.fit_rotations(places, basis @ shape.position_coefficients[:k])
    return Pose(places, rotations, np.ones(len(places), dtype=bool))


def _lifted(pose: Pose, proxy: Proxy, shape: Shape) -> Pose:
    parents, rotations = proxy.parents, pose.rotations[proxy.parents]
    offsets = shape.vertices - proxy.shape.vertices[parents]
    places = pose.places[parents] + pose.size * np.einsum("nij,nj->ni", rotations, offsets)
    extra = np.broadcast_to(pose.extra, len(pose.places))[parents]
    return Pose(places, rotations, pose.overlap[parents], pose.size, extra)
