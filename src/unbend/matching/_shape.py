"""What the matcher needs of a mesh, as plain arrays at unit area."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from unbend._arrays import first_largest, snap
from unbend._types import BoolArray, FloatArray, IntArray, SparseMatrix
from unbend.linalg.factorization import Factorization, factorize
from unbend.matching._kernels import edge_squares, faces_around, farthest_points
from unbend.mesh import find_edges, measure_corners, vertex_normals

# Eigenvalues below this (unit area) are taken to be this: an extremely long or nearly pinched
# shape must not let one function outweigh all others.
_SMALLEST_EIGENVALUE = 0.1
_SPOKE_FLOOR = 1e-3
_MOST_SAMPLES = 2000
# Rotations are averaged over about this length, in sqrt(area): limbs turn as wholes, which keeps
# their ends from sliding, yet joints still bend.
_TURNING = 0.03
# Patches over which rough maps are averaged: about as large as a limb's girth is long.
_PATCH = 0.15
# Those by which maps are judged: as small as a body's details, but no smaller than so many edges.
_DETAIL, _DETAIL_EDGES = 0.08, 2.4
# Along a shorter rim, in sqrt(area), hardly anything can be cut off: a limb ten times as long as
# thick is less than a hundredth of the area.
_SHORTEST_RIM = 0.05


@dataclass(frozen=True, eq=False)
class Shape:
    """A connected surface of unit area, its centroid at the origin, and its eigenbasis.

    Attributes
    ----------
    vertices : (n, 3) ndarray of float64
    faces : (m, 3) ndarray of int64
    areas : (n,) ndarray of float64
        Sum to one.
    eigenvalues : (k,) ndarray of float64
        Of the non-constant eigenfunctions.
    basis : (n, k) ndarray of float64
        The non-constant eigenfunctions, orthonormal under `areas`.
    partial : bool
        Whether the shape may go on where the surface ends: what another shape has beyond that rim
        then has no partner here.
    landmarks : (l,) ndarray of int64
        Vertices that are said to correspond to those of another shape, row by row.
    """

    vertices: FloatArray
    faces: IntArray
    areas: FloatArray
    eigenvalues: FloatArray
    basis: FloatArray
    partial: bool = False
    landmarks: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @property
    def k(self) -> int:
        """Number of non-constant eigenfunctions."""
        return int(self.basis.shape[1])

    @cached_property
    def normals(self) -> FloatArray:
        """Unit vertex normals (n, 3), pointing to the side that the faces' winding names."""
        return vertex_normals(self.vertices, self.faces)

    @cached_property
    def rim(self) -> FloatArray:
        """Unit vectors (n, 3) that lead off the surface where it ends, 0 where it goes on.

        All are 0 if the shape is not partial.
        """
        if not self.partial:
            return np.zeros_like(self.vertices)
        return find_rim(self.vertices, self.faces)

    @cached_property
    def on_rim(self) -> BoolArray:
        """Whether a vertex (n,) lies where a partial surface ends."""
        found = np.zeros(len(self.vertices), dtype=bool)
        if self.partial:
            found[_boundary(self.faces, len(found))] = True
        return found

    @cached_property
    def off_rim(self) -> FloatArray:
        """Distance (n,) to the nearest vertex where a partial surface ends."""
        if not self.on_rim.any():
            return np.full(len(self.vertices), np.inf)
        return np.asarray(cKDTree(self.vertices[self.on_rim]).query(self.vertices)[0])

    @cached_property
    def rim_length(self) -> float:
        """Length of all along which the surface ends."""
        return _rim_length(self.vertices, self.faces)

    @cached_property
    def edge(self) -> float:
        """Mean length of an edge."""
        return float(self.edge_lengths.data.mean())

    @cached_property
    def edge_lengths(self) -> sp.csr_array:
        """Lengths of edges, (n, n)."""
        i, j = self.spokes.nonzero()
        lengths = np.linalg.norm(self.vertices[i] - self.vertices[j], axis=1)
        return sp.csr_array((lengths, (i, j)), shape=self.spokes.shape)

    @cached_property
    def ways(self) -> FloatArray:
        """Lengths of the shortest ways along edges between all vertices, (n, n), of few."""
        return np.asarray(dijkstra(self.edge_lengths, directed=False))

    @cached_property
    def landmark_ways(self) -> FloatArray:
        """Lengths (l, n) of the shortest ways along edges from the landmarks to all vertices."""
        return np.asarray(dijkstra(self.edge_lengths, directed=False, indices=self.landmarks))

    @cached_property
    def samples(self) -> IntArray:
        """Up to 2000 vertices, each as far as possible from those before it."""
        points = snap(self.vertices)  # of equally far ones the first is taken, on every processor
        start = int(first_largest((points**2).sum(axis=1)))
        chosen: IntArray = farthest_points(points, min(_MOST_SAMPLES, len(points)), start)
        return chosen

    @cached_property
    def position_coefficients(self) -> FloatArray:
        """Vertex positions in the eigenbasis, (k, 3)."""
        return np.asarray(self.basis.T @ (self.areas[:, None] * self.vertices))

    @cached_property
    def spokes(self) -> SparseMatrix:
        """Positive cotangent weights of the edges, (n, n) in compressed rows."""
        return _spokes(self.vertices, self.faces)

    @cached_property
    def fans(self) -> tuple[IntArray, IntArray]:
        """Faces around each vertex, in compressed rows."""
        fans: tuple[IntArray, IntArray] = faces_around(self.faces, len(self.vertices))
        return fans

    @cached_property
    def stiffness(self) -> SparseMatrix:
        """Laplacian of `spokes`, (n, n)."""
        return sp.diags(np.asarray(self.spokes.sum(axis=1)).ravel()) - self.spokes

    @cached_property
    def averaging(self) -> Factorization:
        """Its solution averages what is given per vertex, times the area, over `_TURNING`."""
        return factorize(sp.diags(self.areas) + _TURNING**2 * self.stiffness, many=True)

    @cached_property
    def edge_squares(self) -> FloatArray:
        """Sum (n,) of the weighted squares of the edges around a vertex."""
        spokes = self.spokes
        return edge_squares(spokes.indptr, spokes.indices, spokes.data, self.vertices)

    @cached_property
    def patch_sizes(self) -> FloatArray:
        """The same, averaged."""
        return self.averaging.solve(self.edge_squares)

    @cached_property
    def patches(self) -> Factorization:
        """The same over `_PATCH`."""
        return factorize(sp.diags(self.areas) + _PATCH**2 * self.stiffness, many=True)

    @cached_property
    def details(self) -> Factorization:
        """The same over `_DETAIL`, or what of it the mesh can show."""
        size = max(_DETAIL, _DETAIL_EDGES * self.edge)
        return factorize(sp.diags(self.areas) + size**2 * self.stiffness, many=True)

    def pulled(self, pull: float) -> Factorization:
        """Stiffness and twice a pull by area: what a step of the registration solves with."""
        if pull not in self._pulled:
            pulled = self.stiffness + sp.diags(2 * pull * self.areas)
            self._pulled[pull] = factorize(pulled, many=True)
        return self._pulled[pull]

    @cached_property
    def _pulled(self) -> dict[float, Factorization]:
        return {}

    def reflected(self) -> Shape:
        """Return the mirror image, its faces turned so that the same side stays outside."""
        flip = np.array([-1.0, 1.0, 1.0])
        mirror = replace(
            self,
            vertices=self.vertices * flip,
            faces=np.ascontiguousarray(self.faces[:, ::-1]),
        )
        # A proxy's are those of the fine shape, and cannot be computed anew.
        mirror.__dict__["position_coefficients"] = self.position_coefficients * flip
        mirror.__dict__["_pulled"] = self._pulled
        # What does not depend on handedness, where it is known.
        for name in (
            "samples",
            "spokes",
            "fans",
            "stiffness",
            "averaging",
            "patches",
            "details",
            "edge",
            "edge_lengths",
            "edge_squares",
            "patch_sizes",
            "ways",
            "landmark_ways",
        ):
            if name in self.__dict__:
                mirror.__dict__[name] = self.__dict__[name]
        return mirror


