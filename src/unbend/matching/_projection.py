"""From vertices to points on faces."""

from __future__ import annotations

import numpy as np

from unbend._compiled import compiled
from unbend._types import FloatArray, IntArray


def closest_faces(
    points: FloatArray,
    positions: FloatArray,
    triangles: IntArray,
    fans: tuple[IntArray, IntArray],
    vertices: IntArray,
) -> tuple[IntArray, FloatArray]:
    """Nearest point to each given point on the faces around a given vertex.

    Parameters
    ----------
    points : (n, d) ndarray of float64
    positions : (m, d) ndarray of float64
        Vertices of the surface to land on.
    triangles : (f, 3) ndarray of int64
    fans : two ndarrays of int64
        The faces around each vertex, in compressed rows.
    vertices : (n,) ndarray of int64
        The vertex of that surface around which to look.

    Returns
    -------
    faces : (n,) ndarray of int64
    weights : (n, 3) ndarray of float64
        Barycentric coordinates: non-negative, each row sums to one.
    """
    return _closest_faces(points, positions, triangles, vertices, *fans)  # type: ignore[no-any-return]


@compiled
def _closest_faces(points, positions, triangles, vertices, start, ring):  # type: ignore[no-untyped-def]
    n = len(points)
    faces, weights = np.zeros(n, np.int64), np.zeros((n, 3))
    gram, load, trial = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(n):
        best = np.inf
        for e in range(start[vertices[i]], start[vertices[i] + 1]):
            corner = triangles[ring[e]]
            # Squared distance of a point with weights w, about the point: w . gram w.
            for a in range(3):
                for b in range(a + 1):
                    total = 0.0
                    for c in range(points.shape[1]):
                        total += (positions[corner[a], c] - points[i, c]) * (
                            positions[corner[b], c] - points[i, c]
                        )
                    gram[a, b] = gram[b, a] = total
            distance = _least(gram, load, trial)
            if distance < best:
                best = distance
                faces[i] = ring[e]
                for c in range(3):
                    weights[i, c] = load[c]
    return faces, weights


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
