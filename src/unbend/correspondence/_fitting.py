"""Nonrigid registration of a surface to a target, rigid at first, then ever softer.

Vertices are pulled to closest points on faces, found by walking over the surface from the vertices
that the match gives, so a leg is never registered to the leg beside it.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from unbend._parallel import slices
from unbend._types import BoolArray, FloatArray, IntArray, Progress, SparseMatrix
from unbend.alignment import nearest_rotation, procrustes
from unbend.correspondence._projection import (
    Projection,
    Target,
    make_target,
    project,
    project_anywhere,
)
from unbend.deformation import ElasticSurface, scatter
from unbend.linalg.factorization import Factorization
from unbend.mesh import Mesh, edge_ends, face_normals, find_components, vertex_areas, vertex_normals

# Stiffness and pull balance over a length. The match is followed while it shrinks from _RIGID to
# _FIRM, in sqrt(area); then closest points, down to _SOFT edges; in so many steps each.
_RIGID, _FIRM, _SOFT = 0.06, 0.03, 0.02
_MATCH_STEPS, _CLOSEST_STEPS = 12, 30
_PATCH = 0.15  # length in sqrt(area) over which sizes are averaged
_BOTH_WAYS = 0.3  # edges of balance down to which the target pulls too, which fills extremities
# Weight of every vertex's position after a rigid motion, without which no system has one solution.
TIE = 1e-5
_RIGID_WEIGHT = 1e-6  # of the rigid motion's rotation, against that of a neighbourhood
_IMAGE_WEIGHT = 1e3  # of the images while vertices without one follow
_JOINT = 1.0  # weight of an edge that joins a component without a partner, such as an eyeball
_LOOSE = 1e-6  # the same while the others are fitted, which it must not hold back
_MOMENTUM = 0.7  # closest points are sought ahead of a step, which speeds up a slow slide
_HOLD = 1.0  # pull of every vertex to where it is, in 1 / area: no system is singular then
_NORMAL_WEIGHT = 2.0  # lengths of balance that a difference of normals of one counts as
_PRIOR = 0.01  # weight of the mean size in that of a patch; patches without a partner take it
_OUTLIER = 4.0  # median distances, and an edge on top, beyond which a pair is ignored
_FAR = 1e6  # extents, from which on everything is as far off; less than its inverse is on a vertex
_AT_ONCE = 2**22  # distances
_SLACK = 0.1  # edges beyond a boundary that still count as on the surface


class Fit:
    """A surface (n vertices) that is being registered to a target.

    The match gives `partners` (n,), vertices of the target, and `goal` (n, 3), places on it, both
    valid where `matched` (n,). The surface's vertices are now at `places` (n, 3).
    """

    def __init__(
        self,
        surface: ElasticSurface,
        target: Target,
        partners: IntArray,
        goal: FloatArray,
        matched: BoolArray,
    ) -> None:
        self.unmatched = in_unmatched_components(surface.faces, matched)
        surface = self.surface = joined(surface, self.unmatched, _LOOSE)
        self.matched = matched
        self.goal = np.where(matched[:, None], goal, 0.0)
        self.own = make_target(surface.vertices, surface.faces)
        self.ends = edge_ends(surface.faces, len(goal)).T
        self.partners = _nearest_partners(partners, matched, surface.vertices, surface.edge_weights)
        back = np.full(len(target.vertices), -1)
        back[partners[matched]] = np.flatnonzero(matched)
        self.partners_back = _nearest_partners(back, back >= 0, target.vertices, target.neighbors)
        self.weights = vertex_areas(Mesh(target.vertices, target.faces))
        self.sizes = np.ones(len(goal))
        # The smoothest displacements give the first rotations of neighbourhoods.
        rotation, shift = procrustes(surface.vertices[matched], goal[matched], reflect=False)
        places = surface.vertices @ rotation.T + shift
        pull = surface.areas * matched
        system, force = self._held(_RIGID, pull[:, None] * self.goal, pull, places)
        self.places = self.ahead = system.solve(surface.stiffness @ places + force)
        self.rotations = surface.fit_rotations(self.places)
        facing = (self._normals(self.places) * target.normals[self.partners]).sum(axis=1)
        side = 1.0 if pull @ facing >= 0 else -1.0
        self.target = target._replace(normals=side * target.normals)

    @property
    def edge(self) -> float:
        """Mean length of an edge."""
        i, j = self.ends
        return float(np.linalg.norm(self.places[i] - self.places[j], axis=1).mean())

    def run(self, progress: Progress | None) -> None:
        """Follow the match, then closest points; components without a match follow the others."""
        pull = self.surface.areas * self.matched
        for length in np.geomspace(_RIGID, _FIRM, _MATCH_STEPS):
            self._step(length, pull[:, None] * self.goal, pull)
        for i, length in enumerate(np.geomspace(_FIRM, _SOFT * self.edge, _CLOSEST_STEPS)):
            found = self.project(length)
            self.partners = found.partners
            free = self.unmatched | self._flipped(found)
            pull = self.surface.areas * (self._trusted(found) & ~free)
            force = pull[:, None] * found.places
            if length > _BOTH_WAYS * self.edge:
                more_force, more_pull = self._target_pull(length)
                force, pull = force + more_force, pull + more_pull
            self._step(length, force, pull)
            if progress is not None:
                progress("register", (i + 1) / _CLOSEST_STEPS)
        if self.unmatched.any():
            rotation, _ = procrustes(
                self.surface.vertices[self.matched], self.places[self.matched], reflect=False
            )
            self.places = extended(
                joined(self.surface, self.unmatched),
                self.places,
                ~self.unmatched,
                rotation,
                self.sizes,
            )
            self.rotations = self.surface.fit_rotations(self.places)
        self.ahead = self.places

    def project(self, length: float) -> Projection:
        """Closest points on the target, sought ahead of the last step."""
        return project(
            self.target,
            self.ahead,
            self._normals(self.ahead),
            self.surface.edge_weights,
            self.partners,
            normal_weight=_NORMAL_WEIGHT * length,
            slack=_SLACK * self.edge,
        )

    def _project_back(self, length: float, slack: float) -> Projection:
        """Closest points of the target's vertices on the surface, ahead of the last step."""
        return project(
            self.own._replace(vertices=self.ahead, normals=self._normals(self.ahead)),
            self.target.vertices,
            self.target.normals,
            self.target.neighbors,
            self.partners_back,
            normal_weight=_NORMAL_WEIGHT * length,
            slack=slack,
        )

    def distances(self, tolerance: float) -> tuple[FloatArray, BoolArray]:
        """Distance of each vertex to the target, and whether a valid projection is so close.

        On thin parts the closest point may be on the opposite side, and that which the vertex has
        followed is a little farther.
        """
        normals, slack = self._normals(self.places), _SLACK * self.edge
        closest = project_anywhere(self.target, self.places, normals, slack=slack)
        followed = self.project(0.0)
        covered = [one.valid & (one.distances <= tolerance) for one in (closest, followed)]
        return closest.distances, covered[0] | covered[1]

    def target_coverage(self) -> float:
        """Share of the target's area that lies within an edge of the surface."""
        found = self._project_back(0.0, self.edge)
        near = found.valid & (found.distances <= self.edge)
        return float(np.average(near, weights=self.weights))

    def carried(self, points: FloatArray) -> FloatArray:
        """Move points (m, 3) as the surface around them was moved."""
        turns = self.sizes[:, None, None] * self.rotations
        return carried(points, self.surface.vertices, self.places, turns, self.surface.areas)

    def _flipped(self, found: Projection) -> BoolArray:
        """Vertices of flipped faces: if nothing pulls them, their stiffness flips them back."""
        faces = self.surface.faces
        facing = found.normals[faces].sum(axis=1)
        flipped = faces[(face_normals(self.ahead, faces) * facing).sum(axis=1) < 0]
        return np.isin(np.arange(len(self.ahead)), flipped)

    def _target_pull(self, length: float) -> tuple[FloatArray, FloatArray]:
        """Force and pull of the target's vertices on those nearest to their projections."""
        found = self._project_back(length, _SLACK * self.edge)
        self.partners_back = found.partners
        goal = self.ahead[found.partners] + self.target.vertices - found.places
        pull = self.weights * self._trusted(found)
        return scatter(found.partners, pull, goal, len(self.places))

    def _step(self, length: float, force: FloatArray, pull: FloatArray) -> None:
        before = self.places
        held = self._held(length, force, pull, before)
        self.places, covariances, _ = self.surface.step(*held, self.rotations, self.sizes)
        self.ahead = self.places + _MOMENTUM * (self.places - before)
        self._resize(covariances, pull > 0)

    def _held(
        self, length: float, force: FloatArray, pull: FloatArray, places: FloatArray
    ) -> tuple[Factorization, FloatArray]:
        """System and force of a pull that balances with stiffness over a length."""
        hold = _HOLD * self.surface.areas
        system = self.surface.system_of(pull / length**2 + hold)
        return system, force / length**2 + hold[:, None] * places

    def _resize(self, covariances: FloatArray, pulled: BoolArray) -> None:
        """Fit the sizes of patches to the pulled vertices; the rest takes the mean size."""
        stretched = np.einsum("iba,iab->i", self.rotations, covariances)
        squares = self.surface.edge_squares
        both = np.stack([stretched, squares], axis=1)
        total = both[pulled].sum(axis=0)
        if not (total > 0).all():
            return
        whole = np.array([total[0] / total[1], 1.0])
        both = both * pulled[:, None] + _PRIOR * squares[:, None] * whole
        above, below = self.surface.averaged(both, _PATCH).T
        self.sizes = above / below

    def _trusted(self, found: Projection) -> BoolArray:
        """Select the valid pairs that are not much longer than others."""
        if not found.valid.any():
            return found.valid
        median = float(np.median(found.distances[found.valid]))
        return np.asarray(found.valid & (found.distances <= _OUTLIER * median + self.edge))

    def _normals(self, places: FloatArray) -> FloatArray:
        return vertex_normals(places, self.surface.faces)


