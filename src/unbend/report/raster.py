"""A small depth-buffer renderer: lit triangles to pixels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from unbend._types import FloatArray, IntArray
from unbend.errors import InputError
from unbend.mesh import Mesh, vertex_normals

# Azimuth (how far the viewer has walked to the shape's left) and elevation, in degrees.
VIEWS: dict[str, tuple[float, float]] = {
    "front": (0.0, 0.0),
    "side": (90.0, 0.0),
    "back": (180.0, 0.0),
    "top": (0.0, 90.0),
    "three-quarter": (35.0, 15.0),
}
_CLAY = (0.74, 0.77, 0.82)


def rgb_of(colors: Any, mesh: Mesh) -> FloatArray:
    """Turn whatever a caller gave as colours into red, green, blue per vertex."""
    if colors is None:
        return np.tile(_CLAY, (mesh.n_vertices, 1))
    array = np.asarray(colors, dtype=np.float64)
    if array.shape == (mesh.n_vertices, 3):
        return array
    if array.shape != (mesh.n_vertices,):
        raise InputError(
            f"colors must have shape ({mesh.n_vertices},) or ({mesh.n_vertices}, 3), "
            f"not {array.shape}"
        )
    from matplotlib import colormaps

    finite = np.isfinite(array)
    rgb = np.full((len(array), 3), 0.6)
    if finite.any():
        low, high = array[finite].min(), array[finite].max()
        rgb[finite] = colormaps["viridis"]((array[finite] - low) / max(high - low, 1e-300))[:, :3]
    return rgb


def view_rotation(view: str | tuple[float, float]) -> FloatArray:
    """Turn the shape's axes into the picture's: right, up, towards the viewer."""
    if isinstance(view, str):
        if view not in VIEWS:
            raise InputError(f"there is no view {view!r}; the views are {', '.join(VIEWS)}")
        view = VIEWS[view]
    azimuth, elevation = np.deg2rad(view)
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    turn = np.array([[ca, 0, -sa], [0, 1, 0], [sa, 0, ca]])
    tilt = np.array([[1, 0, 0], [0, ce, -se], [0, se, ce]])
    rotation: FloatArray = tilt @ turn
    return rotation


def rasterize(
    seen: FloatArray,
    faces: IntArray,
    rgb: FloatArray,
    size: tuple[int, int],
    thicker: float = 0.0,
) -> tuple[FloatArray, tuple[float, float, float, float]]:
    """Draw triangles, the nearest in front.

    Parameters
    ----------
    seen : (n, 3) ndarray of float64
        Vertices in the viewer's axes: right, up, towards the viewer. Faces with a corner that
        is not finite are left out.
    faces : (m, 3) ndarray of int64
    rgb : (n, 3) ndarray of float64
        Colours of the vertices, 0 to 1.
    size : (int, int)
        Width and height in pixels that the picture is fitted into.
    thicker : float, default=0
        Pixels by which outlines are moved outward, so that threads can be seen.

    Returns
    -------
    picture : (rows, columns, 4) ndarray of float64
        Red, green, blue and opacity, 0 to 1; the first row is the lowest.
    extent : (left, right, bottom, top)
        What the picture covers, in the units of ``seen``.
    """
    faces = faces[np.isfinite(seen[faces]).all(axis=(1, 2))]
    if len(faces) == 0:
        return np.zeros((1, 1, 4)), (0.0, 1.0, 0.0, 1.0)
    corners = seen[faces]
    low, high = corners[..., :2].min(axis=(0, 1)), corners[..., :2].max(axis=(0, 1))
    # Drawn at twice the resolution and averaged: smooth outlines. The mesh may be flat.
    pixel = float(max(((high - low) / size).max(), 1e-12)) * 1.02 / 2
    pixel *= 1 + 2 * thicker / min(size)  # the margin that it needs
    middle = (low + high) / 2
    # What is a whole number of pixels but for rounding is that number, on every processor.
    margin = 2 * math.ceil(thicker) + 2
    counts = (np.ceil((high - low) / (2 * pixel) - 1e-6).astype(int) + margin) * 2
    origin = middle - counts * pixel / 2
    face, column, row, share = _covered(corners, origin, pixel)
    depth = np.einsum("ci,ci->c", share, corners[face, :, 2])
    place = row * counts[0] + column
    nearest = np.full(counts[0] * counts[1], -np.inf)
    np.maximum.at(nearest, place, depth)
    # Parts thinner than a pixel, the limbs of canonical forms, are drawn by their edges.
    thin = _along_edges(corners, origin, pixel)
    bare = np.isneginf(nearest[thin[2] * counts[0] + thin[1]])
    face, column, row, share = (
        np.concatenate([one, more[bare]])
        for one, more in zip((face, column, row, share), thin, strict=True)
    )
    depth = np.einsum("ci,ci->c", share, corners[face, :, 2])
    place = row * counts[0] + column
    np.maximum.at(nearest, place, depth)
    front = np.flatnonzero(depth == nearest[place])
    place, face, share = place[front], face[front], share[front]
    normals = vertex_normals(seen, faces)
    normal = np.einsum("ci,cij->cj", share, normals[faces[face]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    normal *= np.where(normal[:, 2:] < 0, -1.0, 1.0)
    color = np.einsum("ci,cij->cj", share, rgb[faces[face]])
    image = np.zeros((counts[0] * counts[1], 4))
    image[place, :3] = _lit(color, normal)
    image[place, 3] = 1
    if thicker:
        flat = image.reshape(counts[1], counts[0], 4)
        away, nearby = distance_transform_edt(flat[..., 3] == 0, return_indices=True)
        image = np.where((away <= 2 * thicker)[..., None], flat[tuple(nearby)], 0.0)
    image = image.reshape(counts[1] // 2, 2, counts[0] // 2, 2, 4)
    alpha = image[..., 3:].mean(axis=(1, 3))
    blended = (image[..., :3] * image[..., 3:]).mean(axis=(1, 3)) / np.maximum(alpha, 1e-12)
    end = origin + counts * pixel
    return np.concatenate([np.clip(blended, 0, 1), alpha], axis=2), (
        float(origin[0]), float(end[0]), float(origin[1]), float(end[1]),
    )  # fmt: skip


def _covered(
    corners: FloatArray, origin: FloatArray, pixel: float
) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Pixels whose middle a face covers: face, column, row, and shares of its three corners."""
    flat = (corners[..., :2] - origin) / pixel - 0.5
    low = np.ceil(flat.min(axis=1)).astype(np.int64)
    high = np.floor(flat.max(axis=1)).astype(np.int64)
    extent = np.maximum(high - low + 1, 0)
    counts = extent[:, 0] * extent[:, 1]
    face = np.repeat(np.arange(len(corners)), counts)
    nth = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)
    column = low[face, 0] + nth % extent[face, 0]
    row = low[face, 1] + nth // extent[face, 0]
    a, b, c = flat[:, 0], flat[:, 1], flat[:, 2]
    u, v = b - a, c - a
    twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    safe = np.where(np.abs(twice) < 1e-12, np.inf, twice)
    x, y = column - a[face, 0], row - a[face, 1]
    s = (x * v[face, 1] - y * v[face, 0]) / safe[face]
    t = (u[face, 0] * y - u[face, 1] * x) / safe[face]
    within = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9) & np.isfinite(safe[face])
    share = np.stack([1 - s - t, s, t], axis=1)[within]
    return face[within], column[within], row[within], share


