"""A surface drawn onto another, rigidly at first and ever softer.

Every neighbourhood keeps its shape up to a rotation and a size (Sorkine & Alexa, "As-rigid-as-
possible surface modeling", SGP 2007); sizes vary slowly, as proportions do. Vertices are drawn to
closest points on faces, in the manner of Amberg, Romdhani & Vetter, "Optimal step nonrigid ICP
algorithms for surface registration", CVPR 2007. Closest points are found by walking over the
surface from where the match leads, so a leg is never caught by the leg beside it.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from unbend._types import BoolArray, FloatArray, IntArray, Progress, SparseMatrix
from unbend.alignment import procrustes
from unbend.correspondence._landing import Ground, Landing, land, make_ground
from unbend.deformation import ElasticSurface, scatter
from unbend.linalg.factorization import Factorization
from unbend.mesh import Mesh, edge_ends, find_components, vertex_areas, vertex_normals

# Stiffness and pull balance over a length. The match is followed from the first of these to the
# second, in sqrt(area); closest points from there to a share of an edge, in so many steps.
_RIGID, _FIRM, _SOFT = 0.06, 0.03, 0.02
_PATCH = 0.15  # length in sqrt(area) over which sizes are averaged
_FOLLOWING, _SINKING = 12, 30
_BOTH_WAYS = 0.3  # edges of balance down to which the ground pulls too, which fills tips of limbs
_JOINT = 1.0  # weight of an edge that joins a part without a partner, an eyeball, to the next part
# Closest points are sought from where the last step leads to, which speeds up a slow slide.
_MOMENTUM = 0.7
_HOLD = 1.0  # pull of every vertex to where it is, in 1 / area: no system is singular then
_NORMAL_WEIGHT = 2.0  # lengths of balance that a difference of normals of one counts as
_PRIOR = 0.01  # share in a patch's size that the whole's has, which parts without a partner take
_OUTLIER = 4.0  # median distances, and an edge on top, beyond which a pair is none
_SLACK = 0.1  # edges beyond a rim that still count as on the surface


class Fit:
    """A surface on its way onto a ground.

    Parameters
    ----------
    surface : ElasticSurface
    ground : Ground
    partners : (n,) ndarray of int64
        Vertices of the ground that the match leads to; anything where there is none.
    goal : (n, 3) ndarray of float64
        Places on the ground that the match leads to.
    matched : (n,) ndarray of bool
        Which vertices the match leads anywhere.

    Attributes
    ----------
    places : (n, 3) ndarray of float64
    edge : float
        Mean length of an edge.
    """

    def __init__(
        self,
        surface: ElasticSurface,
        ground: Ground,
        partners: IntArray,
        goal: FloatArray,
        matched: BoolArray,
    ) -> None:
        parts = find_components(surface.faces, len(goal)).of_vertex
        self.carried = ~np.isin(parts, parts[matched])
        surface = self.surface = _joined(surface, self.carried)
        self.matched = matched
        self.goal = np.where(matched[:, None], goal, 0.0)
        self.own = make_ground(surface.vertices, surface.faces)
        self.ends = edge_ends(surface.faces, len(goal)).T
        self.partners = _spread(partners, matched, surface.vertices, surface.edge_weights)
        back = np.full(len(ground.vertices), -1)
        back[partners[matched]] = np.flatnonzero(matched)
        self.partners_back = _spread(back, back >= 0, ground.vertices, ground.neighbors)
        self.weights = vertex_areas(Mesh(ground.vertices, ground.faces))
        self.sizes = np.ones(len(goal))
        # Displacements as smooth as can be say how neighbourhoods are turned.
        turn, shift = procrustes(surface.vertices[matched], goal[matched], reflect=False)
        places = surface.vertices @ turn.T + shift
        pull = surface.areas * matched
        system, force = self._held(_RIGID, pull[:, None] * self.goal, pull, places)
        self.places = self.ahead = system.solve(surface.stiffness @ places + force)
        self.rotations = surface.fit_rotations(self.places)
        facing = (self._normals(self.places) * ground.normals[self.partners]).sum(axis=1)
        self.ground = ground if pull @ facing >= 0 else ground.turned()

    @property
    def edge(self) -> float:
        """Mean length of an edge."""
        i, j = self.ends
        return float(np.linalg.norm(self.places[i] - self.places[j], axis=1).mean())

    def run(self, progress: Progress | None) -> None:
        """Follow the match, then sink into the ground."""
        pull = self.surface.areas * self.matched
        for length in np.geomspace(_RIGID, _FIRM, _FOLLOWING):
            self._step(length, pull[:, None] * self.goal, pull)
        for i, length in enumerate(np.geomspace(_FIRM, _SOFT * self.edge, _SINKING)):
            found = self.land(length)
            self.partners = found.partners
            free = self.carried | self._turned_over(found)
            pull = self.surface.areas * (self._trusted(found) & ~free)
            force = pull[:, None] * found.places
            if length > _BOTH_WAYS * self.edge:
                more, back = self._pulled_back(length)
                force, pull = force + more, pull + back
            self._step(length, force, pull)
            if progress is not None:
                progress("register", (i + 1) / _SINKING)
        self.ahead = self.places

    def land(self, length: float) -> Landing:
        """Closest points on the ground to where the last step leads to."""
        return land(
            self.ground,
            self.ahead,
            self._normals(self.ahead),
            self.surface.edge_weights,
            self.partners,
            normal_weight=_NORMAL_WEIGHT * length,
            slack=_SLACK * self.edge,
        )

    def distances(self) -> tuple[FloatArray, BoolArray]:
        """Distance of each vertex to the ground, and whether the ground is there."""
        found = self.land(0.0)
        # Where the walk ended at a rim, or in a hollow of the distance, another part is closer.
        used = np.unique(self.ground.faces)
        self.partners = used[cKDTree(self.ground.vertices[used]).query(self.places)[1]]
        nearest = self.land(0.0)
        return np.minimum(found.distances, nearest.distances), found.there

    def _turned_over(self, found: Landing) -> BoolArray:
        """Vertices of faces that are turned over: let go of, their stiffness turns them back."""
        faces = self.surface.faces
        a, b, c = self.ahead[faces].transpose(1, 0, 2)
        facing = found.facing[faces].sum(axis=1)
        over = np.zeros(len(self.ahead), dtype=bool)
        over[faces[(np.cross(b - a, c - a) * facing).sum(axis=1) < 0]] = True
        return over

    def _pulled_back(self, length: float) -> tuple[FloatArray, FloatArray]:
        """Pull of the ground's vertices on those nearest to where they fall on the shape."""
        ground = self.ground
        found = land(
            self.own._replace(vertices=self.ahead, normals=self._normals(self.ahead)),
            ground.vertices,
            ground.normals,
            ground.neighbors,
            self.partners_back,
            normal_weight=_NORMAL_WEIGHT * length,
            slack=_SLACK * self.edge,
        )
        self.partners_back = found.partners
        goal = self.ahead[found.partners] + ground.vertices - found.places
        pull = self.weights * self._trusted(found)
        force, total = scatter(found.partners, pull, goal, len(self.places))
        return force, total

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
        """Fit the sizes of patches to what is pulled; the rest takes after it."""
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

    def _trusted(self, found: Landing) -> BoolArray:
        """Which pairs are neither across a rim nor far longer than others."""
        if not found.there.any():
            return found.there
        usual = float(np.median(found.distances[found.there]))
        return np.asarray(found.there & (found.distances <= _OUTLIER * usual + self.edge))

    def _normals(self, places: FloatArray) -> FloatArray:
        return vertex_normals(places, self.surface.faces)


