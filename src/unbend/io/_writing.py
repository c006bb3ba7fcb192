"""Writing meshes, without ever changing the order of their vertices."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._arrays import array_of, coarse_steps, numbers_of
from unbend._text import plural
from unbend._types import FloatArray, StrPath
from unbend.errors import FileError, InputError, warn
from unbend.io._files import atomic_write, check_writable, prefixed, read_bytes
from unbend.io._foreign import MeshLike, moved_glb, read_foreign
from unbend.io._meshes import as_mesh
from unbend.io.formats import gltf, obj, off, ply, points, stl, vtp
from unbend.mesh import Mesh

_WRITERS: dict[str, Callable[..., None]] = {
    ".off": off.write,
    ".obj": obj.write,
    ".ply": ply.write,
    ".stl": stl.write,
    ".glb": gltf.write,
    ".vtp": vtp.write,
    ".xyz": points.write_xyz,
}

WRITE_SUFFIXES = tuple(_WRITERS)
# Formats whose writers take colours and texture coordinates, and those that take any values.
COLOR_SUFFIXES = (".ply", ".obj", ".glb", ".vtp")
SCALAR_SUFFIXES = (".ply", ".vtp")
# Names that values cannot have there, the last beside colours.
TAKEN = (*"xyz", "red", "green", "blue", "color")
_SINGLE_SUFFIXES = (".stl", ".glb")  # hold positions in single precision


def write_mesh(
    path: StrPath,
    mesh: MeshLike,
    *,
    scalars: Mapping[str, npt.ArrayLike] | None = None,
    colors: npt.ArrayLike | None = None,
    uvs: npt.ArrayLike | None = None,
    like: StrPath | None = None,
) -> None:
    """Write a triangle mesh or a point cloud.

    OFF, OBJ, PLY, XYZ and VTP (for ParaView) keep every position to the last bit, in the same
    order. STL stores bare triangles in single precision: vertex order is lost. GLB, which is glTF
    in one file, keeps the order, also in single precision; programs take y for its upward axis. The
    file appears under its name only once it is complete.

    Parameters
    ----------
    path : path
        The suffix (.off, .obj, .ply, .stl, .glb, .vtp or .xyz) says the format.
    mesh : mesh-like
    scalars : mapping of str to (n,) array_like of float, optional
        Values per vertex by name, stored as extra vertex properties. PLY and VTP only.
    colors : (n, 3) array_like of int, optional
        Red, green and blue per vertex, 0 to 255. PLY, OBJ, GLB and VTP only.
    uvs : (n, 2) array_like of float, optional
        Texture coordinates per vertex. PLY (as properties s and t), OBJ, GLB and VTP only.
    like : path, optional
        An OBJ or GLB file that the mesh was read from, to write the same format, without `uvs`.
        All it holds is kept (texture coordinates, materials, groups, polygons); only positions
        are replaced, and, if any moved, normals recomputed from the faces that share them. Those
        of an OBJ file are left out where these now face elsewhere, and names of its material
        files are given relative to the new file; no file is copied. A GLB file takes no `colors`,
        and must not have bones, morph targets or compression.

    Raises
    ------
    FileError
        If the suffix is unknown or the file cannot be written.
    InputError
        If the format cannot hold what was given, or arrays do not match the mesh.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from unbend import read_mesh, write_mesh
    >>> path = pathlib.Path(tempfile.mkdtemp(), "triangle.ply")
    >>> vertices, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    >>> write_mesh(path, (vertices, faces), scalars={"distance": [0.0, 1.0, 1.0]})
    >>> read_mesh(path)
    Mesh(3 vertices, 1 faces)
    """
    path = check_writable(path, WRITE_SUFFIXES)
    suffix = path.suffix.lower()
    mesh = as_mesh(mesh)
    if not isinstance(scalars, Mapping | None):
        raise InputError("scalars must be a dictionary of names and values")
    if scalars and suffix not in SCALAR_SUFFIXES:
        raise InputError(f"{suffix} files cannot hold values per vertex; write .ply or .vtp")
    if suffix not in COLOR_SUFFIXES and (colors is not None or uvs is not None):
        raise InputError(
            f"{suffix} files cannot hold colours or texture coordinates per vertex; write .ply"
        )
    if suffix == ".xyz" and mesh.n_faces:
        raise InputError(".xyz files hold points only; write .off, .obj or .ply to keep the faces")
    if suffix == ".stl" and not mesh.n_faces:
        raise InputError(".stl files hold triangles only; write points as .ply or .xyz")
    extras: dict[str, Any] = {}
    if scalars:
        taken = [*(TAKEN if colors is not None else TAKEN[:-1])]
        taken += ["s", "t", "uv"] if uvs is not None else []
        extras["scalars"] = _scalars(scalars, mesh.n_vertices, taken)
    if colors is not None:
        extras["colors"] = _colors(colors, mesh.n_vertices)
    if uvs is not None:
        extras["uvs"] = array = numbers_of(uvs, "uvs")
        if array.shape != (mesh.n_vertices, 2) or not np.isfinite(array).all():
            raise InputError(f"uvs must be finite numbers of shape ({mesh.n_vertices}, 2)")
    if like is not None:
        if uvs is not None or suffix not in (".obj", ".glb"):
            raise InputError("like keeps what an OBJ or GLB file holds: write one, and give no uvs")
        if suffix == ".glb" and colors is not None:
            raise InputError("like keeps the looks of a GLB file: give no colors")
        data = _rewritten(Path(like), path, mesh, extras.get("colors"))
    if suffix in _SINGLE_SUFFIXES and mesh.n_vertices:
        _check_rounding(path, mesh)
    if suffix == ".glb" and (nowhere := int((~np.isfinite(mesh.vertices)).any(axis=1).sum())):
        warn(f"{path.name}: {plural(nowhere, 'vertex')} without position: 0, 0, 0")
    with atomic_write(path) as file:
        if like is not None:
            file.write(data)
        else:
            _WRITERS[suffix](file, mesh.vertices, mesh.faces, **extras)


def _check_rounding(path: Path, mesh: Mesh) -> None:
    """Warn if single precision, too far from the origin, moves vertices that are close."""
    used = mesh.vertices[np.unique(mesh.faces)] if mesh.n_faces else mesh.vertices
    if np.abs(used).max() > np.finfo(np.float32).max:
        kind = path.suffix[1:].upper()
        raise InputError(f"{kind} holds single-precision numbers, which these positions exceed")
    coarse = coarse_steps(used)
    if coarse is None or (used.astype(np.float32) == used).all():
        return
    step, apart = coarse
    warn(
        f"{path.name}: positions are rounded to about {step:.1g}, and vertices are about "
        f"{apart:.1g} apart; move the shape to the origin, or write .ply"
    )


def _rewritten(like: Path, path: Path, mesh: Mesh, colors: npt.NDArray[np.uint8] | None) -> bytes:
    """Give what the file `like` holds, with the positions of a mesh that came from it."""
    suffix = path.suffix.lower()
    data = read_bytes(like, (suffix,))
    with prefixed(like.name):
        contents = read_foreign(like, data) if suffix == ".glb" else obj.read(data)
        if len(contents.vertices) != mesh.n_vertices or not np.array_equal(
            contents.faces, mesh.faces
        ):
            raise FileError("has other vertices or faces than the mesh; nothing of it can be kept")
        if suffix == ".glb":
            return moved_glb(data, contents.vertices, mesh)
        moved = not np.array_equal(contents.vertices, mesh.vertices, equal_nan=True)
        folder = _way(path.parent, like.parent)
        return obj.rewrite(data, mesh.vertices, colors, folder, normals=moved)


def keeps_all(path: StrPath, original: StrPath) -> bool:
    """Whether a mesh, read from a file, can be written with all else that the file holds."""
    path, original = Path(path), Path(original)
    suffix = original.suffix.lower()
    if suffix != path.suffix.lower() or suffix not in (".obj", ".glb"):
        return False
    return suffix == ".obj" or gltf.is_movable(read_bytes(original, ()))


def moved_obj(path: StrPath, folder: StrPath) -> bytes:
    """Give the bytes of an OBJ file as they are right in another folder, for its material files."""
    return obj.with_materials_in(read_bytes(Path(path), ()), _way(folder, Path(path).parent))


def _way(here: StrPath, there: StrPath) -> bytes:
    """Relative path from a folder to another, as OBJ files name it; nothing if it is the same."""
    there = os.path.realpath(there)
    try:
        way = os.path.relpath(there, os.path.realpath(here))
    except ValueError:  # another drive of Windows
        way = str(there)
    return b"" if way == "." else os.fsencode(way.replace(os.sep, "/"))


def _scalars(
    scalars: Mapping[str, npt.ArrayLike], n_vertices: int, taken: list[str]
) -> dict[str, FloatArray]:
    arrays = {}
    for name, values in scalars.items():
        word = isinstance(name, str) and re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII)
        if not word or name in taken:
            raise InputError(
                f"{name!r} cannot name values per vertex; use letters, digits and underscores, "
                f"and none of {', '.join(taken)}"
            )
        given = array_of(values, f"scalars {name!r}")
        array = numbers_of(given, f"scalars {name!r}")
        if array.shape != (n_vertices,):
            raise InputError(
                f"scalars {name!r} have shape {array.shape}; the mesh needs one value for each "
                f"of its {plural(n_vertices, 'vertex')}"
            )
        if given.dtype.kind in "iu" and np.abs(array).max(initial=0) >= 2**53:
            raise InputError(
                f"scalars {name!r}: whole numbers must be below 2^53, since files hold them as "
                "doubles; number them anew, or write a table"
            )
        arrays[name] = array
    return arrays


def _colors(colors: npt.ArrayLike, n_vertices: int) -> npt.NDArray[np.uint8]:
    array = array_of(colors, "colors")
    if array.shape != (n_vertices, 3) or array.dtype.kind not in "iu":
        raise InputError(
            f"colors must be whole numbers of shape ({n_vertices}, 3), not {array.dtype} of "
            f"shape {array.shape}"
        )
    if array.size and (array.min() < 0 or array.max() > 255):
        raise InputError("colors must lie between 0 and 255")
    return array.astype(np.uint8)
