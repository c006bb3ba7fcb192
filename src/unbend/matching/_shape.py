"""What the matcher needs of a mesh, as plain arrays at unit area."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from unbend._arrays import first_largest, snap, sum_rows, unit_vectors
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.alignment import OrientedSurface, farthest_points
from unbend.deformation import ElasticSurface, cached
from unbend.linalg.signs import fix_signs
from unbend.matching import _constants as constants
from unbend.mesh import face_normals, find_edges, label_linked, vertex_normals
from unbend.mesh.decimation import decimate

# Eigenvalues below this (unit area) are taken to be this: an extremely long or nearly pinched
# shape must not let one function outweigh all others.
_SMALLEST_EIGENVALUE = 0.1
# What is computed on demand and differs between a shape and its mirror image.
_HANDED = ("normals", "boundary_edges", "conormals", "form")
_OF_LANDMARKS = ("landmark_distances", "landmark_surroundings")
_SCALINGS = 30  # steps towards a form of least stress


@dataclass(frozen=True, eq=False)
class Shape(ElasticSurface):
    """A connected surface of unit area, its centroid at the origin, and its eigenbasis.

    If it is partial, it may continue beyond its boundary, and what another shape has there has no
    partner here. Its landmarks correspond to those of another shape, row by row.
    """

    eigenvalues: FloatArray  # (k,) of the non-constant eigenfunctions
    basis: FloatArray  # (n, k) the non-constant eigenfunctions, orthonormal under `areas`
    partial: bool = False
    landmarks: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))  # (l,)

    @property
    def k(self) -> int:
        """Number of non-constant eigenfunctions."""
        return int(self.basis.shape[1])

    @cached
    def normals(self) -> FloatArray:
        """Unit vertex normals (n, 3), pointing to the side that the faces' winding names."""
        return vertex_normals(self.vertices, self.faces)

    @cached
    def conormals(self) -> FloatArray:
        """Outward unit conormals (n, 3) at the boundary of a partial surface, 0 elsewhere."""
        return self.conormals_in(self.vertices)

    def conormals_in(self, places: FloatArray) -> FloatArray:
        """Compute the outward unit conormals (n, 3) at the boundary in a pose, 0 elsewhere."""
        start, end, face = self.boundary_edges.T
        normals = unit_vectors(face_normals(places, self.faces[face]))
        off = np.cross(places[end] - places[start], normals)
        return unit_vectors(sum_rows(np.append(start, end), np.tile(off, (2, 1)), len(places)))

    @cached
    def boundary_edges(self) -> IntArray:
        """Boundary edges (e, 3) of a partial surface: start and end in a face's order, and face."""
        if not self.partial:
            return np.empty((0, 3), dtype=np.int64)
        edges = find_edges(self.faces, len(self.vertices))
        face, corner = np.divmod(np.flatnonzero(edges.n_faces[edges.of_side] == 1), 3)
        ends = self.faces[face, corner], self.faces[face, (corner + 1) % 3]
        return np.stack([*ends, face], axis=1)

    @cached
    def on_boundary(self) -> BoolArray:
        """Whether a vertex (n,) lies on the boundary of a partial surface."""
        return np.isin(np.arange(len(self.vertices)), self.boundary_edges[:, :2])

    @cached
    def boundary_distances(self) -> FloatArray:
        """Distance (n,) to the nearest boundary vertex of a partial surface."""
        if not self.on_boundary.any():
            return np.full(len(self.vertices), np.inf)
        return np.asarray(cKDTree(self.vertices[self.on_boundary]).query(self.vertices)[0])

    @cached
    def boundary_length(self) -> float:
        """Length of the boundary of a partial surface."""
        start, end, _ = self.boundary_edges.T
        return float(np.linalg.norm(self.vertices[start] - self.vertices[end], axis=1).sum())

    @cached
    def edge(self) -> float:
        """Mean length of an edge."""
        return float(self.edge_lengths.data.mean())

    @cached
    def edge_lengths(self) -> sp.csr_array:
        """Lengths of edges, (n, n)."""
        i, j = self.edge_weights.nonzero()
        lengths = np.linalg.norm(self.vertices[i] - self.vertices[j], axis=1)
        return sp.csr_array((lengths, (i, j)), shape=self.edge_weights.shape)

    @cached
    def distances(self) -> FloatArray:
        """Geodesic distances along edges between all vertices, (n, n); for small meshes."""
        return np.asarray(dijkstra(self.edge_lengths, directed=False))

    @cached
    def form(self) -> FloatArray:
        """Canonical form (n, 3) of the geodesic distances, its outside outside; for small meshes.

        Classical scaling begins, and SMACOF lowers the stress (Elad & Kimmel 2003).
        """
        squares = self.distances**2
        centred = squares.mean(axis=0) - squares
        gram = (centred - centred.mean(axis=1, keepdims=True)) / 2
        n = len(gram)
        values, vectors = scipy.linalg.eigh(gram, subset_by_index=(n - 3, n - 1))
        points = fix_signs(vectors, self.areas) * np.sqrt(np.maximum(values, 0.0))
        for _ in range(_SCALINGS):
            apart = cdist(points, points)
            ratios = np.divide(self.distances, apart, out=np.zeros((n, n)), where=apart > 0)
            points = (ratios.sum(axis=1)[:, None] * points - ratios @ points) / n
        points -= self.areas @ points
        corners = points[self.faces]
        if np.linalg.det(corners).sum() < 0:
            points[:, 0] *= -1
        return np.asarray(points)

    @cached
    def landmark_distances(self) -> FloatArray:
        """Geodesic distances (l, n) along edges from the landmarks to all vertices."""
        return np.asarray(dijkstra(self.edge_lengths, directed=False, indices=self.landmarks))

    @cached
    def landmark_surroundings(self) -> FloatArray:
        """How much vertices go along with the landmarks (l, n): less than halfway to the next."""
        apart = self.landmark_distances[:, self.landmarks]
        np.fill_diagonal(apart, np.inf)
        nearest = apart.min(axis=1, initial=2 * constants.LIMB)
        radii = np.maximum(nearest / 2, constants.PATCH)
        return np.asarray(np.exp(-((self.landmark_distances / radii[:, None]) ** 2)))

    @cached
    def samples(self) -> IntArray:
        """Up to `SAMPLES` vertices, each as far as possible from those before it."""
        points = snap(self.vertices)  # of equally far ones the first is taken, on every processor
        start = int(first_largest((points**2).sum(axis=1)))
        return farthest_points(points, min(constants.SAMPLES, len(points)), start)

    @cached
    def position_coefficients(self) -> FloatArray:
        """Vertex positions in the eigenbasis, (k, 3)."""
        return np.asarray(self.basis.T @ (self.areas[:, None] * self.vertices))

    @cached
    def patch_sizes(self) -> FloatArray:
        """Weighted squared edges (n,) around each vertex, averaged."""
        return self.averaged(self.edge_squares)

    @cached
    def detail(self) -> float:
        """Radius of the patches that maps are scored by."""
        return max(constants.PATCH, constants.EDGES * self.edge)

    def as_oriented(self, places: FloatArray, count: int) -> OrientedSurface:
        """Smooth normals of the surface with its vertices at places (n, 3), and so many samples."""
        normals = vertex_normals(places, self.faces)
        total = self.averaged(self.areas[:, None] * normals, constants.PATCH)
        samples = self.samples[:count]
        nearest = cKDTree(places[samples]).query(places)[1]
        areas = np.asarray(np.bincount(nearest, self.areas, len(samples)), dtype=np.float64)
        return OrientedSurface(places, unit_vectors(total), samples, areas, self.on_boundary)

    def reflected(self) -> Shape:
        """Return the mirror image, its faces turned so that the same side stays outside."""
        flip = np.array([-1.0, 1.0, 1.0])
        return self._changed(
            _HANDED,
            vertices=self.vertices * flip,
            faces=np.ascontiguousarray(self.faces[:, ::-1]),
            # A proxy's are those of the fine shape, and cannot be computed anew.
            position_coefficients=self.position_coefficients * flip,
        )

    def led(self, landmarks: IntArray) -> Shape:
        """Return the same shape with such landmarks."""
        return self._changed(_OF_LANDMARKS, landmarks=landmarks)

    def _changed(self, computed: Sequence[str], **changes: Any) -> Shape:
        """Copy it with changes, without some of what was computed; factors and lock are shared."""
        other = copy(self)
        for name in computed:
            other.__dict__.pop(name, None)
        other.__dict__.update(changes)
        return other


