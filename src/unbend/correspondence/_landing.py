"""Closest points on the faces of a surface, and where it has nothing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from unbend._types import BoolArray, FloatArray, IntArray, SparseMatrix
from unbend.deformation import closest_faces, walk
from unbend.mesh import faces_around, find_edges, vertex_normals

_TURNED = 0.3  # cosine between normals below which two points are of different sides
_FANS = 3  # faces around the closest vertex, then around the heaviest corner of the closest one


class Ground(NamedTuple):
    """The surface to land on.

    Attributes
    ----------
    vertices, normals : (n, 3) ndarray of float64
    faces : (m, 3) ndarray of int64
    fans : two ndarrays of int64
        The faces around each vertex, in compressed rows.
    neighbors : (n, n) sparse matrix in compressed rows
    rim_sides : (m, 3) ndarray of bool
        Whether the surface ends at side k of a face, opposite its corner k.
    rim : (n,) ndarray of bool
        Whether a vertex lies where the surface ends.
    """

    vertices: FloatArray
    normals: FloatArray
    faces: IntArray
    fans: tuple[IntArray, IntArray]
    neighbors: SparseMatrix
    rim_sides: BoolArray
    rim: BoolArray

    def turned(self) -> Ground:
        """Return the surface with its other side out."""
        return self._replace(normals=-self.normals)


class Landing(NamedTuple):
    """Where points fall on a ground.

    Attributes
    ----------
    partners : (n,) ndarray of int64
        The vertex nearest to where each point falls.
    places, facing : (n, 3) ndarray of float64
        And the surface's unit normals there.
    distances : (n,) ndarray of float64
    there : (n,) ndarray of bool
        Whether the surface is there and its right side is out: a point that falls on a rim from
        beyond it, or on the back of a sheet, has no place on the surface.
    """

    partners: IntArray
    places: FloatArray
    facing: FloatArray
    distances: FloatArray
    there: BoolArray


def make_ground(vertices: FloatArray, faces: IntArray) -> Ground:
    """Collect what landing on a surface needs."""
    n = len(vertices)
    edges = find_edges(faces, n)
    # Side k of an edge list leaves corner k; here it is the one opposite.
    rim_sides = (edges.n_faces == 1)[edges.of_side].reshape(-1, 3)[:, [1, 2, 0]]
    rim = np.zeros(n, dtype=bool)
    rim[edges.ends[edges.n_faces == 1]] = True
    links = sp.csr_matrix((np.ones(len(edges.ends)), tuple(edges.ends.T)), shape=(n, n))
    neighbors = sp.csr_matrix(links + links.T)
    normals, fans = vertex_normals(vertices, faces), faces_around(faces, n)
    return Ground(vertices, normals, faces, fans, neighbors, rim_sides, rim)


def land(
    ground: Ground,
    points: FloatArray,
    normals: FloatArray,
    edges: SparseMatrix,
    partners: IntArray,
    *,
    normal_weight: float,
    slack: float,
) -> Landing:
    """Walk from each point's partner to the closest point on the faces around.

    Parameters
    ----------
    ground : Ground
    points, normals : (n, 3) ndarray of float64
    edges : (n, n) sparse matrix in compressed rows
        Which points are neighbours: their partners are tried too.
    partners : (n,) ndarray of int64
        A vertex of the ground that some face uses.
    normal_weight : float
        Distance that a difference of normals of one counts as; 0 for closest points proper.
    slack : float
        How far beyond a rim a point still counts as on the surface.
    """
    left = np.hstack([points, normal_weight * normals])
    right = np.hstack([ground.vertices, normal_weight * ground.normals])
    partners = walk(left, right, partners, edges, ground.neighbors)
    every = np.arange(len(points))
    for _ in range(_FANS):
        faces, weights = closest_faces(left, right, ground.faces, ground.fans, partners)
        corners = ground.faces[faces]
        partners = corners[every, weights.argmax(axis=1)]
    places = np.einsum("ij,ijk->ik", weights, ground.vertices[corners])
    facing = np.einsum("ij,ijk->ik", weights, ground.normals[corners])
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-300)
    offsets = points - places
    beyond = offsets - (offsets * facing).sum(axis=1, keepdims=True) * facing
    on_rim = ((weights == 0) & ground.rim_sides[faces]).any(axis=1)
    on_rim |= ((weights == 1) & ground.rim[corners]).any(axis=1)
    there = ~(on_rim & (np.linalg.norm(beyond, axis=1) > slack))
    there &= (facing * normals).sum(axis=1) > _TURNED
    return Landing(partners, places, facing, np.linalg.norm(offsets, axis=1), there)
