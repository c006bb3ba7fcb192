"""Edges, components and fans of a triangle mesh, as whole-array operations."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_matrix, csr_array, csr_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components, maximum_flow

from unbend._arrays import first_equal_row
from unbend._parallel import slices
from unbend._types import BoolArray, FloatArray, IntArray

# A face is degenerate when its height over its longest edge is at most this fraction of that
# edge. It is about the square root of double precision: below it, the cotangent of the smallest
# angle has lost half of its digits and outweighs every other face.
DEGENERATE_HEIGHT = 1e-8

# Faces measured at once: their temporaries stay in the cache.
FACES_AT_ONCE = 2**14


class Edges(NamedTuple):
    """The undirected edges of a mesh."""

    ends: IntArray  # (n_edges, 2), the lower vertex first
    n_faces: IntArray  # faces at each edge
    n_upward: IntArray  # how many of them walk from the lower to the higher vertex
    of_side: IntArray  # (3 m,) edge of side k, from corner k to the next, of face i, at 3 i + k

    @property
    def n_boundary_loops(self) -> int:
        """Number of connected pieces of the boundary."""
        boundary = self.ends[self.n_faces == 1]
        labels = label_linked(boundary.T, int(self.ends.max(initial=0)) + 1)
        return len(np.unique(labels[boundary[:, 0]]))


def find_edges(faces: IntArray, n_vertices: int) -> Edges:
    """Collect the edges of faces that name three different vertices."""
    tail, head = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    upward = tail < head
    key = np.where(upward, tail * n_vertices + head, head * n_vertices + tail)
    found, of_side, n_faces = np.unique(key, return_inverse=True, return_counts=True)
    ends = np.column_stack(np.divmod(found, max(n_vertices, 1)))
    n_upward = np.bincount(of_side[upward], minlength=len(found))
    return Edges(ends, n_faces, n_upward, of_side)


def edge_ends(faces: IntArray, n_vertices: int) -> IntArray:
    """Pairs of vertices that an edge joins, each once: (e, 2), the lower one first, ascending.

    A side from a vertex to itself, as of a face that names one twice, is no edge.
    """
    ends = find_edges(faces, n_vertices).ends
    return np.asarray(ends[ends[:, 0] != ends[:, 1]])


def faces_around(faces: IntArray, n_vertices: int) -> tuple[IntArray, IntArray]:
    """List the faces around each vertex, ascending, in compressed rows (starts, faces)."""
    corner = np.arange(faces.size)
    fans = csr_matrix((corner, (faces.ravel(), corner // 3)), shape=(n_vertices, len(faces)))
    return fans.indptr.astype(np.int64), fans.indices.astype(np.int64)


def other_sides(edges: Edges) -> IntArray:
    """For each side the other one at its edge, -1 where the edge has not exactly two."""
    side = np.arange(len(edges.of_side))
    # The numbers of an edge's two sides, summed, less one of them is the other one.
    other = np.bincount(edges.of_side, side).astype(np.int64)[edges.of_side] - side
    return np.where(edges.n_faces[edges.of_side] == 2, other, -1)


def label_linked(links: Any, n: int) -> IntArray:
    """Label n nodes, (n,), so that nodes joined by links (2, m) or chains of them share a label."""
    graph = coo_matrix((np.ones(len(links[0]), np.int8), tuple(links)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1])


def minimum_cut(gains: FloatArray, links: IntArray, costs: FloatArray, unit: float) -> BoolArray:
    """Choose some of n nodes (n,), so that what they gain, less what cuts cost, is the most.

    A link (2, m) is cut, at its cost (m,) of 0 or more, if its first node is chosen and its second
    is not. Gains and costs are rounded to whole multiples of ``unit``.
    """
    n = len(gains)
    nodes = np.arange(n)
    source, sink = n, n + 1
    tail = np.concatenate([links[0], np.where(gains > 0, source, nodes)])
    head = np.concatenate([links[1], np.where(gains > 0, nodes, sink)])
    capacity = np.minimum(np.concatenate([costs, np.abs(gains)]) / unit, 2**30)
    whole = np.rint(capacity).astype(np.int32)
    graph = csr_array((whole, (tail, head)), shape=(n + 2, n + 2))
    left = graph - maximum_flow(graph, source, sink).flow
    left.eliminate_zeros()
    return np.isin(nodes, breadth_first_order(left, source, return_predecessors=False))


class Components(NamedTuple):
    """The connected components, largest first."""

    of_vertex: IntArray  # (n,) -1 for vertices that no face uses
    n_vertices: IntArray  # of each component
    n_faces: IntArray


def find_components(faces: IntArray, n_vertices: int) -> Components:
    """Group the vertices that faces connect; a face that names a vertex twice connects none."""
    faces = proper_faces(faces)
    index = faces.astype(np.int32)
    # Labels ascend with the first vertex of each component. A vertex in no face has its own.
    label = label_linked((index[:, [0, 0]].ravel(), index[:, 1:].ravel()), n_vertices)
    vertex_count = np.bincount(label)
    face_count = np.bincount(label[faces[:, 0]], minlength=len(vertex_count))
    # Most vertices first, then most faces, then the earliest vertex: never up to chance.
    order = np.lexsort([-face_count, -vertex_count])[: np.count_nonzero(face_count)]
    place = np.full(len(face_count), -1)
    place[order] = np.arange(len(order))
    return Components(place[label], vertex_count[order], face_count[order])


def count_non_manifold_vertices(faces: IntArray, edges: Edges) -> int:
    """Count vertices whose faces, of three different vertices each, form more than one fan.

    Two faces at a vertex are in the same fan if a chain of edges at that vertex joins them.
    """
    if len(faces) == 0:
        return 0
    # Each edge has a node at either end; a corner links those of the sides that leave and reach it.
    side = 2 * edges.of_side.reshape(-1, 3).astype(np.int32)
    upward = faces < faces[:, [1, 2, 0]]
    leaving = (side + ~upward).ravel()
    reaching = (side + upward)[:, [2, 0, 1]].ravel()
    fan = label_linked((leaving, reaching), 2 * len(edges.ends))[leaving]
    vertex_of_fan = np.empty(fan.max() + 1, dtype=np.int64)
    vertex_of_fan[fan] = faces.ravel()
    return int((np.bincount(vertex_of_fan) > 1).sum())


def has_repeated_index(faces: IntArray) -> BoolArray:
    """Which faces name a vertex twice."""
    a, b, c = faces.T
    return np.asarray((a == b) | (b == c) | (c == a))


def has_earlier_twin(faces: IntArray) -> BoolArray:
    """Which faces have the three vertices of an earlier one, in any order."""
    return np.asarray(first_equal_row(np.sort(faces, axis=1)) != np.arange(len(faces)))


def proper_faces(faces: IntArray) -> IntArray:
    """Select the faces that name three different vertices: only they have edges."""
    repeated = has_repeated_index(faces)
    return faces[~repeated] if repeated.any() else faces


def measure_faces(vertices: FloatArray, faces: IntArray) -> tuple[BoolArray, float]:
    """Which faces are degenerate (see ``DEGENERATE_HEIGHT``), and the area of all, in any unit."""
    degenerate = np.empty(len(faces), dtype=bool)
    area = 0.0
    for part in slices(len(faces), FACES_AT_ONCE):
        degenerate[part], part_area = _measure(vertices, faces[part])
        area += part_area
    return degenerate, area


def _measure(vertices: FloatArray, faces: IntArray) -> tuple[BoolArray, float]:
    a, b, c = (vertices[faces[:, k]] / 4 for k in range(3))  # / 4: no difference overflows
    u, v = b - a, c - a  # in units of the longest, so that no product overflows or vanishes
    scale = float(max(u.max(), -u.min(), v.max(), -v.min()))
    if scale > 0:
        u /= scale
        v /= scale
    normal = np.empty_like(u)  # np.cross, without its temporaries
    normal[:, 0] = u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1]
    normal[:, 1] = u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2]
    normal[:, 2] = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    twice_area = np.sqrt(np.einsum("ij,ij->i", normal, normal))
    w = v - u
    longest_squared = np.maximum.reduce([np.einsum("ij,ij->i", x, x) for x in (u, v, w)])
    degenerate: BoolArray = twice_area <= DEGENERATE_HEIGHT * longest_squared
    area = float(twice_area.sum()) / 2 * (4 * scale) * (4 * scale)
    return degenerate | has_repeated_index(faces), area
