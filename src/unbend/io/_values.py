"""Reading and writing values per vertex: numbers, labels, weights, colours."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import count, takewhile
from pathlib import Path
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from unbend._arrays import check_choice, check_whole, listed, values_of
from unbend._text import plural
from unbend._types import StrPath
from unbend.choices import ValueKind
from unbend.errors import FileError, InputError, warn
from unbend.io._colors import value_colors
from unbend.io._files import (
    as_path,
    atomic_write,
    check_writable,
    prefixed,
    read_bytes,
    write_table,
)
from unbend.io._foreign import MeshLike
from unbend.io._meshes import READ_SUFFIXES, as_mesh, file_extras, read_contents
from unbend.io._value_tables import read_table_of_values
from unbend.io._writing import COLOR_SUFFIXES, SCALAR_SUFFIXES, TAKEN, write_mesh
from unbend.io.formats.contents import Contents
from unbend.io.formats.npy import read_array, write_array

VALUE_SUFFIXES = (".npy", ".csv", ".txt")
_OPAQUE = "the transparency of colours is not kept"
_OF_CELLS = re.compile(rb"\nCELL_DATA|<CellData(?:[^>]*[^/])?>\s*<DataArray")  # of VTK
_NORMAL = ("nx", "ny", "nz")
# Columns of mesh files that are one value: colours, and texture coordinates by three programs.
_TOGETHER = (
    ("color", ("red", "green", "blue")),
    ("uv", ("s", "t")),
    ("uv", ("u", "v")),
    ("uv", ("texture_u", "texture_v")),
)


def read_values(
    path: StrPath, *, n_vertices: int | None = None, name: str | None = None
) -> npt.NDArray[Any]:
    r"""Read values per vertex.

    Parameters
    ----------
    path : path
        A .npy array; a .csv or .txt file with a line of numbers or one word for each vertex; or a
        mesh file with values (.ply, .obj, .vtk, .vtp or what trimesh and meshio read); .gii and
        FreeSurfer's .thickness, .curv, .sulc and .annot need no mesh, and are read by nibabel. A
        .csv file may begin with names of columns. If one is ``vertex``, ``index``, ``id`` or
        ``Point ID`` and holds all vertex numbers, from 0, rows may be in any order. Empty cells and
        NA among numbers are NaN.
    n_vertices : int, optional
        Rows that there must be.
    name : str, optional
        Which values of a mesh file: the name of a vertex property, ``"color"`` or ``"uv"``. Columns
        ``name_0``, ``name_1`` ... are read together. By default the only ones; colours and texture
        coordinates only if there are no others.

    Returns
    -------
    (n,) or (n, k) ndarray of int64, float64 or str, or of the .npy file's type

    Raises
    ------
    FileError
        If the file cannot be read or does not hold one row for each vertex.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from unbend.io import read_values
    >>> path = pathlib.Path(tempfile.mkdtemp(), "parts.csv")
    >>> _ = path.write_text("part\nhead\ntail\n")
    >>> read_values(path)
    array(['head', 'tail'], dtype='<U4')
    """
    return read_named_values(path, n_vertices=n_vertices, name=name)[0]


def read_named_values(
    path: StrPath, *, n_vertices: int | None = None, name: str | None = None
) -> tuple[npt.NDArray[Any], list[str]]:
    r"""Read values per vertex, as :func:`read_values`, and the names of their columns.

    There are no names where the file has none.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from unbend.io import read_named_values
    >>> path = pathlib.Path(tempfile.mkdtemp(), "weights.csv")
    >>> _ = path.write_text("hip,knee\n0.5,0.5\n1,0\n")
    >>> read_named_values(path)[1]
    ['hip', 'knee']
    """
    path = as_path(path)
    if n_vertices is not None:
        check_whole(n_vertices, "n_vertices")
    suffix = path.suffix.lower()
    if suffix in VALUE_SUFFIXES and name is not None:
        raise InputError(
            f"{path.name} is no mesh file, so all its columns are taken: leave out --property "
            f"(name= in Python), or keep the column {name} alone"
        )
    of_mesh = suffix in READ_SUFFIXES and suffix not in VALUE_SUFFIXES
    known = (*VALUE_SUFFIXES, *READ_SUFFIXES)
    given: Any = read_contents(path) if of_mesh else read_bytes(path, known)
    with prefixed(path.name):
        if of_mesh:
            values, names = _of_mesh(given, name, path)
        elif suffix == ".npy":
            values, names = read_array(given), []
        else:
            values, names = read_table_of_values(given, suffix, n_vertices)
        if values.ndim == 0 or values.size == 0:
            raise FileError("holds no rows")
        n = len(values)
        if n_vertices not in (None, n):
            need = plural(n_vertices, "vertex")
            raise FileError(f"holds {plural(n, 'row')}, but there are {need}")
    return values, names


def _of_mesh(
    contents: Contents, name: str | None, path: Path
) -> tuple[npt.NDArray[Any], list[str]]:
    """Choose among the values per vertex of a mesh file."""
    columns = contents.values()
    found = _grouped(columns)
    own = [key for key in found if key not in ("color", "uv")] or list(found)
    if name is None and (len(own) == 1 or own == ["color", "uv"]):
        name = own[0]
    if name in found:
        if name == "color" and (alpha := columns.get("alpha")) is not None:
            opaque = np.iinfo(alpha.dtype).max if alpha.dtype.kind == "u" else 1
            if (alpha < opaque).any():
                warn(_OPAQUE)
        return found[name], _numbered(name, found[name][:1].size)
    hint, extras = "", file_extras(path)
    if "texture coordinates" in extras:
        hint = "; registering carries its texture"
    elif "colours" in extras and "color" not in found:
        hint = "; its colours are not read: save it as .ply"
    elif _OF_CELLS.search(data := path.read_bytes()):
        hint = "; values of cells are not read: ParaView's Cell Data to Point Data converts them"
    elif b'"WEIGHTS_0"' in data:  # of glTF
        hint = "; its skinning weights are not read: in Blender, unbend's extension carries them"
    hint += "".join(f"; {note}" for note in contents.notes if "left out, since" in note)
    if not found:
        raise FileError(f"holds no values per vertex{hint}")
    lacks = "" if name is None else f"no {name}, but "
    held = ", ".join(found)
    raise FileError(
        f"holds {lacks}{held}; name one of them with --property (name= in Python){hint}"
    )


def _grouped(columns: dict[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Join columns that belong together, and leave out normals."""
    columns = {name: one for name, one in columns.items() if name not in (*_NORMAL, "alpha")}
    found: dict[str, npt.NDArray[Any]] = {}
    for name, parts in _TOGETHER:
        if name not in found and set(parts) <= set(columns):
            found[name] = np.column_stack([columns.pop(part) for part in parts])
    color = found.get("color")
    if color is not None and color.dtype.kind == "f":
        # Programs compute shares that are a little more than 1.
        scale = 255 if np.nanmax(color, initial=0) <= 1.5 else 1
        found["color"] = np.rint(np.clip(np.nan_to_num(color) * scale, 0, 255)).astype(np.uint8)
    elif color is not None and color.dtype.itemsize == 2 and color.max(initial=0) > 255:
        found["color"] = np.rint(color / 257).astype(np.uint8)  # 65535 is full
    for name in list(columns):
        stem = name.removesuffix("_0")
        numbered = list(takewhile(columns.__contains__, (f"{stem}_{i}" for i in count())))
        if stem not in {**found, **columns} and len(numbered) > 1:
            found[stem] = np.column_stack([columns.pop(part) for part in numbered])
    found |= {name: np.array(one) for name, one in columns.items()}
    label = found.get("label", np.empty(0, int))
    if label.dtype.kind == "f" and ((label == np.rint(label)) & (np.abs(label) < 2**53)).all():
        found["label"] = label.astype(np.int64)  # as write_values writes them
    return found