def _joined(surface: ElasticSurface, carried: BoolArray) -> ElasticSurface:
    """Join parts that the match says nothing of to the nearest of the others, to go along."""
    if not carried.any():
        return surface
    loose, others = np.flatnonzero(carried), np.flatnonzero(~carried)
    nearest = others[cKDTree(surface.vertices[others]).query(surface.vertices[loose])[1]]
    weights = surface.edge_weights
    links = sp.csr_matrix((np.full(len(loose), _JOINT), (loose, nearest)), shape=weights.shape)
    return surface.with_edge_weights(sp.csr_matrix(weights + links + links.T))


def _spread(
    partners: IntArray, matched: BoolArray, vertices: FloatArray, neighbors: SparseMatrix
) -> IntArray:
    """Give vertices without a partner that of the nearest vertex that has one."""
    lengths = neighbors.copy()
    i, j = lengths.nonzero()
    lengths.data = np.linalg.norm(vertices[i] - vertices[j], axis=1)
    have = np.flatnonzero(matched)
    nearest = dijkstra(lengths, indices=have, min_only=True, return_predecessors=True)[2]
    # Parts of a scan that no way leads to have no partner anywhere; they start from any.
    return np.asarray(partners[np.where(nearest < 0, have[0], nearest)], dtype=np.int64)
