"""A mesh of any quality as one closed, connected surface.

A shape should have the same descriptor however it was meshed. So the surface is welded, freed of
tiny pieces, closed and refined, and its pieces are linked.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from unbend._arrays import first_equal_row, sum_rows
from unbend._types import BoolArray, FloatArray, IntArray, SparseMatrix
from unbend.errors import MeshError
from unbend.mesh import (
    Mesh,
    face_normals,
    find_components,
    find_edges,
    label_linked,
    proper_faces,
    vertex_areas,
)
from unbend.mesh.refinement import refine
from unbend.spectral import laplacian

# Lengths are at unit area.
_DUST = 1e-3  # pieces with a smaller share of the area are removed, unless they make up half of it
_SEAM = 3e-3  # boundaries of two pieces are joined where they are nearer than this
_LONGEST = 0.036  # edge; even triangles with such edges have about 900 vertices
_TOUCH = 0.02  # pieces touch where vertices are this near; others are joined by so many links
_LINKS = 8
_TIE = 1e-9  # distances that differ by less are equal
# More pieces than this are first joined to pieces among this many nearest neighbours.
_FEW, _NEIGHBOURS = 16, (16, 64, 256)
_LINK_WEIGHT = 0.5  # an edge of a square grid, opposite two angles of 45 degrees, has weight 1


class Whole(NamedTuple):
    """A connected surface of unit area and its Laplacian."""

    points: FloatArray
    stiffness: SparseMatrix
    areas: FloatArray


def whole_surface(mesh: Mesh) -> Whole:
    """Connect all of a mesh or point cloud to one surface, whose points are not the mesh's.

    Raises MeshError if the mesh has no area, or fewer than 4 points.
    """
    if mesh.is_point_cloud:
        points = mesh.vertices[np.unique(first_equal_row(mesh.vertices))]
        if len(points) < 4:
            raise MeshError(f"{mesh.name}: a shape needs at least 4 points")
        one = Mesh(points / np.abs(points).max(), name=mesh.name)
    else:
        closed = _closed(*_stitched(*_welded(mesh)))
        one = Mesh(*refine(*closed, _LONGEST)[:2])  # so that large faces carry high frequencies
    operator = laplacian(one, laplacian="robust")
    # The operator's own areas depend on the order of faces where four vertices lie on a circle.
    mass = operator.areas if one.is_point_cloud else vertex_areas(one)
    area = mass.sum()
    points = one.vertices / np.sqrt(area)
    stiffness = sp.csr_array(operator.stiffness + _links(points, operator.stiffness))
    # Vertices of degenerate faces may have no area, which the eigenproblem does not allow.
    areas = np.maximum(mass / area, 1e-12)
    return Whole(points, stiffness, areas / areas.sum())


def face_areas(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Area of each face, (m,)."""
    return np.asarray(np.linalg.norm(face_normals(vertices, faces), axis=1) / 2)


