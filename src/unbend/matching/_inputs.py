"""From meshes to the matcher's arrays, and back to the meshes' vertices."""

from __future__ import annotations

from typing import Any

import numpy as np

from unbend._types import IntArray, Progress
from unbend.errors import InputError, MeshError
from unbend.io import MeshLike, as_mesh
from unbend.matching._shape import Shape, make_shape
from unbend.mesh import wind_alike
from unbend.spectral import Surface, eigenpairs, make_surface


def prepare_shape(
    mesh: MeshLike, n_eigenpairs: int, cache: bool, progress: Progress | None
) -> tuple[Surface, Shape]:
    """Check a mesh, compute its eigenpairs and normalise it."""
    mesh = as_mesh(mesh)
    if mesh.is_point_cloud:
        raise InputError(f"{mesh.name}: matching needs faces, and this is a point cloud")
    surface = make_surface(mesh)
    faces = wind_alike(surface.mesh.faces, surface.n_vertices)
    if faces is None:
        raise MeshError(
            f"{mesh.name}: the surface has only one side, like a Möbius strip, so left and right "
            "cannot be told apart on it; repair the mesh"
        )
    pairs = eigenpairs(surface, min(n_eigenpairs, surface.n_vertices // 2), cache=cache)
    if progress is not None:
        progress("spectrum", 1.0)
    shape = make_shape(
        surface.mesh.vertices, faces, pairs.areas, pairs.eigenvalues, pairs.eigenfunctions
    )
    return surface, shape


def expand(point_map: IntArray, source: Surface, target: Surface) -> IntArray:
    """Turn a map between vertices in use into one between all vertices, -1 where none."""
    return np.asarray(expand_rows(target.prepared.kept[point_map], source, -1))


def expand_rows(rows: Any, source: Surface, missing: float) -> Any:
    """From vertices in use to all vertices, the rest marked as missing."""
    full = np.full((source.prepared.n_original, *rows.shape[1:]), missing, dtype=rows.dtype)
    full[source.prepared.kept] = rows
    return full
