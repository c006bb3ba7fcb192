"""Compiled loops of the matcher: nearest pairs, walks over meshes, local rotations.

Kernels are compiled without Numba's own threads, which take long to compile for and must not be
entered twice at a time: they release the GIL and work on a range of rows, and a function beside
each spreads the ranges over threads.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from unbend._compiled import compiled
from unbend._parallel import run_all
from unbend._types import FloatArray, IntArray

_ROWS = 1024  # rows that a task works on
_TURNS = 5  # of a rotation at most; it starts near where it ends


def _over_rows(n: int, kernel: Callable[..., None], *arguments: Any) -> None:
    """Call a kernel for all ranges of rows, in threads; its last two arguments are the range."""
    run_all(
        functools.partial(kernel, *arguments, first, min(first + _ROWS, n))
        for first in range(0, n, _ROWS)
    )


@compiled
def farthest_points(points, count, start):  # type: ignore[no-untyped-def]
    """Choose ``count`` rows, each as far as possible from those before it (Gonzalez 1985)."""
    n, d = points.shape
    distance = np.full(n, np.inf)
    chosen = np.empty(count, np.int64)
    current = start
    for i in range(count):
        chosen[i] = current
        farthest, following = -1.0, 0
        for j in range(n):
            square = 0.0
            for c in range(d):
                difference = points[j, c] - points[current, c]
                square += difference * difference
            if square < distance[j]:
                distance[j] = square
            if distance[j] > farthest:
                farthest, following = distance[j], j
        current = following
    return chosen


@compiled
def _squared_distance(left, right, i, j):  # type: ignore[no-untyped-def]
    total = 0.0
    for c in range(left.shape[1]):
        difference = left[i, c] - right[j, c]
        total += difference * difference
    return total


def walk(
    left: FloatArray,
    right: FloatArray,
    guess: IntArray,
    left_start: Any,
    left_neighbors: Any,
    right_start: Any,
    right_neighbors: Any,
) -> IntArray:
    """Improve a map by descent: from a vertex's image, or its neighbours' images, go downhill.

    Row i of ``left`` (n, d) is brought to a nearby row of ``right`` (m, d) such that no mesh
    neighbour of that row is closer. The meshes' neighbours are given in compressed rows.
    """
    result = guess.copy()
    steps = left_start, left_neighbors, right_start, right_neighbors
    _over_rows(len(left), _walk, left, right, guess, *steps, result)
    return result


@compiled
def _walk(  # type: ignore[no-untyped-def]
    left,
    right,
    guess,
    left_start,
    left_neighbors,
    right_start,
    right_neighbors,
    result,
    first,
    last,
):
    for i in range(first, last):
        here = guess[i]
        best = _squared_distance(left, right, i, here)
        for e in range(left_start[i], left_start[i + 1]):
            candidate = guess[left_neighbors[e]]
            if candidate != here:
                distance = _squared_distance(left, right, i, candidate)
                if distance < best:
                    best, here = distance, candidate
        moved = True
        while moved:
            moved = False
            center = here
            for e in range(right_start[center], right_start[center + 1]):
                candidate = right_neighbors[e]
                distance = _squared_distance(left, right, i, candidate)
                if distance < best:
                    best, here, moved = distance, candidate, True
        result[i] = here


def edge_covariances(
    start: Any, neighbors: Any, weights: FloatArray, rest: FloatArray, posed: FloatArray
) -> FloatArray:
    """Weighted sums over a vertex's edges of (rest edge) (posed edge)^T: (n, 3, 3)."""
    result = np.zeros((len(rest), 3, 3))
    _over_rows(len(rest), _edge_covariances, start, neighbors, weights, rest, posed, result)
    return result


@compiled
def _edge_covariances(start, neighbors, weights, rest, posed, result, first, last):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        for e in range(start[i], start[i + 1]):
            j = neighbors[e]
            for a in range(3):
                edge = weights[e] * (rest[j, a] - rest[i, a])
                for b in range(3):
                    result[i, a, b] += edge * (posed[j, b] - posed[i, b])


def rotated_divergence(
    start: Any, neighbors: Any, weights: FloatArray, rest: FloatArray, rotations: FloatArray
) -> FloatArray:
    """Right-hand side of the as-rigid-as-possible system (Sorkine & Alexa 2007, Eq. 8)."""
    result = np.zeros((len(rest), 3))
    _over_rows(len(rest), _rotated_divergence, start, neighbors, weights, rest, rotations, result)
    return result


@compiled
def _rotated_divergence(start, neighbors, weights, rest, rotations, result, first, last):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        for e in range(start[i], start[i + 1]):
            j = neighbors[e]
            for a in range(3):
                total = 0.0
                for b in range(3):
                    rotation = rotations[i, a, b] + rotations[j, a, b]
                    total += rotation * (rest[i, b] - rest[j, b])
                result[i, a] += 0.5 * weights[e] * total


