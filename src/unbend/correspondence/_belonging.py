"""Which mesh a match belongs to, told by hashes."""

from __future__ import annotations

from hashlib import blake2b
from typing import Any

import numpy.typing as npt

from unbend._text import plural
from unbend.errors import FileError
from unbend.mesh import Mesh


def mesh_hashes(mesh: Mesh) -> list[int]:
    """Hash positions and faces, apart: of one mesh either may change, by rounding or by a pose."""
    arrays = [mesh.vertices.astype("<f8")] + [mesh.faces.astype("<i8")] * (mesh.n_faces > 0)
    return [
        int.from_bytes(blake2b(array.tobytes(), digest_size=8).digest(), "little")
        for array in arrays
    ]


def check_mesh(mesh: Mesh, n_vertices: int, hashes: npt.NDArray[Any] | None) -> None:
    """Raise FileError unless a mesh has so many vertices and, if they are known, these hashes."""
    if mesh.n_vertices != n_vertices:
        raise FileError(
            f"belongs to a mesh of {plural(n_vertices, 'vertex')}, but {mesh.name} has "
            f"{mesh.n_vertices}"
        )
    if hashes is not None and set(mesh_hashes(mesh)).isdisjoint(hashes.ravel().tolist()):
        raise FileError(
            f"belongs to another mesh than {mesh.name}, of as many vertices; match the shapes again"
        )
