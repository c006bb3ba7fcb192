"""Coarser meshes whose vertices are some of the fine one's, by collapses of edges.

Every collapse moves a vertex onto a neighbour, the cheapest first: cheap is what leaves the faces'
planes little (Garland and Heckbert 1997) and is short. A collapse that would pinch the surface,
fold it, part it or eat into its boundary is not made, so that thin limbs stay tubes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from unbend._arrays import sum_rows
from unbend._compiled import compiled
from unbend._types import FloatArray, IntArray
from unbend.mesh._mesh import face_normals
from unbend.mesh._topology import Edges, faces_around, find_edges

# Beside the squared distance from the planes around it, a vertex pays this share of the squared
# length of its way: where the surface is flat, that alone keeps the coarse vertices even.
_EVENNESS = 0.1
# Of the edges, the cheapest of which each round collapses those that do not touch each other.
_SHARE_OF_EDGES = 0.4


class Decimated(NamedTuple):
    """A coarser mesh."""

    kept: IntArray  # its vertices among the fine mesh's, ascending
    faces: IntArray  # of the coarse vertices
    parents: IntArray  # the coarse vertex that each fine vertex became


def decimate(vertices: FloatArray, faces: IntArray, count: int) -> Decimated:
    """Collapse edges until `count` vertices, all in use, are left, or no collapse is allowed."""
    n = len(vertices)
    faces = np.array(faces, dtype=np.int64)
    edges = find_edges(faces, n)
    boundary = np.isin(np.arange(n), edges.ends[edges.n_faces != 2])
    quadrics = _quadrics(vertices, faces, edges)
    parents = np.arange(n)
    left = n
    while left > count:
        start, ring = faces_around(faces, n)
        ends, costs = np.empty((3 * len(faces), 2), np.int64), np.empty(3 * len(faces))
        _costs(vertices, faces, quadrics, ends, costs)
        cheap = int(_SHARE_OF_EDGES * len(costs)) + 1
        order = np.flatnonzero(costs <= np.partition(costs, cheap)[cheap])
        order = order[np.argsort(costs[order], kind="stable")]
        state = vertices, faces, start, ring, ends[order], boundary, quadrics, parents
        done = _collapse(*state, np.zeros(n, dtype=bool), np.full(n, -1), left - count)
        if not done:
            break
        faces = faces[faces[:, 0] >= 0]
        left -= done
    while (parents[parents] != parents).any():
        parents = parents[parents]
    kept, places = np.unique(parents, return_inverse=True)
    return Decimated(kept, places[faces], places)


def _quadrics(vertices: FloatArray, faces: IntArray, edges: Edges) -> FloatArray:
    """Sum up at each vertex, (n, 11): ten coefficients of squared distances, and the area.

    The distances are from the planes of the faces and, along the boundary, from planes that stand
    on it, by area and by squared length.
    """
    normal = face_normals(vertices, faces)
    twice = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(twice, np.finfo(float).tiny)[:, None]
    own = np.column_stack([_squares(normal, vertices[faces[:, 0]]), np.ones(len(faces))])
    rows, values = [faces.ravel()], [np.repeat(own * twice[:, None] / 6, 3, axis=0)]
    for i in range(3):
        open_edges = np.flatnonzero(edges.n_faces[edges.of_side[i::3]] == 1)
        ends = faces[open_edges, i], faces[open_edges, (i + 1) % 3]
        wall = np.cross(normal[open_edges], vertices[ends[1]] - vertices[ends[0]])
        squares = np.column_stack([_squares(wall, vertices[ends[0]]), np.zeros(len(open_edges))])
        rows += ends
        values += [squares, squares]
    return sum_rows(np.concatenate(rows), np.concatenate(values), len(vertices))


def _squares(normals: FloatArray, points: FloatArray) -> FloatArray:
    """Coefficients, (m, 10), of the squared distance from planes, times that of the normals."""
    planes = np.column_stack([normals, -(normals * points).sum(axis=1)])
    rows, columns = np.triu_indices(4)
    return np.asarray(planes[:, rows] * planes[:, columns])


@compiled
def _costs(vertices, faces, q, ends, costs):  # type: ignore[no-untyped-def]
    """Every side of every face in its cheaper direction, and its cost by the quadrics q."""
    for f in range(len(faces)):
        for c in range(3):
            u, v = faces[f, c], faces[f, (c + 1) % 3]
            k = 3 * f + c
            costs[k] = np.inf
            for _ in range(2):  # u moves onto v, or v onto u
                x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
                total = (
                    (q[u, 0] + q[v, 0]) * x * x
                    + (q[u, 4] + q[v, 4]) * y * y
                    + (q[u, 7] + q[v, 7]) * z * z
                    + q[u, 9]
                    + q[v, 9]
                )
                total += 2 * (
                    (q[u, 1] + q[v, 1]) * x * y
                    + (q[u, 2] + q[v, 2]) * x * z
                    + (q[u, 5] + q[v, 5]) * y * z
                )
                total += 2 * (
                    (q[u, 3] + q[v, 3]) * x + (q[u, 6] + q[v, 6]) * y + (q[u, 8] + q[v, 8]) * z
                )
                x, y, z = vertices[u, 0] - x, vertices[u, 1] - y, vertices[u, 2] - z
                cost = max(total, 0.0) + _EVENNESS * q[u, 10] * (x * x + y * y + z * z)
                if cost < costs[k]:
                    ends[k, 0], ends[k, 1], costs[k] = u, v, cost
                u, v = v, u


@compiled
def _turns_over(vertices, faces, f, u, v):  # type: ignore[no-untyped-def]
    """Whether moving u onto v would turn a face over or flatten it."""
    c = 0
    while faces[f, c] != u:
        c += 1
    p, q = vertices[faces[f, (c + 1) % 3]], vertices[faces[f, (c + 2) % 3]]
    o, w = vertices[u], vertices[v]
    agreement = 0.0
    for a in range(3):
        b, d = (a + 1) % 3, (a + 2) % 3
        before = (p[b] - o[b]) * (q[d] - o[d]) - (p[d] - o[d]) * (q[b] - o[b])
        after = (p[b] - w[b]) * (q[d] - w[d]) - (p[d] - w[d]) * (q[b] - w[b])
        agreement += before * after
    return agreement <= 0


@compiled
def _stays_joined(faces, f, start, ring, u, v):  # type: ignore[no-untyped-def]
    """Whether face f, which u and v share, is not all that joins its third corner to them."""
    tip = faces[f, 0] + faces[f, 1] + faces[f, 2] - u - v
    for e in range(start[tip], start[tip + 1]):
        ends = 0
        for c in range(3):
            w = faces[ring[e], c]
            ends += w in (u, v)
        if ends == 1:
            return True
    return False


@compiled
def _collapse(  # type: ignore[no-untyped-def]
    vertices, faces, start, ring, ends, boundary, quadrics, parents, touched, seen, most
):
    """Collapse edges in their order, each unless an earlier one has touched it; count them."""
    done = 0
    for k in range(len(ends)):
        if done == most:
            break
        u, v = ends[k, 0], ends[k, 1]
        if touched[u] or touched[v]:
            continue
        # The surface stays one where the ends' common neighbours are the shared faces' tips.
        shared, common, allowed = 0, 0, True
        for e in range(start[u], start[u + 1]):
            f = ring[e]
            has = False
            for c in range(3):
                w = faces[f, c]
                has |= w == v
                seen[w] = k
                allowed &= not touched[w]
            shared += has
            if has:
                allowed = allowed and _stays_joined(faces, f, start, ring, u, v)
            else:
                allowed = allowed and not _turns_over(vertices, faces, f, u, v)
        seen[u] = seen[v] = -1
        for e in range(start[v], start[v + 1]):
            for c in range(3):
                w = faces[ring[e], c]
                if seen[w] == k:
                    seen[w] = -1
                    common += 1
        sides = 1 if boundary[u] else 2
        if not allowed or shared != sides or common != sides or boundary[u] > boundary[v]:
            continue
        for e in range(start[v], start[v + 1]):
            for c in range(3):
                touched[faces[ring[e], c]] = True
        for e in range(start[u], start[u + 1]):
            f = ring[e]
            has = False
            for c in range(3):
                touched[faces[f, c]] = True
                has |= faces[f, c] == v
            if has:
                faces[f, 0] = -1
            else:
                for c in range(3):
                    if faces[f, c] == u:
                        faces[f, c] = v
        for c in range(quadrics.shape[1]):  # row by row would compile for seconds
            quadrics[v, c] += quadrics[u, c]
        parents[u] = v
        done += 1
    return done