def _at_unit_area(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Keep the vertices in use, centred and at unit area."""
    used, numbers = np.unique(faces, return_inverse=True)
    points = vertices[used] - vertices[used].mean(axis=0)
    faces = numbers.reshape(faces.shape)
    return points / np.sqrt(face_areas(points, faces).sum()), faces


def _welded(mesh: Mesh) -> tuple[FloatArray, IntArray]:
    """Merge vertices at equal positions; remove repeated faces and tiny pieces."""
    largest = np.abs(mesh.vertices[mesh.faces]).max()
    vertices = mesh.vertices / (largest or 1.0)
    faces = proper_faces(first_equal_row(vertices)[mesh.faces])
    faces = faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]
    areas = face_areas(vertices, faces)
    faces, areas = faces[areas > 0], areas[areas > 0]
    if not len(faces):
        raise MeshError(f"{mesh.name}: every face is degenerate (a point or a line)")
    piece = find_components(faces, len(vertices)).of_vertex[faces[:, 0]]
    kept = (np.bincount(piece, areas) > _DUST * areas.sum())[piece]
    if areas[kept].sum() > areas.sum() / 2:
        faces = faces[kept]
    return _at_unit_area(vertices, faces)


def _boundary(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Edges with a single face, (r, 2)."""
    edges = find_edges(faces, len(vertices))
    return np.asarray(edges.ends[edges.n_faces == 1])


def _stitched(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Join pieces where two boundary vertices are each the other's nearest."""
    boundary = np.unique(_boundary(vertices, faces))
    piece = find_components(faces, len(vertices)).of_vertex[boundary]
    if not len(boundary) or (piece == piece[0]).all():
        return vertices, faces
    near = cKDTree(vertices[boundary]).query_pairs(_SEAM, output_type="ndarray")
    near = near[piece[near[:, 0]] != piece[near[:, 1]]]
    lengths = np.linalg.norm(np.diff(vertices[boundary[near]], axis=1)[:, 0], axis=1)
    both_ways = np.stack([near, near[:, ::-1]], axis=1)
    here, there = both_ways[np.argsort(lengths, kind="stable")[::-1]].reshape(-1, 2).T
    partner = np.full(len(boundary), -1)
    partner[here] = there  # the nearest is the last that is written
    paired = np.flatnonzero((partner >= 0) & (partner[partner] == np.arange(len(boundary))))
    image = np.arange(len(vertices))
    image[boundary[paired]] = boundary[np.minimum(paired, partner[paired])]
    return _at_unit_area(vertices, proper_faces(image[faces]))


def _closed(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Close each connected part of the boundary by a fan; a sheet is then a surface folded flat."""
    boundary = _boundary(vertices, faces)
    if not len(boundary):
        return vertices, faces
    labels = label_linked(boundary.T, len(vertices))[boundary[:, 0]]
    group = np.unique(labels, return_inverse=True)[1]
    lengths = np.linalg.norm(vertices[boundary[:, 0]] - vertices[boundary[:, 1]], axis=1)
    middles = lengths[:, None] * vertices[boundary].mean(axis=1)
    total = np.bincount(group, lengths)
    tips = sum_rows(group, middles, len(total)) / total[:, None]
    fans = np.column_stack([boundary, len(vertices) + group])
    vertices = np.concatenate([vertices, tips])
    fans = fans[face_areas(vertices, fans) > 0]
    return _at_unit_area(vertices, np.concatenate([faces, fans]))


def _links(points: FloatArray, stiffness: SparseMatrix) -> SparseMatrix:
    """Laplacian of the links that connect all pieces, where they touch, then to what is nearest."""
    n = len(points)
    count, piece = connected_components(stiffness, directed=False)
    if count == 1:
        return sp.csr_array((n, n))
    tree = cKDTree(points)
    touching = min(_TOUCH, 2 / np.sqrt(n))  # at most two edges of an even mesh
    near = tree.query_pairs(touching, output_type="ndarray")
    links = [near[piece[near[:, 0]] != piece[near[:, 1]]]]
    piece = _merged(piece, links[-1])
    for k in _NEIGHBOURS:
        if piece.max() > _FEW:
            links.append(_to_others(piece, *tree.query(points, min(k, n))))
            piece = _merged(piece, links[-1])
    while piece.max() > 0:
        counts = np.bincount(piece)
        smallest = np.flatnonzero(counts == counts.min())
        links.append(np.concatenate([_to_rest(points, piece == one) for one in smallest]))
        piece = _merged(piece, links[-1])
    ends = np.unique(np.sort(np.concatenate(links), axis=1), axis=0)
    weights = np.full(len(ends), _LINK_WEIGHT)
    graph = sp.coo_array((weights, (ends[:, 0], ends[:, 1])), shape=(n, n)).tocsr()
    graph = graph + graph.T
    return sp.diags_array(graph.sum(axis=1)) - graph


def _to_rest(points: FloatArray, mine: BoolArray) -> IntArray:
    """Link the vertices of one piece that are nearest to the rest, each to its nearest there."""
    inner, outer = np.flatnonzero(mine), np.flatnonzero(~mine)
    neighbours = np.arange(min(_LINKS, len(outer))) + 1
    apart, there = cKDTree(points[outer]).query(points[inner], neighbours)
    reach = min(np.sort(apart[:, 0])[:_LINKS][-1], apart.min() + _TOUCH)
    rows, columns = np.nonzero(apart <= np.minimum(apart[:, :1], reach) + _TIE)
    return np.column_stack([inner[rows], outer[there[rows, columns]]])


def _to_others(piece: IntArray, apart: FloatArray, there: IntArray) -> IntArray:
    """Link each piece to the nearest other among the neighbours (n, k) of its vertices."""
    apart = np.where(piece[there] != piece[:, None], apart, np.inf)
    least = np.full(piece.max() + 1, np.inf)
    np.minimum.at(least, piece, apart.min(axis=1))
    rows, columns = np.nonzero(np.isfinite(apart) & (apart <= least[piece, None] + _TIE))
    return np.column_stack([rows, there[rows, columns]])


def _merged(piece: IntArray, links: IntArray) -> IntArray:
    """Renumber pieces after links have joined some."""
    return np.asarray(label_linked(piece[links].T, int(piece.max()) + 1)[piece])
