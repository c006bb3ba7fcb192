"""Closest points on the faces of a surface, and whether the surface is there."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from unbend._arrays import unit_vectors
from unbend._types import BoolArray, FloatArray, IntArray, SparseMatrix
from unbend.deformation import closest_faces, walk
from unbend.mesh import faces_around, find_edges, vertex_normals

_OPPOSITE = 0.3  # cosine between normals below which two points are on different sides
_ROUNDING = 1 + 1e-9
_FANS = 3  # faces around the closest vertex, then around the heaviest corner of the closest one


class Target(NamedTuple):
    """A surface to project onto: n vertices and m faces."""

    vertices: FloatArray
    normals: FloatArray
    faces: IntArray
    fans: tuple[IntArray, IntArray]  # faces around each vertex, in compressed rows
    neighbors: SparseMatrix  # the graph (n, n) of the edges, in compressed rows
    boundary_sides: BoolArray  # (m, 3), whether the side opposite each corner is on the boundary
    on_boundary: BoolArray  # (n,)


class Projection(NamedTuple):
    """Projections of n points onto a target."""

    partners: IntArray  # the target vertex nearest to each projection
    places: FloatArray  # (n, 3)
    normals: FloatArray  # (n, 3), the surface's there
    distances: FloatArray
    valid: BoolArray  # not beyond the boundary, nor on the opposite side


def make_target(vertices: FloatArray, faces: IntArray) -> Target:
    """Compute what projections onto a surface need."""
    n = len(vertices)
    edges = find_edges(faces, n)
    # Side k in a list of edges starts at corner k; the side opposite corner k is the next one.
    boundary_sides = (edges.n_faces == 1)[edges.of_side].reshape(-1, 3)[:, [1, 2, 0]]
    links = sp.csr_matrix((np.ones(len(edges.ends)), tuple(edges.ends.T)), shape=(n, n))
    return Target(
        vertices,
        vertex_normals(vertices, faces),
        faces,
        faces_around(faces, n),
        sp.csr_matrix(links + links.T),
        boundary_sides,
        on_boundary=np.isin(np.arange(n), edges.ends[edges.n_faces == 1]),
    )


def project(
    target: Target,
    points: FloatArray,
    normals: FloatArray,
    edges: SparseMatrix,
    partners: IntArray,
    *,
    normal_weight: float,
    slack: float,
) -> Projection:
    """Walk from each point's partner, a used vertex, to the closest point on the faces around.

    The partners of a point's neighbours in the graph `edges` are tried too. A difference of
    normals of one counts as the distance `normal_weight`. Points within `slack` beyond the
    boundary are still valid.
    """
    left = np.hstack([points, normal_weight * normals])
    right = np.hstack([target.vertices, normal_weight * target.normals])
    partners = walk(left, right, partners, edges, target.neighbors)
    for _ in range(_FANS):
        faces, weights = closest_faces(left, right, target.faces, target.fans, partners)
        partners = _heaviest(target.faces[faces], weights)
    return _projection(target, points, normals, faces, weights, slack)


def project_anywhere(
    target: Target, points: FloatArray, normals: FloatArray, *, slack: float
) -> Projection:
    """Project to the closest points of all faces, however these lie.

    A ball around a point that reaches to the nearest vertex holds no other, so that few faces come
    near enough, if their size is taken into account.
    """
    corners = target.vertices[target.faces]
    middles = corners.mean(axis=1)
    radii = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    away = cKDTree(target.vertices[np.unique(target.faces)]).query(points)[0]
    sizes = np.frexp(radii)[1]
    found = []
    for size in np.unique(sizes):
        some = np.flatnonzero(sizes == size)
        reach = (away + radii[some].max()) * _ROUNDING
        near = cKDTree(middles[some]).query_ball_point(points, reach)
        counts = np.array([len(one) for one in near])
        which = np.fromiter(itertools.chain.from_iterable(near), np.int64, counts.sum())
        found.append((np.repeat(np.arange(len(points)), counts), some[which]))
    rows, faces = (np.concatenate(one) for one in zip(*found, strict=True))
    order = np.argsort(rows, kind="stable")
    start = np.searchsorted(rows[order], np.arange(len(points) + 1))
    faces, weights = closest_faces(
        points, target.vertices, target.faces, (start, faces[order]), np.arange(len(points))
    )
    return _projection(target, points, normals, faces, weights, slack)


def _heaviest(corners: IntArray, weights: FloatArray) -> IntArray:
    """Take the corner (n,) of each face that counts most."""
    return np.asarray(corners[np.arange(len(corners)), weights.argmax(axis=1)])


def _projection(
    target: Target,
    points: FloatArray,
    normals: FloatArray,
    faces: IntArray,
    weights: FloatArray,
    slack: float,
) -> Projection:
    corners = target.faces[faces]
    places = np.einsum("ij,ijk->ik", weights, target.vertices[corners])
    facing = unit_vectors(np.einsum("ij,ijk->ik", weights, target.normals[corners]))
    offsets = points - places
    beyond = offsets - (offsets * facing).sum(axis=1, keepdims=True) * facing
    on_boundary = ((weights == 0) & target.boundary_sides[faces]).any(axis=1)
    on_boundary |= ((weights == 1) & target.on_boundary[corners]).any(axis=1)
    valid = ~(on_boundary & (np.linalg.norm(beyond, axis=1) > slack))
    valid &= (facing * normals).sum(axis=1) > _OPPOSITE
    distances = np.linalg.norm(offsets, axis=1)
    return Projection(_heaviest(corners, weights), places, facing, distances, valid)
