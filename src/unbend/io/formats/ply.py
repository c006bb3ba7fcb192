"""PLY: text or binary, of either byte order; positions in any number type."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.errors import FileError
from unbend.io.formats.contents import (
    BYTE_ORDER_MARK,
    NO_FACES,
    Contents,
    count,
    left_out,
    left_over,
    numbers_in,
    polygon_rows,
    positions,
    text_lines,
    triangulate,
)

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_INDICES = ("vertex_indices", "vertex_index")
_SHAPE = (*"xyz", *_INDICES)
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class _Element:
    name: str
    count: int
    # Of each property the type, and that of a list's length; None: not a list.
    types: dict[str, tuple[str, str | None]] = field(default_factory=dict)

    @property
    def indices(self) -> str:
        """Name of the list of vertex numbers."""
        return next((name for name in _INDICES if name in self.types), "")

    @property
    def scalars(self) -> list[str]:
        """Names of the numbers besides positions."""
        return [name for name, (_, size) in self.types.items() if not size and name not in _SHAPE]

    def truncated(self, left: str) -> FileError:
        """Make the error for a file that ends in this element."""
        rows = plural(self.count, f"{self.name} row")
        return FileError(f"truncated or damaged: it promises {rows}, but holds {left}")


def read(data: bytes) -> Contents:
    """Read the positions and faces, and on demand the other numbers of vertices."""
    order, elements, body = _header(data.removeprefix(BYTE_ORDER_MARK))
    if "vertex" not in elements or elements["vertex"].count == 0:
        raise FileError("holds no vertices")
    if "tristrips" in elements and elements["tristrips"].count:
        raise FileError("holds triangle strips, which unbend cannot read; save it as triangles")
    types = elements["vertex"].types
    if any(axis not in types or types[axis][1] for axis in "xyz"):
        raise FileError("has vertices without the properties x, y and z")
    if "face" in elements and elements["face"].count:
        types = elements["face"].types
        if set(_INDICES) <= set(types):
            raise FileError(f"has faces with both {_INDICES[0]} and {_INDICES[1]}; keep one")
        index_type, size_type = types.get(elements["face"].indices, ("", None))
        if size_type is None:
            raise FileError("has faces without the property list vertex_indices")
        if index_type[0] == "f":
            raise FileError("has faces whose vertex indices are not whole numbers")
    return _read_binary(body, elements, order) if order else _read_text(body, elements)


def extras(data: bytes) -> list[str]:
    """Name the properties of vertices and faces besides positions and vertex numbers."""
    _, elements, _ = _header(data.removeprefix(BYTE_ORDER_MARK))
    return [name for one in elements.values() for name in one.types if name not in _SHAPE]


def _header(data: bytes) -> tuple[str, dict[str, _Element], bytes]:
    """Read the byte order (text: none) and the elements; what follows is the body."""
    if not re.match(rb"ply\s*[\r\n]", data):
        raise FileError("not a PLY file: it does not start with the line ply")
    end = re.search(rb"[\r\n]end_header[ \t]*(\r\n|\n|\r)", data)
    if end is None:
        raise FileError("truncated, or not a PLY file: it has no line end_header")
    encoding = ""
    elements: dict[str, _Element] = {}
    types: dict[str, tuple[str, str | None]] | None = None  # of the element at hand
    for line in text_lines(data[: end.start()], "PLY")[1:]:
        words = line.split()
        match words:
            case [] | ["comment" | "obj_info", *_]:
                continue
            case ["format", encoding, _] if encoding in _ORDERS:
                continue
            case ["element", name, number]:
                known, element = name in elements, _Element(name, count(number, f"{name} rows"))
                elements[name], types = element, element.types
            case ["property", "list", size, kind, name] if (
                types is not None and kind in _TYPES and _TYPES.get(size, "f")[0] != "f"
            ):
                known, types[name] = name in types, (_TYPES[kind], _TYPES[size])
            case ["property", kind, name] if types is not None and kind in _TYPES:
                known, types[name] = name in types, (_TYPES[kind], None)
            case _:
                raise FileError(f"has a header line that PLY does not know: {line[:60]!r}")
        if known:
            last = [*elements][-1]
            what = f"the element {name}" if words[0] == "element" else f"a property of {last}"
            raise FileError(f"names {what} twice")
    if not encoding:
        raise FileError("has no format line (ascii, binary_little_endian or binary_big_endian)")
    return _ORDERS[encoding], elements, data[end.end() :]


def _read_text(body: bytes, elements: dict[str, _Element]) -> Contents:
    lines = [line for line in text_lines(body, "PLY") if line and not line.isspace()]
    at, rows = 0, dict[str, list[list[str]]]()
    for element in elements.values():
        if not element.types:
            continue  # its rows are empty lines, which were dropped
        if element.count > len(lines) - at:
            raise element.truncated(plural(len(lines) - at, "line"))
        rows[element.name] = [line.split() for line in lines[at : at + element.count]]
        at += element.count
    vertices = positions(_words(elements["vertex"], rows["vertex"], "xyz"))
    faces, notes = NO_FACES, list[str]()
    if rows.get("face"):
        face = elements["face"]
        faces, notes = polygon_rows(_words(face, rows["face"], [face.indices]), vertices)
    notes += left_out(len(lines) - at, "line", "row")

    def values() -> dict[str, npt.NDArray[Any]]:
        element = elements["vertex"]
        words = _words(element, rows["vertex"], element.scalars)
        return {
            name: numbers_in(
                [[row[i]] for row in words], element.types[name][0], "number of its type", "vertex"
            )
            for i, name in enumerate(element.scalars)
        }

    return Contents(vertices, faces, tuple(notes), values)


def _words(element: _Element, rows: list[list[str]], names: Sequence[str]) -> list[list[str]]:
    """Words of some properties of each row, perhaps with more after them; a list's length first."""
    if list(element.types)[: len(names)] == list(names):
        return rows
    found, wanted = [], set(names)
    for index, row in enumerate(rows):
        at, words = 0, {}
        for name, (_, size_type) in element.types.items():
            if at >= len(row):
                raise FileError(f"{element.name} {index} has fewer numbers than properties")
            end = at + 1
            if size_type:
                end += count(row[at], f"entries in {element.name} {index}")
            if name in wanted:
                words[name] = row[at:end]
            at = end
        found.append([word for name in names for word in words[name]])
    return found


