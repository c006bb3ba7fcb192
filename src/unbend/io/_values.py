"""Reading and writing values per vertex: numbers, labels, weights, colours."""

from __future__ import annotations

import csv
import re
from itertools import count, takewhile
from pathlib import Path
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from unbend._arrays import values_of
from unbend._text import plural
from unbend._types import StrPath
from unbend.choices import ValueKind
from unbend.errors import FileError, InputError, warn
from unbend.io._colors import value_colors
from unbend.io._files import atomic_write, check_writable, prefixed, read_bytes, write_table
from unbend.io._foreign import MeshLike
from unbend.io._meshes import READ_SUFFIXES, as_mesh, read_contents
from unbend.io._writing import COLOR_SUFFIXES, SCALAR_SUFFIXES, write_mesh
from unbend.io.formats.contents import are_numbers, misfit, text_lines
from unbend.io.formats.npy import read_array

VALUE_SUFFIXES = (".npy", ".csv", ".txt")
_MOST_LETTERS = 1000
_OPAQUE = "the transparency of colours is not kept"
# Names of columns of vertex numbers, without blanks; pandas and R give theirs none.
_NUMBERS = ("vertex", "vertexid", "vertexindex", "pointid", "index", "id", "", "unnamed:0")
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
        mesh file with values (.ply, .obj or what trimesh and meshio read). A .csv file may begin
        with names of columns. If one is ``vertex``, ``index``, ``id`` or ``Point ID`` and holds all
        vertex numbers, from 0, rows may be in any order. Empty cells and NA among numbers are NaN.
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
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in VALUE_SUFFIXES and name is not None:
        raise InputError(f"{path.name} is no mesh file: it has no values of the name {name}")
    of_mesh = suffix in READ_SUFFIXES and suffix not in VALUE_SUFFIXES
    known = (*VALUE_SUFFIXES, *READ_SUFFIXES)
    given: Any = read_contents(path) if of_mesh else read_bytes(path, known)
    with prefixed(path.name):
        if of_mesh:
            values = _of_mesh(given.values(), name)
        else:
            values = read_array(given) if suffix == ".npy" else _table(given, suffix, n_vertices)
        if values.ndim == 0 or values.size == 0:
            raise FileError("holds no rows")
        n = len(values)
        if n_vertices not in (None, n):
            raise FileError(f"holds {plural(n, 'row')}, but there are {n_vertices} vertices")
    return values


def _of_mesh(columns: dict[str, npt.NDArray[Any]], name: str | None) -> npt.NDArray[Any]:
    """Choose among the values per vertex of a mesh file."""
    found = _grouped(columns)
    own = [key for key in found if key not in ("color", "uv")] or list(found)
    if name is None and (len(own) == 1 or own == ["color", "uv"]):
        name = own[0]
    if name in found:
        if name == "color" and (alpha := columns.get("alpha")) is not None:
            opaque = np.iinfo(alpha.dtype).max if alpha.dtype.kind == "u" else 1
            if (alpha < opaque).any():
                warn(_OPAQUE)
        return found[name]
    if not found:
        raise FileError("holds no values per vertex")
    raise FileError(f"holds {', '.join(found)}; name one of them with --property (name= in Python)")


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
    like : path, optional
        An OBJ file whose lines an .obj file keeps, see :func:`unbend.write_mesh`.

    Raises
    ------
    FileError
        If the file cannot be written.
    InputError
        If the format cannot hold such values.

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
    if kind == "auto" or kind not in get_args(ValueKind):
        raise InputError(f"kind must be scalar, label, weights, color or uv, not {kind!r}")
    array = values_of(values, "values")
    if array.size == 0 or array.ndim == 0 or len(array) != mesh.n_vertices:
        raise InputError(f"values must have one row for each of {mesh.n_vertices} vertices")
    check_storable(path, array, kind)
    columns = array.reshape(len(array), -1)
    word = kind if kind in ("label", "color", "uv") else "value"
    names = [f"{word}_{i}" for i in range(columns.shape[1])] if columns.shape[1] > 1 else [word]
    rows = (columns.astype(np.int64) if columns.dtype == bool else columns).tolist()
    if suffix == ".npy":
        with atomic_write(path) as file:
            np.save(file, array)
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
        write_mesh(path, mesh, uvs=np.nan_to_num(array))
    else:
        shown = len(names) == 1 or kind == "weights"
        write_mesh(
            path,
            mesh,
            scalars=dict(zip(names, columns.T, strict=True)) if suffix in SCALAR_SUFFIXES else None,
            colors=value_colors(array, kind=kind) if shown else None,
            like=like,
        )


def check_storable(path: StrPath, values: npt.NDArray[Any], kind: str) -> None:
    """Raise InputError if the format cannot hold such values, before anything is computed."""
    suffix = Path(path).suffix.lower()
    if suffix in SCALAR_SUFFIXES and values.dtype.kind == "U":
        raise InputError(f"{suffix} files cannot hold text for each vertex; write .csv")
    if suffix in (".obj", ".glb") and kind == "scalar" and values[:1].size > 1:
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


