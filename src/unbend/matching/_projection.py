"""From vertices to points on faces."""

from __future__ import annotations

import numpy as np

from unbend._types import FloatArray, IntArray


def closest_faces(
    points: FloatArray, positions: FloatArray, triangles: IntArray, vertices: IntArray
) -> tuple[IntArray, FloatArray]:
    """Nearest point to each given point on the faces around a given vertex.

    Parameters
    ----------
    points : (n, d) ndarray of float64
    positions : (m, d) ndarray of float64
        Vertices of the surface to land on.
    triangles : (f, 3) ndarray of int64
    vertices : (n,) ndarray of int64
        The vertex of that surface around which to look.

    Returns
    -------
    faces : (n,) ndarray of int64
    weights : (n, 3) ndarray of float64
        Barycentric coordinates: non-negative, each row sums to one.
    """
    corner = np.argsort(triangles.ravel(), kind="stable")
    start = np.searchsorted(triangles.ravel()[corner], np.arange(len(positions) + 1))
    fan = start[vertices + 1] - start[vertices]
    best = np.full(len(points), np.inf)
    faces = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), 3))
    for turn in range(int(fan.max(initial=0))):
        rows = np.flatnonzero(fan > turn)
        candidates = corner[start[vertices[rows]] + turn] // 3
        found = project_to_triangles(points[rows], positions[triangles[candidates]])
        landed = np.einsum("ij,ijk->ik", found, positions[triangles[candidates]])
        distance = ((landed - points[rows]) ** 2).sum(axis=1)
        better = distance < best[rows]
        best[rows[better]] = distance[better]
        faces[rows[better]] = candidates[better]
        weights[rows[better]] = found[better]
    return faces, weights


def project_to_triangles(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Barycentric coordinates (n, 3) of the point of each triangle (n, 3, d) nearest to a point."""
    best = np.full(len(points), np.inf)
    weights = np.zeros((len(points), 3))

    def offer(candidate: FloatArray, allowed: FloatArray) -> None:
        position = np.einsum("ij,ijk->ik", candidate, corners)
        distance = np.where(allowed, ((position - points) ** 2).sum(axis=1), np.inf)
        better = distance < best
        best[better] = distance[better]
        weights[better] = candidate[better]

    tiny = np.finfo(float).tiny
    for i in range(3):
        j = (i + 1) % 3
        edge = corners[:, j] - corners[:, i]
        along = ((points - corners[:, i]) * edge).sum(axis=1) / np.maximum((edge**2).sum(1), tiny)
        candidate = np.zeros((len(points), 3))
        candidate[:, j] = np.clip(along, 0, 1)
        candidate[:, i] = 1 - candidate[:, j]
        offer(candidate, np.ones(len(points)))
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    offset = points - corners[:, 0]
    a, b, c = (first**2).sum(1), (first * second).sum(1), (second**2).sum(1)
    p, q = (offset * first).sum(1), (offset * second).sum(1)
    determinant = a * c - b * b
    safe = np.where(determinant > 0, determinant, 1)
    u, v = (c * p - b * q) / safe, (a * q - b * p) / safe
    inside = (determinant > 0) & (u >= 0) & (v >= 0) & (u + v <= 1)
    offer(np.stack([np.maximum(1 - u - v, 0), u, v], axis=1), inside.astype(float))
    return weights