def find_rim(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Find unit vectors (n, 3) that lead off a surface where it ends, 0 where it goes on."""
    edges = find_edges(faces, len(vertices))
    side = np.flatnonzero(edges.n_faces[edges.of_side] == 1)
    around = faces[side // 3]
    every = np.arange(len(side))
    start, end = around[every, side % 3], around[every, (side + 1) % 3]
    corners = vertices[around]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    off = np.cross(vertices[end] - vertices[start], normals)
    found = np.zeros_like(vertices)
    np.add.at(found, start, off)
    np.add.at(found, end, off)
    return np.asarray(found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-300))


def _boundary(faces: IntArray, n: int) -> IntArray:
    """Find the edges of a single face, and give their ends (e, 2)."""
    edges = find_edges(faces, n)
    return np.asarray(edges.ends[edges.n_faces == 1])


def _rim_length(vertices: FloatArray, faces: IntArray) -> float:
    ends = vertices[_boundary(faces, len(vertices))]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum())


def make_shape(
    vertices: FloatArray,
    faces: IntArray,
    areas: FloatArray,
    eigenvalues: FloatArray,
    eigenfunctions: FloatArray,
    partial: bool = False,
) -> Shape:
    """Normalise to unit area and outward winding.

    A closed surface that is wound inside out is replaced by its mirror image, which is wound
    outside out: a map that keeps the winding then also keeps the shape's handedness in space.

    Parameters
    ----------
    vertices : (n, 3) ndarray of float64
    faces : (m, 3) ndarray of int64
    areas : (n,) ndarray of float64
        Vertex areas that sum to the total area, or any multiple of it.
    eigenvalues : (k + 1,) ndarray of float64
        At unit area, the constant's 0 first.
    eigenfunctions : (n, k + 1) ndarray of float64
        Area-orthonormal at unit area.
    partial : bool, default=False
        Whether it is a part of what it shows, if it has a rim that is long enough.
    """
    corners = vertices[faces]
    twice = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.linalg.norm(twice, axis=1).sum() / 2
    weights = areas / areas.sum()
    points = (vertices - weights @ vertices) / np.sqrt(total)
    corners = points[faces]
    if np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) < 0:
        points = points * np.array([-1.0, 1.0, 1.0])
    faces = np.asarray(faces, dtype=np.int64)
    return Shape(
        vertices=points,
        faces=faces,
        areas=weights,
        eigenvalues=np.maximum(eigenvalues[1:], _SMALLEST_EIGENVALUE),
        basis=np.ascontiguousarray(eigenfunctions[:, 1:]),
        partial=partial and _rim_length(points, faces) > _SHORTEST_RIM,
    )


def _spokes(vertices: FloatArray, faces: IntArray) -> SparseMatrix:
    n = len(vertices)
    dots, squared, double_areas = measure_corners(vertices, faces)
    longer = np.maximum(np.roll(squared, -1, axis=1), np.roll(squared, -2, axis=1))
    floor = np.maximum(np.finfo(float).eps * longer, 1e-300)
    weights = (dots / np.maximum(double_areas[:, None], floor) / 2).ravel()
    ends = np.roll(faces, -1, axis=1).ravel(), np.roll(faces, -2, axis=1).ravel()
    spokes = sp.csr_matrix((np.tile(weights, 2), np.hstack([ends, ends[::-1]])), shape=(n, n))
    spokes.data = np.clip(spokes.data, _SPOKE_FLOOR, 1 / _SPOKE_FLOOR)
    return spokes
