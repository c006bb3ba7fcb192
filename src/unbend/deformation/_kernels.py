"""Compiled loops over edges, faces and poses of a surface.

Kernels release the GIL and work on a range of rows, and a function beside each spreads the ranges
over threads: Numba's own threads take long to compile for and must not be entered twice at a time.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from unbend._compiled import compiled
from unbend._parallel import run_all, slices
from unbend._types import FloatArray, IntArray, SparseMatrix

_ROWS = 8192  # vertices that a task works on
_TURNS = 2  # of a rotation in a step at most; it starts near where it ends


def over_rows(n: int, width: int, kernel: Callable[..., None], *arguments: Any) -> None:
    """Call a kernel for all ranges of rows, so many vertices wide, in threads."""
    step = max(_ROWS // max(width, 1), 1)
    parts = slices(n, step)
    run_all(functools.partial(kernel, *arguments, part.start, part.stop) for part in parts)


def edge_covariances(edge_weights: SparseMatrix, rest: FloatArray, posed: FloatArray) -> FloatArray:
    """Weighted sums over a vertex's edges of (rest edge) (posed edge)^T: (n, ..., 3, 3).

    ``posed`` (n, ..., 3) may be several poses, of one ``rest`` (n, 3).
    """
    poses = posed.reshape(len(posed), -1, 3)
    result = np.empty((*poses.shape, 3))
    graph = edge_weights.indptr, edge_weights.indices, edge_weights.data
    over_rows(len(rest), poses.shape[1], _edge_covariances, *graph, rest, poses, result)
    return result.reshape(*posed.shape, 3)


@compiled
def _edge_covariances(start, neighbors, weights, rest, posed, result, first, last):  # type: ignore[no-untyped-def]
    for m in range(posed.shape[1]):
        for i in range(first, last):
            xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
            for e in range(start[i], start[i + 1]):
                j = neighbors[e]
                x = weights[e] * (rest[j, 0] - rest[i, 0])
                y = weights[e] * (rest[j, 1] - rest[i, 1])
                z = weights[e] * (rest[j, 2] - rest[i, 2])
                u = posed[j, m, 0] - posed[i, m, 0]
                v = posed[j, m, 1] - posed[i, m, 1]
                w = posed[j, m, 2] - posed[i, m, 2]
                xx, xy, xz = xx + x * u, xy + x * v, xz + x * w
                yx, yy, yz = yx + y * u, yy + y * v, yz + y * w
                zx, zy, zz = zx + z * u, zy + z * v, zz + z * w
            result[i, m, 0, 0], result[i, m, 0, 1], result[i, m, 0, 2] = xx, xy, xz
            result[i, m, 1, 0], result[i, m, 1, 1], result[i, m, 1, 2] = yx, yy, yz
            result[i, m, 2, 0], result[i, m, 2, 1], result[i, m, 2, 2] = zx, zy, zz


def edge_squares(edge_weights: SparseMatrix, points: FloatArray) -> FloatArray:
    """Weighted sums (n, ...) of the squared edges around vertices (n, ..., 3)."""
    degrees = np.diff(edge_weights.indptr)
    edges = points[edge_weights.indices] - np.repeat(points, degrees, axis=0)
    squares = np.einsum("...c,...c->...", edges, edges).reshape(len(edges), -1)
    ends = sp.csr_array((edge_weights.data, np.arange(len(edges)), edge_weights.indptr))
    return np.asarray((ends @ squares).reshape(points.shape[:-1]))


def rotated_divergence(
    edge_weights: SparseMatrix, rest: FloatArray, rotations: FloatArray
) -> FloatArray:
    """Right-hand side (n, ..., 3) of the as-rigid-as-possible system (Sorkine & Alexa 2007)."""
    turns = rotations.reshape(len(rotations), -1, 3, 3)
    result = np.empty(turns.shape[:3])
    graph = edge_weights.indptr, edge_weights.indices, edge_weights.data
    over_rows(len(rest), turns.shape[1], _rotated_divergence, *graph, rest, turns, result)
    return result.reshape(rotations.shape[:-1])


@compiled
def _rotated_divergence(start, neighbors, weights, rest, rotations, result, first, last):  # type: ignore[no-untyped-def]
    for m in range(rotations.shape[1]):
        for i in range(first, last):
            own = rotations[i, m]
            u = v = w = 0.0
            for e in range(start[i], start[i + 1]):
                j = neighbors[e]
                other = rotations[j, m]
                half = 0.5 * weights[e]
                x = half * (rest[i, 0] - rest[j, 0])
                y = half * (rest[i, 1] - rest[j, 1])
                z = half * (rest[i, 2] - rest[j, 2])
                u += (
                    (own[0, 0] + other[0, 0]) * x
                    + (own[0, 1] + other[0, 1]) * y
                    + (own[0, 2] + other[0, 2]) * z
                )
                v += (
                    (own[1, 0] + other[1, 0]) * x
                    + (own[1, 1] + other[1, 1]) * y
                    + (own[1, 2] + other[1, 2]) * z
                )
                w += (
                    (own[2, 0] + other[2, 0]) * x
                    + (own[2, 1] + other[2, 1]) * y
                    + (own[2, 2] + other[2, 2]) * z
                )
            result[i, m, 0], result[i, m, 1], result[i, m, 2] = u, v, w


def normals_into(
    rows: FloatArray, column: int, places: FloatArray, faces: IntArray, start: Any, ring: Any
) -> None:
    """Put the unit normals of surfaces into three columns of ``rows`` (n, m, d).

    The surfaces are m poses, ``places`` (n, m, 3). A normal is 0 where no face has an area.
    """
    around = faces, start, ring
    over_rows(len(places), places.shape[1], _normals_into, rows, column, places, *around)


@compiled
def _normals_into(rows, column, places, faces, start, ring, first, last):  # type: ignore[no-untyped-def]
    for m in range(places.shape[1]):
        for i in range(first, last):
            x = y = z = 0.0
            for e in range(start[i], start[i + 1]):
                a, b, c = faces[ring[e], 0], faces[ring[e], 1], faces[ring[e], 2]
                p = places[b, m, 0] - places[a, m, 0]
                q = places[b, m, 1] - places[a, m, 1]
                r = places[b, m, 2] - places[a, m, 2]
                u = places[c, m, 0] - places[a, m, 0]
                v = places[c, m, 1] - places[a, m, 1]
                w = places[c, m, 2] - places[a, m, 2]
                x, y, z = x + q * w - r * v, y + r * u - p * w, z + p * v - q * u
            length = max(np.sqrt(x * x + y * y + z * z), 1e-300)
            rows[i, m, column] = x / length
            rows[i, m, column + 1] = y / length
            rows[i, m, column + 2] = z / length


def scatter(
    rows: IntArray, weights: FloatArray, values: FloatArray, n: int
) -> tuple[FloatArray, FloatArray]:
    """Add up weighted rows that go to the same place, (n, d), and their weights, (n,).

    ``rows`` and ``weights`` (m,) may be several, (m, p), of the same ``values`` (m, d): then sums
    are (n, p, d), and weights (n, p).
    """
    m, p = len(rows), int(np.prod(rows.shape[1:]))
    owners = (rows.reshape(m, p) * p + np.arange(p)).ravel()
    shares = (weights.reshape(m, p) * one[:, None] for one in (*values.T, np.ones(m)))
    sums = [np.bincount(owners, one.ravel(), n * p) for one in shares]
    found = np.asarray(sums, dtype=np.float64).T.reshape(n, *rows.shape[1:], -1)
    return found[..., :-1], found[..., -1]


def turn_rotations(covariances: FloatArray, rotations: FloatArray) -> None:
    """Turn rotations (..., 3, 3), in place, to those that maximise the trace of R C.

    The fixed-point iteration of Müller, Bender, Chentanez and Macklin (MIG 2016).
    """
    turned = rotations.reshape(-1, 3, 3)
    over_rows(len(turned), 1, _turn_rotations, covariances.reshape(turned.shape), turned)


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
