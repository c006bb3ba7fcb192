"""Closest points on a mesh, found near where a map leads already."""

from __future__ import annotations

import functools

import numpy as np

from unbend._compiled import compiled
from unbend._types import FloatArray, IntArray, SparseMatrix
from unbend.deformation._kernels import over_rows


@functools.partial(compiled, fastmath=frozenset({"reassoc"}))  # four times as fast
def _squared_distance(left, right, i, j, m):  # type: ignore[no-untyped-def]
    total = 0.0
    for c in range(left.shape[2]):
        difference = left[i, m, c] - right[j, m, c]
        total += difference * difference
    return total


def walk(
    left: FloatArray, right: FloatArray, guess: IntArray, ours: SparseMatrix, theirs: SparseMatrix
) -> IntArray:
    """Improve maps by descent: from a vertex's image, or its neighbours' images, go downhill.

    Row i of ``left`` (n, ..., d) is brought to a nearby row of ``right`` (m, ..., d) such that no
    mesh neighbour of that row is closer; between vertices and coordinates there may be several
    maps, each with rows of its own. The meshes are matrices, in compressed rows, of neighbours.
    """
    before = guess.reshape(len(guess), -1)
    rows = (one.reshape(len(one), before.shape[1], -1) for one in (left, right))
    result = before.copy()
    graphs = (ours.indptr, ours.indices), (theirs.indptr, theirs.indices)
    over_rows(len(left), before.shape[1], _walk, *rows, before, *graphs, result)
    return result.reshape(guess.shape)


@compiled
def _walk(left, right, guess, ours, theirs, result, first, last):  # type: ignore[no-untyped-def]
    (left_start, left_neighbors), (right_start, right_neighbors) = ours, theirs
    for m in range(guess.shape[1]):
        for i in range(first, last):
            here = guess[i, m]
            best = _squared_distance(left, right, i, here, m)
            for e in range(left_start[i], left_start[i + 1]):
                candidate = guess[left_neighbors[e], m]
                if candidate != here:
                    distance = _squared_distance(left, right, i, candidate, m)
                    if distance < best:
                        best, here = distance, candidate
            moved = True
            while moved:
                moved = False
                center = here
                for e in range(right_start[center], right_start[center + 1]):
                    candidate = right_neighbors[e]
                    distance = _squared_distance(left, right, i, candidate, m)
                    if distance < best:
                        best, here, moved = distance, candidate, True
            result[i, m] = here


def closest_faces(
    points: FloatArray,
    positions: FloatArray,
    triangles: IntArray,
    fans: tuple[IntArray, IntArray],
    vertices: IntArray,
) -> tuple[IntArray, FloatArray]:
    """Nearest point to each given point (n, d) on the faces around a given vertex of a surface.

    The surface has `positions` (m, d). Returns faces (n,) and barycentric coordinates (n, 3).
    """
    n = len(points)
    faces, weights = np.zeros(n, dtype=np.int64), np.zeros((n, 3))
    _closest_faces(points, positions, triangles, vertices, fans, faces, weights)
    return faces, weights


@compiled
def _closest_faces(points, positions, triangles, vertices, fans, faces, weights):  # type: ignore[no-untyped-def]
    start, ring = fans
    gram, nearest, scratch = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(len(points)):
        best = np.inf
        for e in range(start[vertices[i]], start[vertices[i] + 1]):
            # Squared distance of a point with weights w, about the point: w . gram w.
            for a in range(3):
                for b in range(a + 1):
                    total = 0.0
                    for c in range(points.shape[1]):
                        left = positions[triangles[ring[e], a], c] - points[i, c]
                        right = positions[triangles[ring[e], b], c] - points[i, c]
                        total += left * right
                    gram[a, b] = gram[b, a] = total
            distance = _least(gram, nearest, scratch)
            if distance < best:
                best = distance
                faces[i] = ring[e]
                for c in range(3):
                    weights[i, c] = nearest[c]


@compiled
def _least(gram, best, trial):  # type: ignore[no-untyped-def]
    """Weights on a triangle, into `best`, of the least w . gram w: inside, or on a side."""
    least = np.inf
    for a in range(3):
        b = (a + 1) % 3
        length = gram[a, a] + gram[b, b] - 2 * gram[a, b]
        share = (gram[a, a] - gram[a, b]) / length if length > 0 else 0.0
        share = min(max(share, 0.0), 1.0)
        value = gram[a, a] - 2 * share * (gram[a, a] - gram[a, b]) + share * share * length
        if value < least:
            least = value
            best[a], best[b], best[(a + 2) % 3] = 1 - share, share, 0.0
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        trial[a] = (
            gram[b, b] * gram[c, c]
            - gram[b, c] ** 2
            + gram[a, b] * (gram[b, c] - gram[c, c])
            + gram[a, c] * (gram[b, c] - gram[b, b])
        )
    total = trial[0] + trial[1] + trial[2]
    if total > 0 and trial[0] >= 0 and trial[1] >= 0 and trial[2] >= 0:
        for a in range(3):
            trial[a] /= total  # the fourth power of a length: its square might not be a float64
        value = 0.0
        for a in range(3):
            for b in range(3):
                value += trial[a] * trial[b] * gram[a, b]
        if value < least:
            least = value
            for a in range(3):
                best[a] = trial[a]
    return least
