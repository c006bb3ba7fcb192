"""Reading meshes, without ever changing the order of their vertices."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from unbend._types import StrPath
from unbend.errors import FileError, InputError
from unbend.io._files import as_path, prefixed, read_bytes
from unbend.io._foreign import FOREIGN_SUFFIXES, MeshLike, mesh_of, read_foreign
from unbend.io.formats import obj, off, ply, points, stl, vtk, vtp
from unbend.io.formats.contents import Contents
from unbend.mesh import Mesh

_READERS: dict[str, Callable[[bytes], Contents]] = {
    ".off": off.read,
    ".obj": obj.read,
    ".ply": ply.read,
    ".stl": stl.read,
    ".xyz": points.read_xyz,
    ".npy": points.read_npy,
    ".vtk": vtk.read,
    ".vtp": vtp.read,
    ".vtu": vtp.read,
}
_EXTRAS = {".obj": obj.extras, ".off": off.extras, ".ply": ply.extras, ".stl": stl.extras}

READ_SUFFIXES = (*_READERS, *FOREIGN_SUFFIXES)


def read_mesh(path: StrPath) -> Mesh:
    r"""Read a triangle mesh or a point cloud.

    Vertices and faces keep the file's order and number. Polygons are split into triangles, and
    the corners of an STL file, which stores no vertices, are welded where their positions are
    exactly equal; ``Mesh.notes`` says so.

    Parameters
    ----------
    path : path
        .off (also COFF, NOFF), .obj, .ply (text or binary), .stl, .vtk (VTK's POLYDATA, and the
        polygons of an UNSTRUCTURED_GRID), .vtp and .vtu (the same in XML), .xyz (one point per
        line) or .npy (an (n, 3) array of points). Trimesh, if it is installed, reads .glb, .gltf,
        .3mf and .dae; meshio reads .msh, .mesh, .inp and .bdf; nibabel reads .gii and FreeSurfer's
        .pial, .white, .inflated and .sphere.

    Returns
    -------
    Mesh
        Named after the file. A file without faces gives a point cloud.

    Raises
    ------
    FileError
        If the file is missing, of an unknown suffix, truncated or not of its format.
    MeshError
        If it breaks a rule of :class:`Mesh`.
    MissingExtraError
        If trimesh, meshio or nibabel is needed and not installed.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from unbend import read_mesh
    >>> path = pathlib.Path(tempfile.mkdtemp(), "square.obj")
    >>> _ = path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    >>> read_mesh(path)
    Mesh(4 vertices, 2 faces)
    >>> read_mesh(path).notes
    ('1 polygon split into triangles',)
    """
    contents = read_contents(path)
    name = Path(path).name
    with prefixed(name):
        if len(contents.vertices) == 0 and any(map(len, contents.values().values())):
            raise FileError("holds values and no surface: give the file of their surface")
        if len(contents.vertices) == 0:
            raise FileError("holds no vertices")
    return Mesh(contents.vertices, contents.faces, name=name, notes=contents.notes)


def read_contents(path: StrPath) -> Contents:
    """Read a mesh file: its shape, and on demand its values per vertex."""
    path = as_path(path)
    data = read_bytes(path, READ_SUFFIXES)
    suffix = path.suffix.lower()
    with prefixed(path.name):
        foreign = suffix in FOREIGN_SUFFIXES
        return read_foreign(path, data) if foreign else _READERS[suffix](data)


def file_extras(path: StrPath) -> list[str]:
    """Name what a mesh file holds besides its shape: colours, normals, materials ..."""
    path = as_path(path)
    suffix = path.suffix.lower()
    if suffix in _EXTRAS:
        return _EXTRAS[suffix](read_bytes(path, ()))
    return [] if suffix in (".xyz", ".npy") else ["anything but the shape"]


def as_mesh(mesh: MeshLike, name: str = "mesh") -> Mesh:
    """Turn anything that unbend accepts as a mesh into a :class:`Mesh`.

    Parameters
    ----------
    mesh : MeshLike: Mesh, path, (V, F) pair, (n, 3) array, or object with vertices and faces
        A path is read with :func:`unbend.read_mesh`. An object may carry ``.vertices`` and
        ``.faces`` (trimesh), or be a mesh or point cloud of Open3D, a mesh of meshio, a
        ``PolyData`` of PyVista or VTK, or a ``GiftiImage`` of nibabel. An (n, 3)
        array is a point cloud.
    name : str, default="mesh"
        What messages call a mesh that has no name of its own.

    Returns
    -------
    Mesh

    Raises
    ------
    InputError
        If the object is none of these.
    MeshError
        If its arrays break a rule of :class:`Mesh`.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend import as_mesh
    >>> as_mesh(np.eye(3))
    Mesh(3 points)
    """
    if isinstance(mesh, Mesh):
        unnamed = mesh.name == "mesh" != name
        return Mesh(mesh.vertices, mesh.faces, name=name, notes=mesh.notes) if unnamed else mesh
    given: Any = mesh
    if isinstance(given, (str, os.PathLike)):
        return read_mesh(given)
    if (found := mesh_of(given)) is not None:
        return as_mesh(found, name)
    if isinstance(given, tuple | list) and len(given) == 2:
        return Mesh(*given, name=name)
    if isinstance(given, np.ndarray):
        return Mesh(given, name=name)
    if isinstance(getattr(given, "mesh", None), Mesh):
        raise InputError(f"a {type(given).__name__} is not a mesh, but has one: give its .mesh")
    raise InputError(
        f"a {type(given).__name__} is not a mesh: give a Mesh, a file's path, a (vertices, faces) "
        "pair, an (n, 3) NumPy array of points, or an object with .vertices and .faces"
    )