def _read_binary(body: bytes, elements: dict[str, _Element], order: str) -> Contents:
    at, vertices, faces, notes = 0, np.empty((0, 3)), NO_FACES, list[str]()
    values: dict[str, npt.NDArray[Any]] = {}
    polygons: tuple[IntArray, IntArray] | None = None
    for element in elements.values():
        least_bytes = sum(np.dtype(size or kind).itemsize for kind, size in element.types.values())
        if element.count * least_bytes > len(body) - at:
            raise element.truncated(plural(len(body) - at, "byte"))
        if not element.types or not element.count:
            continue
        rows = _uniform_rows(body, at, element, order)
        if rows is None:
            lists, at = _ragged_rows(body, at, element, order)
            if element.name == "face":
                polygons = lists
            elif element.name == "vertex":
                raise FileError("has vertices with lists of different lengths")
            continue
        at += rows.nbytes
        if element.name == "vertex":
            with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN like others
                vertices = np.column_stack([rows[axis] for axis in "xyz"]).astype(np.float64)
            values = {name: rows[name] for name in element.scalars}
        elif element.name == "face":
            corners = rows[element.indices].astype(np.int64)
            if corners.shape[1] == 3:
                faces = corners
            else:
                polygons = np.full(len(rows), corners.shape[1], dtype=np.int64), corners.ravel()
    if polygons is not None:
        faces, notes = triangulate(*polygons, vertices)
    notes += left_out(left_over(body[at:]), "byte", "row")
    return Contents(vertices, faces, tuple(notes), lambda: values)


def _uniform_rows(body: bytes, at: int, element: _Element, order: str) -> npt.NDArray[Any] | None:
    """All rows as one array if their lists are as long as the first row's, else None."""
    fields: list[Any] = []
    sizes: dict[str, int] = {}
    try:
        for name, (kind, size_kind) in element.types.items():
            if size_kind is None:
                fields.append((name, order + kind))
                continue
            length = f"length of {name}"  # no property has a name with blanks
            fields.append((length, order + size_kind))
            sizes[length] = int(np.frombuffer(body, np.dtype(fields), 1, at)[length][0])
            fields.append((name, order + kind, (sizes[length],)))
        rows = np.frombuffer(body, np.dtype(fields), element.count, at)
    except (ValueError, OverflowError):  # a length is negative, or more than there is
        return None
    return rows if all((rows[name] == size).all() for name, size in sizes.items()) else None


def _ragged_rows(
    body: bytes, at: int, element: _Element, order: str
) -> tuple[tuple[IntArray, IntArray], int]:
    """Walk rows whose lists differ in length; return the index list's sizes and entries."""
    types = [
        (name, np.dtype(order + kind), size and np.dtype(order + size))
        for name, (kind, size) in element.types.items()
    ]
    wanted = element.indices
    sizes: list[int] = []
    corners: list[int] = []
    for _ in range(element.count):
        for name, dtype, size_type in types:
            size = 1
            if size_type:
                bits, signed = body[at : at + size_type.itemsize], size_type.kind == "i"
                size = int.from_bytes(bits, "big" if order == ">" else "little", signed=signed)
                at += size_type.itemsize
            end = at + size * dtype.itemsize
            if size < 0 or end > len(body):
                raise element.truncated("fewer")
            if name == wanted:
                sizes.append(size)
                corners += np.frombuffer(body, dtype, size, at).astype(np.int64).tolist()
            at = end
    return (np.array(sizes, dtype=np.int64), np.array(corners, dtype=np.int64)), at


def write(
    file: BinaryIO,
    vertices: FloatArray,
    faces: IntArray,
    scalars: Mapping[str, FloatArray] | None = None,
    colors: npt.NDArray[np.uint8] | None = None,
    uvs: FloatArray | None = None,
) -> None:
    """Write binary little endian, numbers as double, texture coordinates as s and t."""
    columns: dict[str, npt.NDArray[Any]] = dict(zip("xyz", vertices.T, strict=True))
    columns |= scalars or {}
    if uvs is not None:
        columns |= {"s": uvs[:, 0], "t": uvs[:, 1]}
    if colors is not None:
        columns |= dict(zip(("red", "green", "blue"), colors.T, strict=True))
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    types = {name: "uchar" if one.dtype == np.uint8 else "double" for name, one in columns.items()}
    header += [f"property {kind} {name}" for name, kind in types.items()]
    if len(faces):
        header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    file.write("\n".join([*header, "end_header", ""]).encode())
    rows = np.empty(len(vertices), [(name, f"<{_TYPES[kind]}") for name, kind in types.items()])
    for name, values in columns.items():
        rows[name] = values
    file.write(rows.tobytes())
    triangles = np.empty(len(faces), [("n", "u1"), ("corners", "<i4", 3)])
    triangles["n"] = 3
    triangles["corners"] = faces
    file.write(triangles.tobytes())
