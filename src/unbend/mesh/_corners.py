"""Normals of triangles, and the angles at their corners."""

from __future__ import annotations

import numpy as np

from unbend._types import FloatArray, IntArray


def face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Compute the normals (m, 3) of faces, of twice their areas in length."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.asarray(np.cross(b - a, c - a))


def measure_corners(
    vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Measure what the cotangents of faces are made of, without cancellation on needles.

    Returns the dot product (m, 3) of the two edges that leave each corner, the squared length (m,
    3) of the edge that faces it, and twice the area (m,) of each face. The cotangent of a corner is
    the first over the last.
    """
    corners = vertices[faces]  # (m, 3 corners, 3 coordinates)
    facing = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    squared = np.einsum("mij,mij->mi", facing, facing)
    dots = -np.einsum("mij,mij->mi", np.roll(facing, -1, axis=1), np.roll(facing, -2, axis=1))
    every = np.arange(len(faces))
    # The dot products at the two ends of an edge add up to its square. Along the shortest edge both
    # suffer from rounding, so one is computed from the other: then their sum is right.
    shortest = squared.argmin(axis=1)
    one, other = (shortest + 1) % 3, (shortest + 2) % 3
    dots[every, other] = squared[every, shortest] - dots[every, one]
    # The cross product of the two shorter edges has the smallest rounding error.
    longest = squared.argmax(axis=1)
    normals = np.cross(facing[every, (longest + 1) % 3], facing[every, (longest + 2) % 3])
    return dots, squared, np.linalg.norm(normals, axis=1)