def write_values(
    path: StrPath,
    values: npt.ArrayLike,
    mesh: MeshLike,
    *,
    kind: str = "scalar",
    names: Sequence[str] = (),
    like: StrPath | None = None,
) -> None:
    """Write values per vertex, as a table or on a mesh.

    Parameters
    ----------
    path : path
        .npy, .csv or .txt: a table; .ply, .vtp: the mesh with the values as its properties, and as
        colours too where there is one for each vertex (colours and texture coordinates as such);
        .obj, .glb: the mesh with colours or texture coordinates.
    values : (n,) or (n, k) array_like
    mesh : mesh-like
        With n vertices.
    kind : str, default="scalar"
        What the columns mean to a mesh file: ``"scalar"``, ``"label"``, ``"weights"``, ``"color"``
        or ``"uv"``.
    names : sequence of str, optional
        Of the columns, in .csv, .ply and .vtp files. Mesh files hold labels, colours and texture
        coordinates under names of their own, and what cannot be in a name there is replaced by _.
        Columns without a name of their own are numbered, with a warning.
    like : path, optional
        An OBJ file whose lines an .obj file keeps, see :func:`unbend.write_mesh`.

    Raises
    ------
    FileError
        If the file cannot be written.
    InputError
        If the format cannot hold such values, or there are more or fewer names than columns.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from unbend.io import write_values
    >>> path = pathlib.Path(tempfile.mkdtemp(), "heights.csv")
    >>> write_values(path, [0.5, 2, 1], np.eye(3))
    >>> path.read_text().split()
    ['value', '0.5', '2.0', '1.0']
    """
    path = check_writable(path, VALUE_SUFFIXES + COLOR_SUFFIXES)
    suffix = path.suffix.lower()
    mesh = as_mesh(mesh)
    check_choice(kind, "kind", [one for one in get_args(ValueKind) if one != "auto"])
    array = values_of(values)
    if array.size == 0 or array.ndim == 0 or len(array) != mesh.n_vertices:
        need = plural(mesh.n_vertices, "vertex")
        raise InputError(f"values must have one row for each of {need}")
    check_storable(path, array, kind)
    columns = array.reshape(len(array), -1)
    names = listed(names, "names")
    if len(names) not in (0, columns.shape[1]):
        raise InputError(
            f"{plural(columns.shape[1], 'column')} cannot have {plural(len(names), 'name')}"
        )
    names = _names(names, columns.shape[1], kind, path)
    rows = (columns.astype(np.int64) if columns.dtype == bool else columns).tolist()
    if kind == "label" and array.dtype.kind == "f":  # some are missing: whole numbers stay whole
        rows = [[str(value).removesuffix(".0") for value in row] for row in rows]
    if suffix == ".npy":
        with atomic_write(path) as file:
            write_array(file, array)
    elif suffix == ".csv":
        # Quoted, a row that begins with # is not read as a comment.
        marked = any(str(row[0]).startswith("#") for row in rows)
        write_table(path, [names, *rows], quote_all=marked)
    elif suffix == ".txt":
        with atomic_write(path) as file:
            file.write("".join(f"{' '.join(map(str, row))}\n" for row in rows).encode())
    elif kind == "color":
        if columns.shape[1] > 3 and (columns[:, 3] < 255).any():
            warn(_OPAQUE)
        write_mesh(path, mesh, colors=columns[:, :3], like=like)
    elif kind == "uv":
        # A vertex without texture coordinates still needs numbers to be drawn at all.
        known = np.isfinite(array).all(axis=1, keepdims=True)
        write_mesh(path, mesh, uvs=np.where(known, array, 0.0))
        if unknown := int((~known).sum()):
            warn(f"{path.name}: {plural(unknown, 'vertex')} without texture coordinates: 0, 0")
    else:
        shown = len(names) == 1 or kind == "weights"
        write_mesh(
            path,
            mesh,
            scalars=dict(zip(names, columns.T, strict=True)) if suffix in SCALAR_SUFFIXES else None,
            colors=value_colors(array, kind=kind) if shown else None,
            like=like,
        )