def _table(data: bytes, suffix: str, n_vertices: int | None) -> npt.NDArray[Any]:
    lines = [line for line in text_lines(data, suffix[1:]) if re.match(r"\s*[^\s#]", line)]
    header: list[str] = []
    if suffix == ".txt":
        rows = [re.sub(r"\s#.*", "", line).split() for line in lines]
    else:
        try:
            cells = csv.reader(f"{line}\n" for line in lines)
            rows = [[word.strip() for word in row] for row in cells]
        except csv.Error as error:
            raise FileError(f"not a table in CSV: {error}") from None
        # A column's name cannot be told from words, except by the number of rows or by numbers.
        first, rest = (rows[0], rows[1:]) if rows else ([], [])
        if not are_numbers(word for word in first if word.lower() not in ("na", "n/a")) and (
            len(rows) != n_vertices
            or (not are_numbers(_filled(first)) and (len(first) > 1 or _are_numeric(rest)))
        ):
            header, rows = first, rest
    if not rows:
        return np.empty(0)
    for i, row in enumerate(rows):
        if len(row) != len(rows[0]):
            raise FileError(f"row {i} has {len(row)} entries, but row 0 has {len(rows[0])}")
        # An array of words gives each as much room as the longest.
        if max(map(len, row)) > _MOST_LETTERS:
            raise FileError(f"row {i} holds a word of more than {_MOST_LETTERS} letters")
    if suffix == ".csv":
        _refuse_decimal_commas(header, rows)
        rows = rows if len(rows[0]) == 1 else _by_vertex(header, rows)
    numeric = [are_numbers(row) for row in rows]
    if not all(numeric) and _are_numeric(rows):
        rows, numeric = [_filled(row) for row in rows], [True]
    table = np.array(rows)
    if all(numeric):
        whole = all(word.lstrip("+-").isdecimal() for row in rows for word in row)
        try:
            table = table.astype(np.int64 if whole else np.float64)
        except OverflowError:
            large = next(i for i, row in enumerate(rows) if any(len(word) > 18 for word in row))
            problem = ", more than 64 bits can hold"
            raise misfit(f"row {large}", " ".join(rows[large]), problem) from None
    elif table.shape[1] > 1:
        bad = numeric.index(False)
        raise misfit(f"row {bad}", " ".join(rows[bad]), ", not numbers")
    else:
        _refuse_numbers_as_labels([row[0] for row in rows])
    return table[:, 0] if table.shape[1] == 1 else table


def _filled(row: list[str]) -> list[str]:
    """Write nan for missing numbers, as pandas, R and spreadsheets leave them."""
    return ["nan" if word.lower() in ("", "na", "n/a") else word for word in row]


def _are_numeric(rows: list[list[str]]) -> bool:
    """Whether each column has numbers, and else only cells where one is missing."""
    some = all(any(are_numbers([word]) for word in column) for column in zip(*rows, strict=False))
    return bool(rows) and some and all(are_numbers(_filled(row)) for row in rows)


def _in_order(rows: list[list[str]]) -> list[list[str]]:
    """Sort rows by their first word, the number of a vertex, and remove it."""
    found: dict[str, list[str]] = {}
    for i, (vertex, *words) in enumerate(rows):
        if vertex in found:
            raise FileError(f"row {i} holds vertex {vertex[:20]!r} again")
        found[vertex] = words
    numbers = [str(i) for i in range(len(rows))]
    for vertex in numbers:
        if vertex not in found:
            raise FileError(f"holds no row of vertex {vertex}: all are needed, counted from 0")
    return [found[vertex] for vertex in numbers]


def _by_vertex(header: list[str], rows: list[list[str]]) -> list[list[str]]:
    """Sort rows by a column that is named like vertex numbers and holds all, and remove it."""
    names = [re.sub(r"[\s_-]", "", name.lower()) for name in header]
    if names and names[0] == "vertex":
        return _in_order(rows)
    for i in (names.index(name) for name in _NUMBERS if name in names):
        numbers = [float(row[i]) for row in rows if are_numbers([row[i]])]
        if sorted(numbers) == list(range(len(rows))):
            return [rows[at][:i] + rows[at][i + 1 :] for at in np.argsort(numbers)]
        if sorted(numbers) == list(range(1, len(rows) + 1)):
            raise FileError(f"column {header[i]!r} numbers vertices from 1; count them from 0")
    first = [row[0] for row in rows]
    every = [str(i) for i in range(len(rows))]
    numbered = header and header[0].endswith("_0")  # one of several of a name
    if first != every and not numbered and set(first) == set(every):
        raise FileError(
            f"its first column holds each number from 0 to {len(rows) - 1} once: name it vertex if "
            "these are vertex numbers, else put another first"
        )
    return rows


def _refuse_decimal_commas(header: list[str], rows: list[list[str]]) -> None:
    """Refuse columns that are the two sides of decimal commas, as far as that can be known."""
    if header and rows and len(rows[0]) != len(header):
        raise FileError(
            f"the first line names {plural(len(header), 'column')}, but row 0 holds "
            f"{','.join(rows[0])[:40]!r}; write decimal points, and a name for each column"
        )
    pairs = (",".join(row[i : i + 2]) for row in rows for i in range(0, len(row), 2))
    if header or not all(re.fullmatch(r"[+-]?\d+,\d+", pair) for pair in pairs):
        return
    for i, row in enumerate(rows):
        # No number begins with -0, or with 0 before other digits.
        if re.search(r"^-0,|,0\d", ",".join(row)):
            problem = ", whose commas may be decimal ones; write decimal points"
            raise misfit(f"row {i}", ",".join(row), problem)


def _refuse_numbers_as_labels(words: list[str]) -> None:
    """Refuse words like 0,5 or 1;2, which are misread numbers rather than labels."""
    for index, word in enumerate(words):
        first, *more = re.split(r"[,;\t#]", word)
        if more and are_numbers([first]):
            problem = (
                ", neither a number nor a label; write decimal points, and separate columns by "
                "commas in .csv, by blanks in .txt"
            )
            raise misfit(f"row {index}", word, problem)
