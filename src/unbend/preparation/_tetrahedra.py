"""The surface among the faces of the Delaunay tetrahedra of points, by a minimum cut.

Lempitsky & Boykov, "Global optimization for shape fitting", CVPR 2007; Labatut, Pons & Keriven,
"Robust and efficient surface reconstruction from range data", CGF 2009. Parts that nearly touch
stay apart, because tetrahedra in the gap between them are as thin as the gap.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial import Delaunay

from unbend._arrays import unit_vectors
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.mesh import find_edges, label_linked, minimum_cut

LONGEST = 3.0  # edge of a face of the surface, in spacings of the points
_FLAT = 1e-9  # volume of a tetrahedron without a ball, in cubes of its longest edge
_LARGE = 2.0  # radius of a ball that is on one side of the surface, in spacings
_CERTAIN = 0.2  # distance of its winding number from that of the surface
_SMOOTHNESS = 0.5  # weight of the area of the surface, beside its flux
_LEVELS = 1000  # of the capacity of a face of mean area, which is a whole number
_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])  # wound outward
_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
_SIDES = np.array([[3, 5, 4], [2, 5, 1], [0, 4, 2], [1, 3, 0]])  # edges of each face, as it winds


class Tetrahedra(NamedTuple):
    """Delaunay tetrahedra of points (n, 3), between which the distances around each are spacing."""

    points: FloatArray
    spacing: FloatArray  # (n,)
    corners: IntArray  # (t, 4) points, positively oriented
    beyond: IntArray  # (t, 4) the tetrahedron beyond the face opposite each corner, -1 for none
    centres: FloatArray  # (t, 3) of the empty ball through the corners
    radii: FloatArray  # (t,) of that ball, 0 for flat tetrahedra
    lengths: FloatArray  # (t, 4) longest edge of each face, in spacings


def make_tetrahedra(points: FloatArray, spacing: FloatArray) -> Tetrahedra:
    """Make the Delaunay tetrahedra of points (n, 3)."""
    found = Delaunay(points)
    corners, beyond = found.simplices.astype(np.int64), found.neighbors.astype(np.int64)
    edges = points[corners[:, 1:]] - points[corners[:, :1]]
    volumes = np.linalg.det(edges)
    inverted = volumes < 0
    for one in (corners, beyond):
        one[inverted] = one[inverted][:, [1, 0, 2, 3]]
    flat = np.abs(volumes) <= _FLAT * np.linalg.norm(edges, axis=2).max(axis=1) ** 3
    edges[flat] = np.eye(3)
    away = np.linalg.solve(edges, (edges**2).sum(axis=2, keepdims=True) / 2)[..., 0]
    away[flat] = 0
    # The first corner is that of the simplex as it was found.
    centres = points[found.simplices[:, 0]] + away
    faces = corners[:, _FACES]
    sides = np.linalg.norm(points[faces] - points[np.roll(faces, 1, axis=2)], axis=3)
    lengths = sides.max(axis=2) / spacing[faces].mean(axis=2)
    radii = np.linalg.norm(away, axis=1)
    return Tetrahedra(points, spacing, corners, beyond, centres, radii, lengths)


def find_inside(tetrahedra: Tetrahedra, normals: FloatArray, winding: FloatArray) -> BoolArray:
    """Choose the tetrahedra (t,) that are inside, by a minimum cut.

    ``normals`` (n, 3) are those of the points; ``winding`` (t,) is the winding number in the ball
    of each tetrahedron, less that of the surface.
    """
    points, spacing, length = tetrahedra.points, tetrahedra.spacing, tetrahedra.lengths
    beyond, radii = tetrahedra.beyond, tetrahedra.radii
    corners = tetrahedra.corners[:, _FACES]
    sides = [points[corners[:, :, i]] - points[corners[:, :, i - 1]] for i in range(3)]
    areas = np.cross(sides[1], sides[2]) / 2
    area = np.linalg.norm(areas, axis=2)
    directions = unit_vectors(areas)
    facing = np.einsum("tfi,tfi->tf", directions, normals[corners].mean(axis=2))
    flux = np.where(length <= LONGEST, facing * area, 0).sum(axis=1)
    certain = radii > _LARGE * spacing[tetrahedra.corners].mean(axis=1)
    flux += np.where(certain, np.clip(winding / _CERTAIN, -1, 1), 0) * area.mean()
    area *= np.minimum(1, LONGEST / np.maximum(length, 1e-300)) ** 2
    # How far the centre of the ball is inwards from each face, in radii.
    depth = np.einsum(
        "tfi,tfi->tf", points[corners[:, :, 0]] - tetrahedra.centres[:, None], directions
    )
    depth /= np.where(radii > 0, radii, np.inf)[:, None]
    first, face = np.nonzero(beyond >= 0)
    second = beyond[first, face]
    back = (beyond[second] == first[:, None]).argmax(axis=1)
    quality = 1 - np.minimum(depth[first, face], depth[second, back])
    hull = np.where(beyond < 0, area, 0).sum(axis=1)
    costs = _SMOOTHNESS * area[first, face] * quality
    gains = flux - _SMOOTHNESS * hull
    return minimum_cut(gains, np.stack([first, second]), costs, area.mean() / _LEVELS)


def boundary(tetrahedra: Tetrahedra, inside: BoolArray) -> tuple[IntArray, IntArray, BoolArray]:
    """Find the faces between inside and outside, and where they meet.

    Where more than two meet at an edge, the tetrahedra around it are taken from the inside. Rings
    of tetrahedra are cut (:func:`_joined`), and the faces of a cut close both of its ends.

    Returns the points of the faces (m, 3), wound outward, the edge (m, 3) from each corner to the
    next, where two faces meet, and whether a face (m,) is of a cut.
    """
    corners, beyond, n = tetrahedra.corners, tetrahedra.beyond, len(tetrahedra.points)
    ends = np.sort(corners[:, _EDGES], axis=2)
    keys = ends[..., 0] * n + ends[..., 1]
    while True:
        of, face = np.nonzero(inside[:, None] & ~np.append(inside, False)[beyond])
        found = find_edges(corners[of[:, None], _FACES[face]], n)
        several = found.ends[found.n_faces > 2]
        if not len(several):
            break
        inside = inside & ~np.isin(keys, several[:, 0] * n + several[:, 1]).any(axis=1)
    number = np.unique(keys, return_inverse=True)[1].reshape(-1, 6)
    joined = _joined(tetrahedra, inside, number)
    # Around an edge, tetrahedra that are joined lead from one face to the next.
    first, through = np.nonzero(joined)
    second, sides = beyond[first, through], _SIDES[through]
    place = (number[second][:, None] == number[first[:, None], sides][..., None]).argmax(axis=2)
    links = (6 * first[:, None] + sides).ravel(), (6 * second[:, None] + place).ravel()
    edge = label_linked(links, number.size)
    of, face = np.nonzero(inside[:, None] & ~joined)
    faces = corners[of[:, None], _FACES[face]]
    return faces, edge[6 * of[:, None] + _SIDES[face]], np.append(inside, False)[beyond[of, face]]


def _joined(tetrahedra: Tetrahedra, inside: BoolArray, number: IntArray) -> BoolArray:
    """Join the tetrahedra inside through faces (t, 4), without rings unless they are thick.

    First a tree joins them through the longest faces. A face then joins two tetrahedra if all
    others around one of its edges do so, the longest ones first, and at last if others around one
    of its corners join them. The faces that are left cut each ring of tetrahedra where it is
    narrowest. A face that is too long for the surface is not left. ``number`` (t, 6) is that of
    each edge.
    """
    corners, beyond, n = tetrahedra.corners, tetrahedra.beyond, len(inside)
    length = tetrahedra.lengths
    within = inside[:, None] & np.append(inside, False)[beyond]
    first, face = np.nonzero(within & (beyond > np.arange(n)[:, None]))
    order = np.argsort(-length[first, face], kind="stable")
    first, face = first[order], face[order]  # from now on the longest faces come first
    second = beyond[first, face]
    ranks = sp.csr_array((np.arange(1.0, len(first) + 1), (first, second)), shape=(n, n))
    joins = np.zeros(len(first), dtype=bool)
    joins[minimum_spanning_tree(ranks).data.astype(np.int64) - 1] = True
    around = number[first[:, None], _SIDES[face]]
    # Of the faces around an edge that do not join: how many, and the sum of their indices.
    rest = np.flatnonzero(~joins)
    missing = np.bincount(around[rest].ravel(), minlength=number.max() + 1)
    total = np.bincount(around[rest].ravel(), np.repeat(rest, 3), minlength=number.max() + 1)
    of, outer = np.nonzero(inside[:, None] & ~within)
    missing[number[of[:, None], _SIDES[outer]]] += 2  # edges of the surface never lack one only
    ready = (length[first, face] > LONGEST) | (missing[around] == 1).any(axis=1)
    queue = np.flatnonzero(~joins & ready).tolist()
    heapify(queue)
    lacking, last = missing.tolist(), total.astype(np.int64).tolist()
    while queue:
        one = heappop(queue)
        if joins[one]:
            continue
        joins[one] = True
        for edge in around[one].tolist():
            lacking[edge] -= 1
            last[edge] -= one
            if lacking[edge] == 1:
                heappush(queue, last[edge])
    # A ring around a corner is filled: fans of the surface there get vertices of their own.
    here = corners[first[:, None], _FACES[face]]
    place = (corners[second][:, None] == here[..., None]).argmax(axis=2)
    ends = 4 * first[:, None] + _FACES[face], 4 * second[:, None] + place
    while True:
        links = ends[0][joins].ravel(), ends[1][joins].ravel()
        around_corner = label_linked(links, corners.size)
        ready = ~joins & (around_corner[ends[0]] == around_corner[ends[1]]).any(axis=1)
        if not ready.any():
            break
        joins |= ready
    joined = np.zeros(beyond.shape, dtype=bool)
    joined[first[joins], face[joins]] = True
    joined[second[joins], (beyond[second] == first[:, None]).argmax(axis=1)[joins]] = True
    return joined


def split(faces: IntArray, edges: IntArray) -> tuple[IntArray, IntArray]:
    """Give each fan of faces a vertex of its own: the point of each vertex, and the faces.

    ``edges`` are those from each corner (m, 3) to the next.
    """
    corners = np.arange(3 * len(faces)).reshape(-1, 3)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    own = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    swapped = ends[:, 0] > ends[:, 1]
    own[swapped] = own[swapped, ::-1]
    order = np.argsort(edges, axis=None, kind="stable")
    same = np.flatnonzero(np.diff(edges.ravel()[order]) == 0)
    links = own[order[same]].ravel(), own[order[same + 1]].ravel()
    vertex = label_linked(links, faces.size)
    return faces.ravel()[np.unique(vertex, return_index=True)[1]], vertex.reshape(-1, 3)