def make_shape(
    vertices: FloatArray,
    faces: IntArray,
    areas: FloatArray,
    eigenvalues: FloatArray,
    eigenfunctions: FloatArray,
    partial: bool = False,
) -> Shape:
    """Normalise to unit area.

    The eigenpairs are those at unit area, the constant's first. What may be ``partial`` is if a
    connected piece of its boundary is long enough, not if all its tiny holes together are.
    """
    total = np.linalg.norm(face_normals(vertices, faces), axis=1).sum() / 2
    weights = areas / areas.sum()
    points = (vertices - weights @ vertices) / np.sqrt(total)
    shape = Shape(
        vertices=points,
        faces=np.asarray(faces, dtype=np.int64),
        areas=weights,
        eigenvalues=np.maximum(eigenvalues[1:], _SMALLEST_EIGENVALUE),
        basis=np.ascontiguousarray(eigenfunctions[:, 1:]),
        partial=partial,
    )
    longest = longest_piece(points, shape.boundary_edges[:, :2])
    return shape if longest > constants.PATCH else replace(shape, partial=False)


def longest_piece(points: FloatArray, edges: IntArray) -> float:
    """Length of the longest connected piece of edges (e, 2)."""
    start, end = edges.T
    lengths = np.linalg.norm(points[start] - points[end], axis=1)
    pieces = np.bincount(label_linked((start, end), len(points))[start], lengths)
    return float(pieces.max(initial=0))


class Proxy(NamedTuple):
    """A coarse copy of a shape: some of its vertices, and its basis there."""

    shape: Shape
    kept: IntArray  # (m,) those vertices
    parents: IntArray  # (n,) the coarse vertex that stands for each fine one


def make_proxy(shape: Shape, count: int) -> Proxy:
    """Make a copy of so many vertices, or of all if there are no more.

    Areas are gathered, so that what was decimated more does not weigh less.
    """
    # Which of equal edges collapses is then the same on every processor.
    kept, faces, parents = decimate(snap(shape.vertices), shape.faces, count)
    areas = np.asarray(np.bincount(parents, shape.areas, len(kept)), dtype=np.float64)
    basis = np.ascontiguousarray(shape.basis[kept])
    coarse = replace(
        shape,
        vertices=shape.vertices[kept],
        faces=faces,
        areas=areas,
        basis=basis,
        landmarks=parents[shape.landmarks],
    )
    # Those of the fine shape are the better ones.
    coarse.__dict__["position_coefficients"] = shape.position_coefficients
    return Proxy(coarse, kept, parents)