def _names(given: Sequence[str], width: int, kind: str, path: Path) -> list[str]:
    """Names of columns: those given if a file can have them."""
    suffix = path.suffix.lower()
    numbered = _numbered(kind if kind in ("label", "color", "uv") else "value", width)
    own = kind in ("color", "uv") or (kind == "label" and suffix != ".csv")
    if own or len(given) == 0:
        return numbered
    names, taken, need = list(given), ("",), "give each a name of its own"
    if suffix != ".csv":
        names = [re.sub(r"\W|^(?=\d)", "_", name, flags=re.ASCII) for name in given]
        taken, need = ("", *TAKEN), "names there differ in letters from A to Z; .csv keeps others"
    clear = [names.count(name) == 1 and name not in taken for name in names]
    kept = [names[i] if clear[i] else numbered[i] for i in range(width)]
    if len(set(kept)) < width:
        kept = numbered
    lost = [i for i in range(width) if kept[i] != names[i]]
    if lost and suffix in (".csv", *SCALAR_SUFFIXES):
        old, new = (", ".join(some[i] for i in lost) for some in (given, kept))
        warn(f"{path.name}: renamed {old} to {new}: {need}")
    return kept


def _numbered(name: str, width: int) -> list[str]:
    return [f"{name}_{i}" for i in range(width)] if width > 1 else [name]


def check_storable(path: StrPath, values: npt.NDArray[Any], kind: str) -> None:
    """Raise InputError if the format cannot hold such values, before anything is computed."""
    suffix = Path(path).suffix.lower()
    if suffix in SCALAR_SUFFIXES and values.dtype.kind == "U":
        raise InputError(f"{suffix} files cannot hold text for each vertex; write .csv")
    if suffix in (".obj", ".glb") and kind in ("scalar", "weights") and values[:1].size > 1:
        raise InputError(
            f"{suffix} files show a colour for each vertex, not {values[:1].size} numbers; "
            "write .ply"
        )
    words = np.unique(values).tolist() if suffix == ".txt" and values.dtype.kind == "U" else []
    if not all(re.fullmatch(r"[^#\s]\S*", word) for word in words):
        raise InputError(
            ".txt files hold one word for each vertex, and a label is empty or more than one; "
            "write .csv"
        )
    if suffix != ".npy" and values.ndim > 2:
        raise InputError(f"{suffix} files hold one or two dimensions; write .npy")