def carried(
    points: FloatArray, rest: FloatArray, places: FloatArray, turns: FloatArray, areas: FloatArray
) -> FloatArray:
    """Move points (m, 3) as a surface was moved from rest to places, its nearest parts the most.

    It moved by the turns (n, 3, 3), which may stretch, around its vertices, of which each counts as
    much as its area over the fourth power of its distance.
    """
    motions = np.hstack([turns.reshape(-1, 9), places - np.einsum("nij,nj->ni", turns, rest)])
    low, high = rest.min(axis=0), rest.max(axis=0)
    extent = float((high - low).max())
    moved = np.empty_like(points)
    for part in slices(len(points), max(1, _AT_ONCE // len(rest))):
        some = points[part]
        near = cdist(np.clip(some, low - _FAR * extent, high + _FAR * extent), rest, "sqeuclidean")
        near = np.maximum(near, (extent / _FAR) ** 2)
        weights = areas * np.square(near.min(axis=1, keepdims=True) / near)
        motion = weights @ motions / weights.sum(axis=1, keepdims=True)
        moved[part] = np.einsum("nij,nj->ni", motion[:, :9].reshape(-1, 3, 3), some)
        moved[part] += motion[:, 9:]
    return moved


def in_unmatched_components(faces: IntArray, matched: BoolArray) -> BoolArray:
    """Select the vertices (n,) of components none of whose vertices is matched."""
    parts = find_components(faces, len(matched)).of_vertex
    return np.asarray(~np.isin(parts, parts[matched]))


def joined(surface: ElasticSurface, unmatched: BoolArray, weight: float = _JOINT) -> ElasticSurface:
    """Join components without a match to the nearest of the others, which they then follow."""
    if not unmatched.any():
        return surface
    loose, others = np.flatnonzero(unmatched), np.flatnonzero(~unmatched & (surface.areas > 0))
    nearest = others[cKDTree(surface.vertices[others]).query(surface.vertices[loose])[1]]
    weights = surface.edge_weights
    links = sp.csr_matrix((np.full(len(loose), weight), (loose, nearest)), shape=weights.shape)
    return surface.with_edge_weights(sp.csr_matrix(weights + links + links.T))


def extended(
    surface: ElasticSurface,
    goal: FloatArray,
    moving: BoolArray,
    rotation: FloatArray,
    size: FloatArray | float,
) -> FloatArray:
    """Move parts without an image like their neighbours, or rigidly, and keep their shape."""
    used = surface.areas > 0
    before, after = surface.vertices, np.where(used[:, None], goal, 0)
    i, j = surface.edge_weights.nonzero()
    edges, mask = before[j] - before[i], sp.diags(moving.astype(np.float64))
    # Rotations of neighbourhoods with images spread to the others. With too few images, the rigid
    # motion's rotation decides.
    both_known = surface.with_edge_weights(sp.csr_matrix(mask @ surface.edge_weights @ mask))
    cross = both_known.covariances(after) + _RIGID_WEIGHT * (edges**2).mean() * rotation.T
    ties = np.where(moving, 1.0, TIE) / 2
    spread = surface.system_of(ties).solve(ties[:, None] * cross.reshape(-1, 9))
    turns = nearest_rotation(spread.reshape(-1, 3, 3).transpose(0, 2, 1))
    ties = np.where(moving, _IMAGE_WEIGHT, TIE) / 2
    moved = surface.fit_places(surface.system_of(ties), ties[:, None] * after, turns, size)
    return np.where((used & ~moving)[:, None], moved, goal)


def _nearest_partners(
    partners: IntArray, matched: BoolArray, vertices: FloatArray, neighbors: SparseMatrix
) -> IntArray:
    """Give vertices without a partner that of the nearest vertex that has one."""
    lengths = neighbors.copy()
    i, j = lengths.nonzero()
    lengths.data = np.linalg.norm(vertices[i] - vertices[j], axis=1)
    have = np.flatnonzero(matched)
    nearest = dijkstra(lengths, indices=have, min_only=True, return_predecessors=True)[2]
    # Components without any partner start from an arbitrary one.
    return np.asarray(partners[np.where(nearest < 0, have[0], nearest)], dtype=np.int64)