def _along_edges(
    corners: FloatArray, origin: FloatArray, pixel: float
) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Pixels that the edges of faces pass, in the form of :func:`_covered`."""
    flat = (corners[..., :2] - origin) / pixel
    found: list[tuple[IntArray, IntArray, IntArray, FloatArray]] = []
    for i in range(3):
        j = (i + 1) % 3
        steps = np.ceil(np.linalg.norm(flat[:, j] - flat[:, i], axis=1)).astype(np.int64) + 1
        face = np.repeat(np.arange(len(corners)), steps)
        nth = np.arange(len(face)) - np.repeat(np.cumsum(steps) - steps, steps)
        t = nth / np.maximum(steps - 1, 1)[face]
        share = np.zeros((len(face), 3))
        share[:, i], share[:, j] = 1 - t, t
        column, row = np.floor(np.einsum("ci,cij->cj", share, flat[face])).astype(np.int64).T
        found.append((face, column, row, share))
    face, column, row, share = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return face, column, row, share


def _lit(color: FloatArray, normal: FloatArray) -> FloatArray:
    """Light from the upper left, a weaker one from the right, and some from everywhere."""
    key = np.array([-0.45, 0.65, 0.62])
    fill = np.array([0.75, 0.1, 0.65])
    key, fill = key / np.linalg.norm(key), fill / np.linalg.norm(fill)
    sky = 0.5 + 0.5 * normal[:, 1]
    light = 0.30 + 0.18 * sky + 0.52 * np.maximum(normal @ key, 0)
    light += 0.16 * np.maximum(normal @ fill, 0)
    light *= 0.72 + 0.28 * normal[:, 2]  # darker towards the outline: parts stand out
    half = key + np.array([0.0, 0.0, 1.0])
    shine = 0.10 * np.maximum(normal @ (half / np.linalg.norm(half)), 0) ** 24
    result: FloatArray = color * light[:, None] * 1.12 + shine[:, None]
    return result
