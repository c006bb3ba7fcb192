"""A surface drawn onto another, rigidly at first and ever softer.

Every neighbourhood keeps its shape up to a rotation and a size (Sorkine & Alexa, "As-rigid-as-
possible surface modeling", SGP 2007); sizes vary slowly, as proportions do. Vertices are drawn to
closest points on faces, in the manner of Amberg, Romdhani & Vetter, "Optimal step nonrigid ICP
algorithms for surface registration", CVPR 2007.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from unbend._types import BoolArray, FloatArray, IntArray, Progress
from unbend.alignment import nearest_rotation, procrustes
from unbend.correspondence._landing import Ground, Landing, land
from unbend.linalg.factorization import factorize
from unbend.matching import Shape, edge_covariances, rotated_divergence, turn_rotations
from unbend.mesh import edge_ends, vertex_normals

# Stiffness and pull balance over a length: from this, in sqrt(area), to a share of an edge.
_RIGID, _SOFT = 0.06, 0.02
_FOLLOWING, _SOFTENING = 8, 30  # steps towards the match, then towards closest points
# Closest points are sought from where the last step leads to, which speeds up a slow slide.
_MOMENTUM = 0.7
# Pull of every vertex to where it is, in 1 / area: it holds parts that nothing else does.
_REST = 1.0
_NORMAL_WEIGHT = 2.0  # lengths of balance that a difference of normals of one counts as
_PRIOR = 0.01  # share in a patch's size that the whole's has, which parts without a partner take
_OUTLIER = 4.0  # median distances, and an edge on top, beyond which a pair is none
_SLACK = 0.1  # edges beyond a rim that still count as on the surface


class Fit:
    """A surface on its way onto a ground.

    Parameters
    ----------
    shape : Shape
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
        shape: Shape,
        ground: Ground,
        partners: IntArray,
        goal: FloatArray,
        matched: BoolArray,
    ) -> None:
        self.shape = shape
        self.partners = _spread(partners, matched, shape)
        self.goal, self.matched = np.where(matched[:, None], goal, 0.0), matched
        self.ends = edge_ends(shape.faces, len(partners)).T
        self.rest_covariances = self._covariances(shape.vertices)
        self.sizes = np.ones(len(partners))
        # Displacements as smooth as can be say how neighbourhoods are turned.
        turn, shift = procrustes(shape.vertices[matched], goal[matched], reflect=False)
        self.places = self.ahead = shape.vertices @ turn.T + shift
        self._settle(_RIGID, shape.stiffness @ self.places, self.goal, matched)
        averaged = shape.averaging.solve(self._covariances(self.places).reshape(-1, 9))
        rotations = nearest_rotation(averaged.reshape(-1, 3, 3).transpose(0, 2, 1))
        self.rotations = np.ascontiguousarray(rotations)
        facing = (self._normals(self.places) * ground.normals[self.partners]).sum(axis=1)
        self.ground = ground if shape.areas @ (facing * matched) >= 0 else ground.turned()

    @property
    def edge(self) -> float:
        """Mean length of an edge."""
        i, j = self.ends
        return float(np.linalg.norm(self.places[i] - self.places[j], axis=1).mean())

    def run(self, progress: Progress | None) -> None:
        """Follow the match, then sink into the ground."""
        for _ in range(_FOLLOWING):
            off = np.linalg.norm(self.goal - self.places, axis=1)
            self._step(_RIGID, self.goal, self._trusted(off, self.matched))
        for i, length in enumerate(np.geomspace(_RIGID, _SOFT * self.edge, _SOFTENING)):
            found = self.land(length)
            self.partners = found.partners
            self._step(length, found.places, self._trusted(found.distances, found.there))
            if progress is not None:
                progress("register", (i + 1) / _SOFTENING)
        self.ahead = self.places

    def land(self, length: float) -> Landing:
        """Closest points on the ground to where the last step leads to."""
        return land(
            self.ground,
            self.ahead,
            self._normals(self.ahead),
            self.shape.spokes,
            self.partners,
            normal_weight=_NORMAL_WEIGHT * length,
            slack=_SLACK * self.edge,
        )

    def distances(self) -> tuple[FloatArray, BoolArray]:
        """Distance of each vertex to the ground, and whether the ground is there."""
        found = self.land(0.0)
        # Where the walk ended in a hollow of the distance, or at a rim, another part is closer.
        used = np.unique(self.ground.faces)
        self.partners = used[cKDTree(self.ground.vertices[used]).query(self.places)[1]]
        nearest = self.land(0.0)
        return np.minimum(found.distances, nearest.distances), found.there

    def _step(self, length: float, goal: FloatArray, trusted: BoolArray) -> None:
        shape, spokes = self.shape, self.shape.spokes
        turned = rotated_divergence(
            spokes.indptr,
            spokes.indices,
            spokes.data,
            shape.vertices,
            self.sizes[:, None, None] * self.rotations,
        )
        before = self.places
        self._settle(length, turned, goal, trusted)
        covariances = self._covariances(self.places)
        averaged = shape.averaging.solve(covariances.reshape(-1, 9)).reshape(-1, 3, 3)
        turn_rotations(averaged, self.rotations)
        self.ahead = self.places + _MOMENTUM * (self.places - before)
        self._resize(covariances, trusted)

    def _settle(
        self, length: float, turned: FloatArray, goal: FloatArray, trusted: BoolArray
    ) -> None:
        """Balance the stiffness with the pull of trusted vertices to their goals."""
        pull = self.shape.areas * trusted / length**2
        hold = _REST * self.shape.areas
        system = factorize(self.shape.stiffness + sp.diags(pull + hold))
        self.places = system.solve(turned + pull[:, None] * goal + hold[:, None] * self.places)

    def _resize(self, covariances: FloatArray, trusted: BoolArray) -> None:
        """Fit the sizes of patches, those of trusted vertices; others take after them."""
        stretched = np.einsum("iba,iab->i", self.rotations, covariances)
        plain = np.einsum("iaa->i", self.rest_covariances)
        whole = (stretched * trusted).sum() / max(float((plain * trusted).sum()), 1e-300)
        both = np.stack([stretched, plain], axis=1) * trusted[:, None]
        both += _PRIOR * plain[:, None] * np.array([whole, 1.0])
        above, below = self.shape.patches.solve(both).T
        self.sizes = above / below

    def _trusted(self, distances: FloatArray, there: BoolArray) -> BoolArray:
        if not there.any():
            return there
        return there & (distances <= _OUTLIER * np.median(distances[there]) + self.edge)

    def _normals(self, places: FloatArray) -> FloatArray:
        return vertex_normals(places, self.shape.faces)

    def _covariances(self, places: FloatArray) -> FloatArray:
        spokes = self.shape.spokes
        return edge_covariances(
            spokes.indptr, spokes.indices, spokes.data, self.shape.vertices, places
        )


def _spread(partners: IntArray, matched: BoolArray, shape: Shape) -> IntArray:
    """Give vertices without a partner that of the nearest vertex that has one."""
    lengths = shape.spokes.copy()
    i, j = lengths.nonzero()
    lengths.data = np.linalg.norm(shape.vertices[i] - shape.vertices[j], axis=1)
    have = np.flatnonzero(matched)
    nearest = dijkstra(lengths, indices=have, min_only=True, return_predecessors=True)[2]
    # Parts that no way leads to have no partner anywhere; they start from any.
    return np.asarray(partners[np.where(nearest < 0, have[0], nearest)], dtype=np.int64)
