"""A small depth-buffer renderer: lit triangles to pixels."""

from __future__ import annotations

import math
import struct
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt

from unbend._arrays import numbers_of
from unbend._compiled import compiled
from unbend._types import FloatArray, IntArray
from unbend.errors import InputError
from unbend.io import value_colors
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


def _rgb_of(colors: Any, n: int) -> FloatArray:
    """Turn the colours that a caller gave into red, green and blue of n vertices."""
    if colors is None:
        return np.tile(_CLAY, (n, 1))
    array = numbers_of(colors, "colors")
    if array.shape == (n, 3):
        if ((array < 0) | (array > 1)).any():
            raise InputError("colors must be from 0 to 1: divide those up to 255 by 255")
        return array
    if array.shape != (n,):
        raise InputError(f"colors must have shape ({n},) or ({n}, 3), not {array.shape}")
    return value_colors(array) / 255


def view_rotation(view: str | tuple[float, float]) -> FloatArray:
    """Turn the shape's axes into the picture's: right, up, towards the viewer."""
    if isinstance(view, str):
        if view not in VIEWS:
            raise InputError(f"there is no view {view!r}; the views are {', '.join(VIEWS)}")
        view = VIEWS[view]
    angles = numbers_of(view, "view")
    if angles.shape != (2,) or not np.isfinite(angles).all():
        raise InputError(f"view must be a name or two angles in degrees, not {view!r}")
    azimuth, elevation = np.deg2rad(angles)
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    turn = np.array([[ca, 0, -sa], [0, 1, 0], [sa, 0, ca]])
    tilt = np.array([[1, 0, 0], [0, ce, -se], [0, se, ce]])
    return np.asarray(tilt @ turn)


def rasterize(
    vertices: FloatArray,
    faces: IntArray,
    colors: Any,
    size: tuple[int, int],
    view: str | tuple[float, float] = "front",
    thicker: float = 0.0,
) -> tuple[FloatArray, tuple[float, float, float, float]]:
    """Draw triangles, the nearest in front, fitted into a size in pixels (width, height).

    Faces with a corner that is not finite are left out. Outlines are moved outward by `thicker`
    pixels, so that threads can be seen. Returns the picture (rows, columns, 4), its first row the
    lowest, with red, green, blue and opacity from 0 to 1; and what it covers in the units of the
    vertices: left, right, bottom, top.
    """
    rgb = _rgb_of(colors, len(vertices))
    seen = vertices @ view_rotation(view).T  # right, up, towards the viewer
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
    flat = np.ascontiguousarray((corners[..., :2] - origin) / pixel - 0.5)
    depths = np.ascontiguousarray(corners[..., 2])
    front = np.full((counts[1], counts[0]), -1, dtype=np.int64)
    shares = np.zeros((counts[1], counts[0], 3))
    _cover(flat, depths, front, shares)
    covered = front >= 0
    face, share = front[covered], shares[covered]
    normals = vertex_normals(seen, faces)
    normal = np.einsum("ci,cij->cj", share, normals[faces[face]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    normal *= np.where(normal[:, 2:] < 0, -1.0, 1.0)
    color = np.einsum("ci,cij->cj", share, rgb[faces[face]])
    image = np.zeros((*front.shape, 4))
    image[covered, :3] = _lit(color, normal)
    image[covered, 3] = 1
    if thicker:
        away, nearby = distance_transform_edt(~covered, return_indices=True)
        image = np.where((away <= 2 * thicker)[..., None], image[tuple(nearby)], 0.0)
    image = image.reshape(counts[1] // 2, 2, counts[0] // 2, 2, 4)
    alpha = image[..., 3:].mean(axis=(1, 3))
    blended = (image[..., :3] * image[..., 3:]).mean(axis=(1, 3)) / np.maximum(alpha, 1e-12)
    (left, bottom), (right, top) = origin.tolist(), (origin + counts * pixel).tolist()
    picture = np.concatenate([np.clip(blended, 0, 1), alpha], axis=2)
    return picture, (left, right, bottom, top)


def thumbnail(mesh: Mesh, size: int, colors: Any = None) -> bytes:
    """Draw a shape as a PNG of about `size` pixels on its longer side; empty for a point cloud."""
    if not mesh.n_faces:
        return b""
    picture, _ = rasterize(mesh.vertices, mesh.faces, colors, (size, size), "three-quarter")
    return _png(np.round(255 * np.clip(picture[::-1], 0, 1)).astype(np.uint8))


def _png(pixels: npt.NDArray[np.uint8]) -> bytes:
    """Encode (rows, columns, 4) pixels; the format's specification is RFC 2083."""
    rows, columns, _ = pixels.shape
    lines = np.pad(pixels.reshape(rows, -1), ((0, 0), (1, 0)))  # a 0 first: none is filtered
    header = struct.pack(">IIBBBBB", columns, rows, 8, 6, 0, 0, 0)
    encoded = b"\x89PNG\r\n\x1a\n"
    for kind, data in (
        (b"IHDR", header),
        (b"IDAT", zlib.compress(lines.tobytes())),
        (b"IEND", b""),
    ):
        encoded += struct.pack(">I", len(data)) + kind + data
        encoded += struct.pack(">I", zlib.crc32(kind + data))
    return encoded


@compiled
def _cover(flat: FloatArray, depths: FloatArray, front: IntArray, shares: FloatArray) -> None:
    """Find what is seen in each pixel: the nearest face over its middle, and the corners' shares.

    Corners `flat` (m, 3, 2) are in pixels whose middles are at whole numbers; `front` gets -1 where
    there is no face. Parts thinner than a pixel, the limbs of canonical forms, are drawn by their
    edges where no face covers the middle of a pixel.
    """
    nearest = np.full(front.shape, -np.inf)
    for face in range(len(flat)):
        (ax, ay), (bx, by), (cx, cy) = flat[face]
        twice = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(twice) < 1e-12:
            continue
        for row in range(math.ceil(min(ay, by, cy)), math.floor(max(ay, by, cy)) + 1):
            for column in range(math.ceil(min(ax, bx, cx)), math.floor(max(ax, bx, cx)) + 1):
                x, y = column - ax, row - ay
                s = (x * (cy - ay) - y * (cx - ax)) / twice
                t = ((bx - ax) * y - (by - ay) * x) / twice
                if s < -1e-9 or t < -1e-9 or s + t > 1 + 1e-9:
                    continue
                depth = (1 - s - t) * depths[face, 0] + s * depths[face, 1] + t * depths[face, 2]
                if depth >= nearest[row, column]:
                    nearest[row, column] = depth
                    front[row, column] = face
                    shares[row, column] = 1 - s - t, s, t
    bare = front < 0
    for face in range(len(flat)):
        for i in range(3):
            j = (i + 1) % 3
            across, down = flat[face, j] - flat[face, i]
            steps = max(math.ceil(math.sqrt(across**2 + down**2)), 1)
            for step in range(steps + 1):
                t = step / steps
                column = math.floor(flat[face, i, 0] + t * across + 0.5)
                row = math.floor(flat[face, i, 1] + t * down + 0.5)
                depth = (1 - t) * depths[face, i] + t * depths[face, j]
                if bare[row, column] and depth >= nearest[row, column]:
                    nearest[row, column] = depth
                    front[row, column] = face
                    shares[row, column] = 0
                    shares[row, column, i] = 1 - t
                    shares[row, column, j] = t


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
    return np.asarray(color * light[:, None] * 1.12 + shine[:, None])
