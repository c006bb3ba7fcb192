"""From meshes to the matcher's arrays, and back to the meshes' vertices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from unbend._types import IntArray
from unbend.errors import InputError, MeshError
from unbend.matching._shape import Shape, make_shape
from unbend.mesh import as_mesh
from unbend.spectra import eigenpairs
from unbend.surface import Surface, make_surface

Progress = Callable[[str, float], None]


def prepare_shape(
    mesh: Any, n_eigenpairs: int, cache: bool, progress: Progress | None
) -> tuple[Surface, Shape]:
    """Check a mesh, compute its eigenpairs and normalise it."""
    mesh = as_mesh(mesh)
    if mesh.is_point_cloud:
        raise InputError(f"{mesh.name}: matching needs faces, and this is a point cloud")
    surface = make_surface(mesh)
    faces = surface.mesh.faces
    _check_winding(faces, mesh.name)
    pairs = eigenpairs(surface, min(n_eigenpairs, surface.n_vertices // 2), cache=cache)
    if progress is not None:
        progress("spectrum", 1.0)
    shape = make_shape(
        surface.mesh.vertices, faces, pairs.areas, pairs.eigenvalues, pairs.eigenfunctions
    )
    return surface, shape


def _check_winding(faces: IntArray, name: str) -> None:
    """Every directed edge belongs to one face, or its neighbours disagree on what is outside."""
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    order = np.lexsort(directed.T)
    repeated = (np.diff(directed[order], axis=0) == 0).all(axis=1)
    if repeated.any():
        first = int(np.flatnonzero(repeated)[0])
        one, other = sorted(int(i) // 3 for i in order[first : first + 2])
        raise MeshError(
            f"{name}: faces {one} and {other} run along their common edge in the same direction, "
            "so it is unclear which side is outside; repair the winding of the faces"
        )


def expand(point_map: IntArray, source: Surface, target: Surface) -> IntArray:
    """Turn a map between vertices in use into one between all vertices, -1 where none."""
    return np.asarray(expand_rows(target.prepared.kept[point_map], source, -1))


def expand_rows(rows: Any, source: Surface, missing: float) -> Any:
    """From vertices in use to all vertices, the rest marked as missing."""
    full = np.full((source.prepared.n_original, *rows.shape[1:]), missing, dtype=rows.dtype)
    full[source.prepared.kept] = rows
    return full
