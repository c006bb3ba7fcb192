"""The row of one shape in a collection, computed from its file."""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from unbend._arrays import first_largest
from unbend._types import FloatArray
from unbend.canonical import spread_samples
from unbend.collection._descriptor import DESCRIPTOR_VERSION, Basis, describe, make_basis
from unbend.collection._rows import Failure
from unbend.io import read_mesh
from unbend.mesh import Mesh, vertex_areas
from unbend.report.raster import rasterize, rgb_of, view_rotation

FORM_POINTS, FORM_COMPONENTS = 256, 3
_THUMBNAIL = 96  # pixels across

# Parameters of a row's numbers. Rows with other parameters cannot be compared.
PARAMETERS: Mapping[str, Any] = {
    "descriptor": DESCRIPTOR_VERSION,
    "form_points": FORM_POINTS,
    "form_components": FORM_COMPONENTS,
    "form_distance": "biharmonic",
    "form_weighting": "area",
}


def make_row(path: str, digest: str) -> dict[str, Any] | Failure:
    """Read a shape and compute its columns in the store; any error becomes its failure.

    `digest` is the hash of the file's bytes.
    """
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            mesh = read_mesh(path)
            basis = make_basis(mesh)
            descriptor, form = describe(basis), sample_form(basis)
        if not (np.isfinite(descriptor).all() and np.isfinite(form).all()):
            return Failure(path, "its description is not finite; try unbend check on it")
        notes = dict.fromkeys([*mesh.notes, *(str(one.message) for one in caught)])
        return {
            "id": digest,
            "path": path,
            "n_vertices": mesh.n_vertices,
            "n_faces": mesh.n_faces,
            "area": float(vertex_areas(mesh).sum()) if mesh.n_faces else 0.0,
            "notes": "; ".join(note.removeprefix(f"{mesh.name}: ") for note in notes),
            "version": DESCRIPTOR_VERSION,
            "descriptor": descriptor,
            "form": form.astype(np.float32).ravel(),
            "thumbnail": thumbnail(mesh),
        }
    except Exception as error:  # of any kind: other meshes go on
        return Failure.of(path, error)


def sample_form(basis: Basis) -> FloatArray:
    """Sample the canonical form at its farthest points, the same number for all shapes.

    Weighted by area, the exact form of biharmonic distances is the eigenfunctions, each divided
    by its eigenvalue. Points repeat where the surface has fewer vertices.
    """
    kept = slice(1, 1 + FORM_COMPONENTS)
    points = basis.functions[:, kept] / basis.values[kept]
    points = np.pad(points, ((0, 0), (0, FORM_COMPONENTS - points.shape[1])))
    start = int(first_largest((points**2).sum(axis=1)))
    taken = spread_samples(
        lambda sources: np.linalg.norm(points[None] - points[sources, None], axis=2),
        len(points),
        min(len(points), FORM_POINTS),
        start,
    ).indices
    return points[np.resize(taken, FORM_POINTS)]


def thumbnail(mesh: Mesh) -> bytes:
    """Draw a shape as a small square PNG; empty for a point cloud."""
    if not mesh.n_faces:
        return b""
    seen = mesh.vertices @ view_rotation("three-quarter").T
    picture, _ = rasterize(seen, mesh.faces, rgb_of(None, mesh), (_THUMBNAIL, _THUMBNAIL))
    pixels = np.round(255 * np.clip(picture[::-1], 0, 1)).astype(np.uint8)
    return _png(pixels)


def _png(pixels: np.ndarray[Any, np.dtype[np.uint8]]) -> bytes:
    """Encode (rows, columns, 4) pixels; the format's specification is RFC 2083."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    rows, columns, _ = pixels.shape
    lines = np.concatenate([np.zeros((rows, 1), np.uint8), pixels.reshape(rows, -1)], axis=1)
    header = struct.pack(">IIBBBBB", columns, rows, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        chunk(kind, data)
        for kind, data in (
            (b"IHDR", header),
            (b"IDAT", zlib.compress(lines.tobytes())),
            (b"IEND", b""),
        )
    )
