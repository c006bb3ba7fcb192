"""Polish: move the source onto the target as rigidly as possible, starting from a spectral map.

A map through smooth functions slides a little along featureless parts. Deforming the source
itself, every neighbourhood turned but hardly stretched (Sorkine & Alexa, "As-rigid-as-possible
surface modeling", SGP 2007), takes the slide out. Closest points are found by walking over the
meshes from where the map stands, so a leg is never caught by the leg beside it.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from unbend._kernels import edge_covariances, rotated_divergence, walk
from unbend._types import FloatArray, IntArray
from unbend.linalg.factorization import Factorization, factorize
from unbend.matching._shape import Shape, vertex_normals

# Pull towards the target, in units of 1 / area: stiffness and pull balance over a length that is
# the inverse of its square root, from a seventeenth of sqrt(area) to a fifty-fifth.
_PULLS = (300.0, 1000.0, 3000.0)
_STEPS_PER_PULL = 5
# Rotations are averaged over about this length: limbs turn as wholes, which keeps their ends
# from sliding, yet joints still bend.
_TURNING_LENGTH = 0.03
# Closest points are sought from where the last step leads to, which speeds up a slow slide.
_MOMENTUM = 0.7
_NORMAL_WEIGHT = 0.1


def register(
    source: Shape,
    target: Shape,
    functional_map: FloatArray,
    source_to_target: IntArray,
    target_to_source: IntArray,
) -> tuple[IntArray, IntArray, FloatArray]:
    """Polish a pair of point maps by a deformation of the source.

    Parameters
    ----------
    source, target : Shape
    functional_map : (k, k) ndarray of float64
        Gives the starting pose: the target's positions, pulled back smoothly.
    source_to_target, target_to_source : ndarrays of int64
        The maps to polish.

    Returns
    -------
    source_to_target, target_to_source : ndarrays of int64
    posed : (n, 3) ndarray of float64
        The deformed source.
    """
    k = len(functional_map)
    basis = source.basis[:, :k]
    posed = basis @ (functional_map @ target.position_coefficients[:k])
    smooth = basis @ source.position_coefficients[:k]
    spokes = source.spokes
    stiffness = sp.diags(np.asarray(spokes.sum(axis=1)).ravel()) - spokes
    mass = sp.diags(source.areas)
    average = factorize(mass + _TURNING_LENGTH**2 * stiffness)
    rotations = _rotations(source, average, smooth, posed)
    forward, backward = source_to_target, target_to_source
    ahead = posed
    for stage, pull in enumerate(_PULLS):
        # Both directions pull, each with the whole area: on average twice a vertex's own.
        system = factorize(stiffness + 2 * pull * mass)
        for step in range(_STEPS_PER_PULL):
            if stage + step:
                forward, backward = _closest(source, target, ahead, forward, backward)
            force = source.areas[:, None] * (target.vertices[forward] + ahead)
            force += _scatter(backward, target.areas[:, None] * target.vertices, len(ahead))
            force -= np.bincount(backward, target.areas, len(ahead))[:, None] * ahead
            turned = rotated_divergence(
                spokes.indptr, spokes.indices, spokes.data, source.vertices, rotations
            )
            before, posed = posed, system.solve(turned + pull * force)
            rotations = _rotations(source, average, source.vertices, posed)
            ahead = posed + _MOMENTUM * (posed - before)
    for _ in range(2):
        forward, backward = _closest(source, target, posed, forward, backward)
    return forward, backward, posed


def closest_faces(
    shape: Shape, points: FloatArray, vertices: IntArray
) -> tuple[IntArray, FloatArray]:
    """Nearest point to each given point on the faces around a given vertex.

    Parameters
    ----------
    shape : Shape
    points : (n, 3) ndarray of float64
    vertices : (n,) ndarray of int64

    Returns
    -------
    faces : (n,) ndarray of int64
    weights : (n, 3) ndarray of float64
        Barycentric coordinates: non-negative, each row sums to one.
    """
    count = len(shape.vertices)
    corner = np.argsort(shape.faces.ravel(), kind="stable")
    start = np.searchsorted(shape.faces.ravel()[corner], np.arange(count + 1))
    fan = start[vertices + 1] - start[vertices]
    best = np.full(len(points), np.inf)
    faces = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), 3))
    for turn in range(int(fan.max(initial=0))):
        rows = np.flatnonzero(fan > turn)
        candidates = corner[start[vertices[rows]] + turn] // 3
        found = project_to_triangles(points[rows], shape.vertices[shape.faces[candidates]])
        positions = np.einsum("ij,ijk->ik", found, shape.vertices[shape.faces[candidates]])
        distance = ((positions - points[rows]) ** 2).sum(axis=1)
        better = distance < best[rows]
        best[rows[better]] = distance[better]
        faces[rows[better]] = candidates[better]
        weights[rows[better]] = found[better]
    return faces, weights


def project_to_triangles(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Barycentric coordinates (n, 3) of the point of each triangle (n, 3, 3) nearest to a point."""
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


def _closest(
    source: Shape, target: Shape, posed: FloatArray, forward: IntArray, backward: IntArray
) -> tuple[IntArray, IntArray]:
    left = np.hstack([posed, _NORMAL_WEIGHT * vertex_normals(posed, source.faces)])
    right = np.hstack([target.vertices, _NORMAL_WEIGHT * target.normals])
    ours = source.spokes.indptr, source.spokes.indices
    theirs = target.spokes.indptr, target.spokes.indices
    return walk(left, right, forward, *ours, *theirs), walk(right, left, backward, *theirs, *ours)


def _rotations(
    source: Shape, average: Factorization, rest: FloatArray, posed: FloatArray
) -> FloatArray:
    """Rotation of each vertex's neighbourhood that best explains its edges, (n, 3, 3)."""
    spokes = source.spokes
    cross = edge_covariances(spokes.indptr, spokes.indices, spokes.data, rest, posed)
    cross = average.solve(cross.reshape(-1, 9)).reshape(-1, 3, 3)
    left, _, right = np.linalg.svd(cross)
    left[:, :, 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))[:, None]
    return np.asarray(np.matmul(right.transpose(0, 2, 1), left.transpose(0, 2, 1)))


def _scatter(rows: IntArray, values: FloatArray, n: int) -> FloatArray:
    return np.stack([np.bincount(rows, column, n) for column in values.T], axis=1)
