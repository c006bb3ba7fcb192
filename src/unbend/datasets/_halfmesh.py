"""Edge collapses and flips that keep a triangle mesh a manifold.

The mesh is one side of a symmetric surface: no operation may then join two border vertices,
which lie on the mirror plane, by an inner edge.
"""

from __future__ import annotations

import numpy as np

from unbend._types import BoolArray, FloatArray, IntArray
from unbend.mesh import edge_ends, face_normals, find_edges, other_sides

_ROUNDS = 6  # of flips at most


def collapse_short_edges(
    vertices: FloatArray, faces: IntArray, on_plane: BoolArray, sizes: FloatArray, excess: int
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Remove up to ``excess`` vertices of the whole surface; edges short for their ``sizes`` go."""
    edges = edge_ends(faces, len(vertices))
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    lengths /= sizes[edges].mean(axis=1)
    order = np.argsort(lengths, kind="stable")
    order = order[lengths[order] < 2.5 * np.median(lengths)]
    places, triangles = vertices.tolist(), faces.tolist()
    around: list[set[int]] = [set() for _ in range(len(vertices))]
    for f, triangle in enumerate(triangles):
        for vertex in triangle:
            around[vertex].add(f)
    ring: list[set[int]] = [set() for _ in range(len(vertices))]
    for a, b in edges.tolist():
        ring[a].add(b)
        ring[b].add(a)
    border = on_plane.tolist()
    touched = [False] * len(vertices)
    gone = np.zeros(len(vertices), dtype=bool)
    dead = np.zeros(len(faces), dtype=bool)

    for a, b in edges[order].tolist():
        if excess <= 0:
            break
        if touched[a] or touched[b]:
            continue
        if border[a] and not border[b]:
            a, b = b, a  # the vertex on the plane stays
        cost = 1 if border[a] else 2
        shared = around[a] & around[b]
        if cost > excess or (border[a] and border[b] and len(shared) == 2):
            continue
        ring_a, ring_b = ring[a], ring[b]
        common = ring_a & ring_b
        if len(common) != len(shared):
            continue
        if any(len(around[u]) <= (2 if border[u] else 4) for u in common):
            continue  # a vertex opposite the edge would be left with too few faces
        joins_plane = border[b] and not border[a]
        if joins_plane and any(border[u] and u not in ring_b for u in ring_a - {b}):
            continue
        # No limb may become a triangular tube, which smoothing would pinch off.
        only_b = ring_b - ring_a - {a}
        if any(not only_b.isdisjoint(ring[u]) for u in ring_a - ring_b - {b}):
            continue
        if not _keeps_normals(places, triangles, around[a] - shared, a, b):
            continue
        for vertex in (a, b, *common):
            around[vertex] -= shared
            touched[vertex] = True
        for f in around[a]:
            triangles[f] = [b if vertex == a else vertex for vertex in triangles[f]]
        around[b] |= around[a]
        for u in ring_a - {b}:
            ring[u] = ring[u] - {a} | {b}
        ring[b] = (ring_a | ring_b) - {a, b}
        dead[list(shared)] = True
        gone[a] = True
        excess -= cost
    number = np.cumsum(~gone) - 1
    kept = np.array(triangles, dtype=np.int64)[~dead]
    return vertices[~gone], number[kept], on_plane[~gone]


def _keeps_normals(
    places: list[list[float]], triangles: list[list[int]], kept: set[int], a: int, b: int
) -> bool:
    """Whether no face turns by more than about 75 degrees when ``a`` moves onto ``b``."""
    (bx, by, bz), (ax, ay, az) = places[b], places[a]
    for f in kept:
        triangle = triangles[f]
        i = triangle.index(a)
        px, py, pz = places[triangle[i - 2]]
        qx, qy, qz = places[triangle[i - 1]]
        ex, ey, ez = qx - px, qy - py, qz - pz
        ox, oy, oz = _cross(ex, ey, ez, ax - px, ay - py, az - pz)
        nx, ny, nz = _cross(ex, ey, ez, bx - px, by - py, bz - pz)
        sizes = (ox * ox + oy * oy + oz * oz) * (nx * nx + ny * ny + nz * nz)
        if ox * nx + oy * ny + oz * nz <= 0.25 * sizes**0.5:
            return False
    return True


def _cross(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float
) -> tuple[float, float, float]:
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def delaunay_flips(vertices: FloatArray, faces: IntArray, on_plane: BoolArray) -> IntArray:
    """Flip edges whose two opposite angles add up to more than 180 degrees."""
    faces = faces.copy()
    n = len(vertices)
    for _ in range(_ROUNDS):
        tails, heads = faces.ravel(), faces[:, [1, 2, 0]].ravel()
        apexes = faces[:, [2, 0, 1]].ravel()
        edges = find_edges(faces, n)
        twin = other_sides(edges)
        one = np.flatnonzero((twin >= 0) & (tails < heads))
        two = twin[one]
        a, b, c, d = tails[one], heads[one], apexes[one], apexes[two]
        excess = _angle(vertices, c, a, b) + _angle(vertices, d, b, a) - np.pi
        valid = (excess > 1e-6) & ~(on_plane[c] & on_plane[d])
        new_keys = np.minimum(c, d) * n + np.maximum(c, d)
        valid &= ~np.isin(new_keys, edges.ends @ [n, 1])
        flipped = np.column_stack([c, a, d]), np.column_stack([d, b, c])
        first, second = (face_normals(vertices, new) for new in flipped)
        old = face_normals(vertices, np.column_stack([a, b, c]))
        old += face_normals(vertices, np.column_stack([b, a, d]))
        valid &= (np.einsum("ni,ni->n", first, old) > 0) & (np.einsum("ni,ni->n", second, old) > 0)
        valid &= np.einsum("ni,ni->n", first, second) > 0
        # A face takes part in one flip at a time: its edge with the largest excess.
        score = np.where(valid, excess, -1.0)
        best = np.full(len(faces), -1.0)
        np.maximum.at(best, one // 3, score)
        np.maximum.at(best, two // 3, score)
        chosen = np.flatnonzero(valid & (score == best[one // 3]) & (score == best[two // 3]))
        chosen = chosen[np.unique(new_keys[chosen], return_index=True)[1]]
        used: IntArray = np.concatenate([one[chosen] // 3, two[chosen] // 3])
        clash = np.bincount(used, minlength=len(faces)) > 1
        chosen = chosen[~clash[one[chosen] // 3] & ~clash[two[chosen] // 3]]
        if len(chosen) == 0:
            break
        for side, new in zip((one, two), flipped, strict=True):
            faces[side[chosen] // 3] = new[chosen]
    return faces


def _angle(vertices: FloatArray, apex: IntArray, p: IntArray, q: IntArray) -> FloatArray:
    u, v = vertices[p] - vertices[apex], vertices[q] - vertices[apex]
    across = np.linalg.norm(np.cross(u, v), axis=1)
    return np.asarray(np.arctan2(across, np.einsum("ni,ni->n", u, v)))
