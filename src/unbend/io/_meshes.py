"""Reading and writing meshes, without ever changing the order of their vertices."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from unbend._arrays import array_of, numbers_of
from unbend._text import plural
from unbend._types import FloatArray
from unbend.errors import FileError, InputError
from unbend.io._files import atomic_write, check_writable, named, read_bytes
from unbend.io.formats import glb, obj, off, ply, points, stl
from unbend.io.formats.contents import Contents
from unbend.mesh import Mesh

_READERS: dict[str, Callable[[bytes], Contents]] = {
    ".off": off.read,
    ".obj": obj.read,
    ".ply": ply.read,
    ".stl": stl.read,
    ".xyz": points.read_xyz,
    ".npy": points.read_npy,
}
_WRITERS: dict[str, Callable[..., None]] = {
    ".off": off.write,
    ".obj": obj.write,
    ".ply": ply.write,
    ".stl": stl.write,
    ".glb": glb.write,
    ".xyz": points.write_xyz,
}

READ_SUFFIXES = tuple(_READERS)
WRITE_SUFFIXES = tuple(_WRITERS)
# Formats whose writers take colours and texture coordinates; .ply takes other values, too.
COLOR_SUFFIXES = (".ply", ".obj", ".glb")


def read_mesh(path: str | os.PathLike[str]) -> Mesh:
    r"""Read a triangle mesh or a point cloud.

    Vertices and faces keep the file's order and number. Polygons are split into fans of
    triangles, and the corners of an STL file, which stores no vertices, are welded where their
    positions are exactly equal; ``Mesh.notes`` says so.

    Parameters
    ----------
    path : path
        A file with the suffix .off (also COFF, NOFF), .obj, .ply (text or binary), .stl, .xyz
        (one point per line) or .npy (an (n, 3) array of points).

    Returns
    -------
    Mesh
        Named after the file. A file without faces gives a point cloud.

    Raises
    ------
    FileError
        If the file cannot be read: missing, of an unknown suffix, truncated, not of its format.
    MeshError
        If a face names a vertex that does not exist, or a vertex in use is not finite.

    See Also
    --------
    write_mesh : The reverse.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend import read_mesh
    >>> path = Path(tempfile.mkdtemp()) / "square.obj"
    >>> _ = path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    >>> mesh = read_mesh(path)
    >>> mesh
    Mesh(4 vertices, 2 faces)
    >>> mesh.notes
    ('1 polygon split into triangles',)
    """
    path = Path(path)
    data = read_bytes(path, READ_SUFFIXES)
    with named(path):
        contents = _READERS[path.suffix.lower()](data)
        if len(contents.vertices) == 0:
            raise FileError("holds no vertices")
    return Mesh(contents.vertices, contents.faces, name=path.name, notes=contents.notes)


def write_mesh(
    path: str | os.PathLike[str],
    mesh: MeshLike,
    *,
    scalars: Mapping[str, npt.ArrayLike] | None = None,
    colors: npt.ArrayLike | None = None,
    uvs: npt.ArrayLike | None = None,
    like: str | os.PathLike[str] | None = None,
) -> None:
    """Write a triangle mesh or a point cloud.

    OFF, OBJ, PLY and XYZ keep every position to the last bit, in the same order. STL stores
    bare triangles in single precision: vertex order is lost. GLB, which is glTF in one file, keeps
    the order, also in single precision; programs take y for its upward axis. It is not read. The
    file appears under its name only once it is complete.

    Parameters
    ----------
    path : path
        Where to write; the suffix (.off, .obj, .ply, .stl, .glb or .xyz) says the format.
    mesh : Mesh or anything that :func:`as_mesh` accepts
        What to write, for instance a ``(vertices, faces)`` pair.
    scalars : mapping of str to (n,) array_like of float, optional
        Values per vertex by name, stored as extra vertex properties. PLY only.
    colors : (n, 3) array_like of int, optional
        Red, green and blue per vertex, 0 to 255. PLY, OBJ and GLB only.
    uvs : (n, 2) array_like of float, optional
        Texture coordinates per vertex. PLY (as the properties s and t), OBJ and GLB
        only.
    like : path, optional
        An OBJ file that the mesh was read from. All its lines are kept (texture coordinates,
        materials, groups, polygons); only positions are replaced, and normals recomputed from the
        faces that share them. Names of material files are given relative to the new file; no file
        is copied. OBJ only, without `uvs`.

    Raises
    ------
    FileError
        If the suffix is unknown or the file cannot be written.
    InputError
        If the format cannot hold what was given, or arrays do not match the mesh.

    See Also
    --------
    read_mesh : The reverse.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend import read_mesh, write_mesh
    >>> path = Path(tempfile.mkdtemp()) / "triangle.ply"
    >>> vertices, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    >>> write_mesh(path, (vertices, faces), scalars={"distance": [0.0, 1.0, 1.0]})
    >>> read_mesh(path)
    Mesh(3 vertices, 1 faces)
    """
    path = check_writable(path, WRITE_SUFFIXES)
    suffix = path.suffix.lower()
    mesh = as_mesh(mesh)
    if scalars and suffix != ".ply":
        raise InputError(f"{suffix} files cannot hold values per vertex; write .ply")
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
        extras["scalars"] = _scalars(scalars, mesh.n_vertices)
    if colors is not None:
        extras["colors"] = _colors(colors, mesh.n_vertices)
    if uvs is not None:
        extras["uvs"] = _uvs(uvs, mesh.n_vertices)
    if like is not None:
        if uvs is not None or suffix != ".obj":
            raise InputError("like keeps the lines of an OBJ file: write .obj, and give no uvs")
        data = _rewritten(Path(like), path, mesh, extras.get("colors"))
    with atomic_write(path) as file:
        if like is not None:
            file.write(data)
        else:
            _WRITERS[suffix](file, mesh.vertices, mesh.faces, **extras)


def file_extras(path: str | os.PathLike[str]) -> list[str]:
    """Name what a mesh file holds besides its shape: colours, normals, materials ..."""
    path = Path(path)
    find = {".obj": obj.extras}.get(path.suffix.lower())
    return [] if find is None else find(read_bytes(path, ()))


def _rewritten(like: Path, path: Path, mesh: Mesh, colors: npt.NDArray[np.uint8] | None) -> bytes:
    """Give the lines of the OBJ file `like` with the positions of a mesh that came from it."""
    data = read_bytes(like, (".obj",))
    source, folder = os.path.realpath(like.parent), os.path.realpath(path.parent)
    try:
        prefix = os.path.relpath(source, folder)
    except ValueError:  # another drive of Windows
        prefix = source
    with named(like):
        contents = obj.read(data)
        if len(contents.vertices) != mesh.n_vertices or not np.array_equal(
            contents.faces, mesh.faces
        ):
            raise FileError("has other vertices or faces than the mesh; its lines cannot be kept")
        prefix = "" if prefix == "." else prefix.replace(os.sep, "/")
        return obj.rewrite(data, mesh.vertices, colors, os.fsencode(prefix))


def _scalars(scalars: Mapping[str, npt.ArrayLike], n_vertices: int) -> dict[str, FloatArray]:
    arrays = {}
    if not isinstance(scalars, Mapping):
        raise InputError("scalars must be a dictionary of names and values")
    for name, values in scalars.items():
        word = isinstance(name, str) and re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII)
        if not word or name in (*"xyz", *_COLOR_NAMES):
            raise InputError(
                f"{name!r} cannot name values per vertex; use letters, digits and underscores, "
                "and none of x, y, z, red, green, blue"
            )
        array = numbers_of(values, f"scalars {name!r}")
        if array.shape != (n_vertices,):
            raise InputError(
                f"scalars {name!r} have shape {array.shape}; the mesh needs one value for each "
                f"of its {plural(n_vertices, 'vertex')}"
            )
        arrays[name] = array
    return arrays


def _uvs(uvs: npt.ArrayLike, n_vertices: int) -> FloatArray:
    array = numbers_of(uvs, "uvs")
    if array.shape != (n_vertices, 2) or not np.isfinite(array).all():
        raise InputError(f"uvs must be finite numbers of shape ({n_vertices}, 2)")
    return array


_COLOR_NAMES = ("red", "green", "blue")


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


class HasFaces(Protocol):
    """What has vertices and faces, as a mesh of trimesh has."""

    @property
    def vertices(self) -> Any:
        """Positions, (n, 3)."""

    @property
    def faces(self) -> Any:
        """Vertex indices, (m, 3)."""


class HasPoints(Protocol):
    """What has points and triangles, as a ``PolyData`` of PyVista has."""

    @property
    def points(self) -> Any:
        """Positions, (n, 3)."""

    @property
    def regular_faces(self) -> Any:
        """Vertex indices, (m, 3)."""


MeshLike: TypeAlias = (
    Mesh
    | str
    | os.PathLike[str]
    | Sequence[npt.ArrayLike]
    | npt.NDArray[Any]
    | HasFaces
    | HasPoints
)
"""Whatever is taken for a mesh: see :func:`as_mesh`."""


def as_mesh(mesh: MeshLike) -> Mesh:
    """Turn anything that unbend accepts as a mesh into a :class:`Mesh`.

    Parameters
    ----------
    mesh : MeshLike: Mesh, path, (V, F) pair, (n, 3) array, or object with vertices and faces
        A path is read with :func:`unbend.read_mesh`. An object may carry ``.vertices`` and
        ``.faces`` (trimesh) or be a PyVista ``PolyData``. An (n, 3) array is a point cloud.

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
        return mesh
    given: Any = mesh
    if isinstance(given, (str, os.PathLike)):
        return read_mesh(given)
    if hasattr(given, "vertices") and hasattr(given, "faces"):
        return Mesh(given.vertices, given.faces)
    if hasattr(given, "points") and hasattr(given, "regular_faces"):  # PyVista PolyData
        if given.n_cells == 0 or given.is_all_triangles:
            return Mesh(given.points, given.regular_faces if given.n_cells else None)
        surface = given.triangulate()
        faces = surface.regular_faces if surface.n_cells else None
        notes = ("polygons split into triangles",) if surface.n_cells else ()
        return Mesh(surface.points, faces, notes=notes)
    if isinstance(given, tuple | list) and len(given) == 2:
        return Mesh(*given)
    if isinstance(given, np.ndarray):
        return Mesh(given)
    raise InputError(
        f"a {type(given).__name__} is not a mesh: give a Mesh, a file's path, a (vertices, faces) "
        "pair, or an object with .vertices and .faces"
    )