@compiled
def faces_around(faces, n):  # type: ignore[no-untyped-def]
    """Faces around each vertex, in compressed rows."""
    start = np.zeros(n + 1, np.int64)
    for f in range(len(faces)):
        for c in range(3):
            start[faces[f, c] + 1] += 1
    for i in range(n):
        start[i + 1] += start[i]
    fill = start[:-1].copy()
    ring = np.empty(3 * len(faces), np.int64)
    for f in range(len(faces)):
        for c in range(3):
            ring[fill[faces[f, c]]] = f
            fill[faces[f, c]] += 1
    return start, ring


@compiled
def scatter(rows, weights, values, n):  # type: ignore[no-untyped-def]
    """Add up weighted rows that go to the same place, (n, d), and their weights, (n,)."""
    sums, total = np.zeros((n, values.shape[1])), np.zeros(n)
    for i in range(len(rows)):
        total[rows[i]] += weights[i]
        for a in range(values.shape[1]):
            sums[rows[i], a] += weights[i] * values[i, a]
    return sums, total


def turn_rotations(covariances: FloatArray, rotations: FloatArray) -> None:
    """Turn rotations (n, 3, 3), in place, to those that best explain covariances.

    The rotation R that maximises the trace of R C, by the fixed-point iteration of Müller,
    Bender, Chentanez & Macklin ("A robust method to extract the rotational part of
    deformations", 2016), from where it stands.
    """
    _over_rows(len(rotations), _turn_rotations, covariances, rotations)


@compiled
def _turn_rotations(covariances, rotations, first, last):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        r = rotations[i]
        c = covariances[i]
        for _ in range(_TURNS):
            x = y = z = along = 0.0
            for a in range(3):
                # Column a of r against row a of the covariance, which is where it should point.
                x += r[1, a] * c[a, 2] - r[2, a] * c[a, 1]
                y += r[2, a] * c[a, 0] - r[0, a] * c[a, 2]
                z += r[0, a] * c[a, 1] - r[1, a] * c[a, 0]
                along += r[0, a] * c[a, 0] + r[1, a] * c[a, 1] + r[2, a] * c[a, 2]
            length = np.sqrt(x * x + y * y + z * z)
            angle = length / (abs(along) + 1e-30)
            if angle < 1e-7:
                break
            x, y, z = x / length, y / length, z / length
            angle = min(angle, 1.0)
            sine, versine = np.sin(angle), 1 - np.cos(angle)
            for a in range(3):
                u, v, w = r[0, a], r[1, a], r[2, a]
                dot = x * u + y * v + z * w
                r[0, a] = u + sine * (y * w - z * v) + versine * (x * dot - u)
                r[1, a] = v + sine * (z * u - x * w) + versine * (y * dot - v)
                r[2, a] = w + sine * (x * v - y * u) + versine * (z * dot - w)


@compiled
def largest_traces(matrices):  # type: ignore[no-untyped-def]
    """Largest trace (n,) that a rotation times each matrix (n, 3, 3) has.

    It is the sum of the singular values, the least taken negative if the determinant is. The
    greatest is found by Viète's formula; squares and product of the others follow from the
    cofactors and the determinant.
    """
    found = np.zeros(len(matrices))
    square, cofactors = np.empty((3, 3)), np.empty((3, 3))
    for i in range(len(matrices)):
        c = matrices[i]
        size = squares = 0.0
        for a in range(3):
            d, e = (a + 1) % 3, (a + 2) % 3
            for b in range(3):
                f, g = (b + 1) % 3, (b + 2) % 3
                square[a, b] = c[0, a] * c[0, b] + c[1, a] * c[1, b] + c[2, a] * c[2, b]
                cofactors[a, b] = c[d, f] * c[e, g] - c[d, g] * c[e, f]
                squares += cofactors[a, b] ** 2
            size += square[a, a] / 3
        if size < 1e-140:
            continue
        determinant = 0.0
        for b in range(3):
            determinant += c[0, b] * cofactors[0, b]
        x, y, z = square[0, 0] / size - 1, square[1, 1] / size - 1, square[2, 2] / size - 1
        u, v, w = square[1, 2] / size, square[0, 2] / size, square[0, 1] / size
        spread = np.sqrt((x * x + y * y + z * z + 2 * (u * u + v * v + w * w)) / 6)
        half = (x * y * z + 2 * u * v * w - x * u * u - y * v * v - z * w * w) / 2
        angle = np.arccos(min(1.0, max(-1.0, half / max(spread**3, 1e-300)))) / 3
        greatest = size * (1 + 2 * spread * np.cos(angle))
        others = (squares - determinant**2 / greatest) / greatest
        both = others + 2 * determinant / np.sqrt(greatest)
        found[i] = np.sqrt(greatest) + np.sqrt(max(both, 0.0))
    return found
