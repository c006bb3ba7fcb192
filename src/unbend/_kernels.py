"""Compiled loops of the matcher: nearest pairs, walks over meshes, local rotations."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

# Decorating through an Any-typed name keeps mypy's strict mode content: Numba ships no types.
_serial: Any = numba.njit(cache=True)
_parallel: Any = numba.njit(cache=True, parallel=True)


@_serial
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


@_parallel
def nearest_both_ways(products, left, right, base):  # type: ignore[no-untyped-def]
    """Nearest pairs both ways from inner products; ``products`` (h, m, n) is overwritten.

    The squared distance of rows i and j under hypothesis h is
    ``left[h, i] + right[j] - 2 products[h, i, j] + base[i, j]``.
    """
    hypotheses, m, n = products.shape
    forward = np.empty((hypotheses, m), np.int64)
    forward_distance = np.empty((hypotheses, m), np.float32)
    backward = np.empty((hypotheses, n), np.int64)
    backward_distance = np.empty((hypotheses, n), np.float32)
    with_base = base.shape[0] == m
    for h in numba.prange(hypotheses):
        column = np.full(n, np.float32(np.inf))
        row = np.zeros(n, np.int64)
        for i in range(m):
            line = products[h, i]
            offset = left[h, i]
            if with_base:
                for j in range(n):
                    line[j] = offset + right[j] - np.float32(2) * line[j] + base[i, j]
            else:
                for j in range(n):
                    line[j] = offset + right[j] - np.float32(2) * line[j]
            best = np.float32(np.inf)
            for j in range(n):
                best = min(best, line[j])
            for j in range(n):
                if line[j] == best:
                    forward[h, i] = j
                    break
            for j in range(n):
                if line[j] < column[j]:
                    column[j] = line[j]
                    row[j] = i
            forward_distance[h, i] = best
        backward[h] = row
        backward_distance[h] = column
    return forward, forward_distance, backward, backward_distance


@_serial
def _squared_distance(left, right, i, j):  # type: ignore[no-untyped-def]
    total = 0.0
    for c in range(left.shape[1]):
        difference = left[i, c] - right[j, c]
        total += difference * difference
    return total


@_parallel
def walk(  # type: ignore[no-untyped-def]
    left, right, guess, left_start, left_neighbors, right_start, right_neighbors
):
    """Improve a map by descent: from a vertex's image, or its neighbours' images, go downhill.

    Row i of ``left`` (n, d) is brought to a nearby row of ``right`` (m, d) such that no mesh
    neighbour of that row is closer. The meshes' neighbours are given in compressed rows.
    """
    result = guess.copy()
    for i in numba.prange(len(left)):
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
    return result


@_parallel
def edge_covariances(start, neighbors, weights, rest, posed):  # type: ignore[no-untyped-def]
    """Weighted sums over a vertex's edges of (rest edge) (posed edge)^T: (n, 3, 3)."""
    n = len(rest)
    result = np.zeros((n, 3, 3))
    for i in numba.prange(n):
        for e in range(start[i], start[i + 1]):
            j = neighbors[e]
            for a in range(3):
                edge = weights[e] * (rest[j, a] - rest[i, a])
                for b in range(3):
                    result[i, a, b] += edge * (posed[j, b] - posed[i, b])
    return result


@_parallel
def rotated_divergence(start, neighbors, weights, rest, rotations):  # type: ignore[no-untyped-def]
    """Right-hand side of the as-rigid-as-possible system (Sorkine & Alexa 2007, Eq. 8)."""
    n = len(rest)
    result = np.zeros((n, 3))
    for i in numba.prange(n):
        for e in range(start[i], start[i + 1]):
            j = neighbors[e]
            for a in range(3):
                total = 0.0
                for b in range(3):
                    rotation = rotations[i, a, b] + rotations[j, a, b]
                    total += rotation * (rest[i, b] - rest[j, b])
                result[i, a] += 0.5 * weights[e] * total
    return result


@_parallel
def turn_rotations(covariances, rotations):  # type: ignore[no-untyped-def]
    """Turn rotations (n, 3, 3), in place, to those that best explain covariances.

    The rotation R that maximises the trace of R C, by the fixed-point iteration of Müller,
    Bender, Chentanez & Macklin ("A robust method to extract the rotational part of
    deformations", 2016), from where it stands.
    """
    for i in numba.prange(len(rotations)):
        r = rotations[i]
        c = covariances[i]
        for _ in range(30):
            axis = np.zeros(3)
            along = 0.0
            for a in range(3):
                # Column a of r against row a of the covariance, which is where it should point.
                axis[0] += r[1, a] * c[a, 2] - r[2, a] * c[a, 1]
                axis[1] += r[2, a] * c[a, 0] - r[0, a] * c[a, 2]
                axis[2] += r[0, a] * c[a, 1] - r[1, a] * c[a, 0]
                along += r[0, a] * c[a, 0] + r[1, a] * c[a, 1] + r[2, a] * c[a, 2]
            axis /= abs(along) + 1e-30
            angle = np.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
            if angle < 1e-7:
                break
            axis /= angle
            angle = min(angle, 1.0)
            sine, versine = np.sin(angle), 1 - np.cos(angle)
            for a in range(3):
                x, y, z = r[0, a], r[1, a], r[2, a]
                dot = axis[0] * x + axis[1] * y + axis[2] * z
                u = axis[1] * z - axis[2] * y
                v = axis[2] * x - axis[0] * z
                w = axis[0] * y - axis[1] * x
                r[0, a] = x + sine * u + versine * (axis[0] * dot - x)
                r[1, a] = y + sine * v + versine * (axis[1] * dot - y)
                r[2, a] = z + sine * w + versine * (axis[2] * dot - z)
