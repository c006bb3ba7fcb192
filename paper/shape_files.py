"""The files that collections of shapes come in, beyond those of :mod:`unbend.io`."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from unbend._types import IntArray
from unbend.errors import FileError, MeshError
from unbend.io import read_map, read_mesh
from unbend.io.formats.contents import data_lines, polygon_rows, positions
from unbend.mesh import Mesh

# Where a shape is there in several formats, the first of these is read.
SHAPE_SUFFIXES = (".off", ".ply", ".obj", ".mat", ".vert")


def read_shape(path: Path) -> Mesh:
    """Read a mesh file, a MATLAB file of TOSCA or its pair of .vert and .tri files.

    The last few meshes are kept, as the ground truth of a pair needs both once more; a file that
    has changed since is read again.
    """
    stamps = [
        (status.st_mtime_ns, status.st_size)
        for file in (path, path.with_suffix(".tri"))
        if file.exists()
        for status in [file.stat()]
    ]
    return _read(path, tuple(stamps))


@lru_cache(maxsize=4)
def _read(path: Path, stamps: tuple[tuple[int, int], ...]) -> Mesh:
    if path.suffix.lower() == ".mat":
        return _read_mat(path)
    if path.suffix.lower() == ".vert":
        return _read_vert_tri(path)
    return read_mesh(path)


def _read_mat(path: Path) -> Mesh:
    """Read the struct ``surface`` with fields X, Y, Z and TRIV, whose indices start at 1."""
    from scipy.io import loadmat

    read_bytes(path)  # says in our words why a file cannot be opened
    try:
        surface = loadmat(path, variable_names=["surface"])["surface"]
        fields = [np.asarray(surface[name][0, 0]) for name in ("X", "Y", "Z", "TRIV")]
    except NotImplementedError:
        raise FileError(
            f"{path.name}: this is MATLAB's version 7.3; save it again with the option -v7"
        ) from None
    except Exception as error:  # loadmat raises whatever a damaged file makes it stumble over
        raise FileError(
            f"{path.name}: holds no MATLAB struct 'surface' with fields X, Y, Z and TRIV; "
            "put the file of the TOSCA archive there again"
        ) from error
    x, y, z, faces = fields
    try:
        vertices = np.column_stack([np.ravel(x), np.ravel(y), np.ravel(z)])
    except ValueError:
        raise MeshError(f"{path.name}: X, Y and Z differ in length") from None
    return Mesh(vertices, _from_one(faces, path.name), name=path.name)


def _read_vert_tri(path: Path) -> Mesh:
    """Read positions from one file and triangles, whose indices start at 1, from another."""
    beside = path.with_suffix(".TRI" if path.suffix.isupper() else ".tri")
    if not beside.is_file():
        raise FileError(f"{path.name} has no triangles: put {beside.name} into {path.parent}")
    name = path.name
    try:
        vertices = positions([line.split() for line in data_lines(read_bytes(path), ".vert")])
        name = beside.name
        rows = [["3", *line.split()] for line in data_lines(read_bytes(beside), ".tri")]
        faces = polygon_rows(rows, np.insert(vertices, 0, 0, axis=0))[0] if rows else None
    except FileError as error:
        raise FileError(f"{name}: {error}") from error.__cause__
    except MeshError as error:
        raise MeshError(f"{name}: {error}") from None
    return Mesh(vertices, faces if faces is None else _from_one(faces, name), name=path.name)


def _from_one(faces: Any, name: str) -> IntArray:
    """Turn indices that start at 1, of whatever type, into ours."""
    whole: IntArray = np.asarray(faces).astype(np.int64)
    if whole.size and (whole.min() < 1 or (whole != faces).any()):
        raise MeshError(f"{name}: its triangles must hold whole numbers from 1 on")
    return whole - 1


def read_rows(path: Path) -> IntArray:
    """Read a .vts file: one vertex id per row, counted from 1 there and from 0 here."""
    rows = read_map(path, base=1)
    if rows.min() < 0:
        raise FileError(
            f"{path.name}: row {int(rows.argmin())} names no vertex; put the collection's file "
            "there again"
        )
    return rows


def read_bytes(path: Path) -> bytes:
    """Read a whole file, or say which one cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise FileError(f"cannot read {path}: {error.strerror or error}") from error
