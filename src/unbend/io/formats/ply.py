"""PLY: text or binary, of either byte order; positions in any number type."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from typing import Any, BinaryIO, Literal

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


@dataclass
class _Property:
    name: str
    dtype: str
    size_dtype: str | None = None  # of a list's length; None: not a list


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)

    def index(self, name: str) -> int:
        """Which property has this name, -1 if none."""
        return next((i for i, p in enumerate(self.properties) if p.name == name), -1)

    @property
    def least_bytes(self) -> int:
        """Bytes of a row whose lists are all empty."""
        return sum(np.dtype(p.size_dtype or p.dtype).itemsize for p in self.properties)


def read(data: bytes) -> Contents:
    """Read the positions and faces, and on demand the other numbers of vertices."""
    encoding, elements, body = _header(data.removeprefix(BYTE_ORDER_MARK))
    by_name = {element.name: element for element in elements}
    vertex, face = by_name.get("vertex"), by_name.get("face")
    if vertex is None or vertex.count == 0:
        raise FileError("holds no vertices")
    if "tristrips" in by_name and by_name["tristrips"].count:
        raise FileError("holds triangle strips, which unbend cannot read; save it as triangles")
    columns = [vertex.index(axis) for axis in "xyz"]
    if min(columns) < 0 or any(vertex.properties[i].size_dtype for i in columns):
        raise FileError("has vertices without the properties x, y and z")
    if face is not None and face.count:
        listed = [i for name in _INDICES if (i := face.index(name)) >= 0]
        if len(listed) > 1:
            raise FileError(f"has faces with both {_INDICES[0]} and {_INDICES[1]}; keep one")
        if not listed or face.properties[listed[0]].size_dtype is None:
            raise FileError("has faces without the property list vertex_indices")
        index_type = face.properties[listed[0]].dtype
        if index_type[0] == "f":
            raise FileError("has faces whose vertex indices are not whole numbers")
    if encoding == "ascii":
        return _read_text(body, elements)
    return _read_binary(body, elements, ">" if encoding == "binary_big_endian" else "<")


def extras(data: bytes) -> list[str]:
    """Name the properties of vertices and faces besides positions and vertex numbers."""
    _, elements, _ = _header(data.removeprefix(BYTE_ORDER_MARK))
    return [p.name for element in elements for p in element.properties if p.name not in _SHAPE]


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    if not re.match(rb"ply\s*[\r\n]", data):
        raise FileError("not a PLY file: it does not start with the line ply")
    end = re.search(rb"[\r\n]end_header[ \t]*(\r\n|\n|\r)", data)
    if end is None:
        raise FileError("truncated, or not a PLY file: it has no line end_header")
    encoding = ""
    elements: list[_Element] = []
    for line in text_lines(data[: end.start()], "PLY")[1:]:
        words = line.split()
        match words:
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian"), _]:
                encoding = words[1]
            case ["element", name, number]:
                elements.append(_Element(name, count(number, f"{name} rows")))
            case ["property", "list", size, kind, name] if (
                elements and kind in _TYPES and _TYPES.get(size, "f")[0] != "f"
            ):
                elements[-1].properties.append(_Property(name, _TYPES[kind], _TYPES[size]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append(_Property(name, _TYPES[kind]))
            case _:
                raise FileError(f"has a header line that PLY does not know: {line[:60]!r}")
    if not encoding:
        raise FileError("has no format line (ascii, binary_little_endian or binary_big_endian)")
    named = [element.name for element in elements]
    for element in elements:
        if named.count(element.name) > 1:
            raise FileError(f"names the element {element.name} twice")
        names = [p.name for p in element.properties]
        if len(set(names)) != len(names):
            raise FileError(f"names a property of {element.name} twice")
    return encoding, elements, data[end.end() :]


def _truncated(element: _Element, left: str) -> FileError:
    rows = plural(element.count, f"{element.name} row")
    return FileError(f"truncated or damaged: it promises {rows}, but holds {left}")


def _indices_of(element: _Element) -> int:
    return max(element.index(name) for name in _INDICES)


def _read_text(body: bytes, elements: list[_Element]) -> Contents:
    lines = [line for line in text_lines(body, "PLY") if line and not line.isspace()]
    at, vertices, faces, notes = 0, np.empty((0, 3)), NO_FACES, list[str]()
    values: Callable[[], dict[str, npt.NDArray[Any]]] = dict
    face_rows: list[list[str]] = []
    for element in elements:
        if not element.properties:
            continue  # its rows are empty lines, which were dropped
        if element.count > len(lines) - at:
            raise _truncated(element, plural(len(lines) - at, "line"))
        rows = [line.split() for line in lines[at : at + element.count]]
        at += element.count
        if element.name == "vertex":
            values = partial(_text_columns, element, rows)
            axes = [element.index(axis) for axis in "xyz"]
            if axes != [0, 1, 2]:
                rows = [_pick(element, row, axes, i) for i, row in enumerate(rows)]
            vertices = positions(rows)
        elif element.name == "face":
            lists = _indices_of(element)
            if lists > 0:
                rows = [row[_offsets(element, row, i)[lists] :] for i, row in enumerate(rows)]
            face_rows = rows
    if face_rows:
        faces, notes = polygon_rows(face_rows, len(vertices))
    notes += _unread(len(lines) - at, "line")
    return Contents(vertices, faces, tuple(notes), values)


def _text_columns(element: _Element, rows: list[list[str]]) -> dict[str, npt.NDArray[Any]]:
    return {
        prop.name: numbers_in(
            [_pick(element, row, [i], k) for k, row in enumerate(rows)],
            prop.dtype,
            "number of its type",
            "vertex",
        )
        for i, prop in enumerate(element.properties)
        if prop.size_dtype is None and prop.name not in _SHAPE
    }


def _pick(element: _Element, row: list[str], columns: list[int], index: int) -> list[str]:
    offsets = _offsets(element, row, index)
    return [row[offsets[column]] for column in columns]


def _offsets(element: _Element, row: list[str], index: int) -> list[int]:
    """Where each property starts in a row of words."""
    at, offsets = 0, []
    for prop in element.properties:
        offsets.append(at)
        if at >= len(row):
            raise FileError(f"{element.name} {index} has fewer numbers than properties")
        if prop.size_dtype:
            at += count(row[at], f"entries in {element.name} {index}")
        at += 1
    return offsets


def _read_binary(body: bytes, elements: list[_Element], order: str) -> Contents:
    at, vertices, faces, notes = 0, np.empty((0, 3)), NO_FACES, list[str]()
    values: dict[str, npt.NDArray[Any]] = {}
    polygons: tuple[IntArray, IntArray] | None = None
    for element in elements:
        if element.count * element.least_bytes > len(body) - at:
            raise _truncated(element, plural(len(body) - at, "byte"))
        if not element.properties or not element.count:
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
            xyz = [rows[f"p{element.index(axis)}"] for axis in "xyz"]
            with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN like others
                vertices = np.column_stack(xyz).astype(np.float64)
            values = {
                p.name: rows[f"p{i}"]
                for i, p in enumerate(element.properties)
                if p.size_dtype is None and p.name not in _SHAPE
            }
        elif element.name == "face":
            corners = rows[f"p{_indices_of(element)}"].astype(np.int64)
            sizes = np.full(len(rows), corners.shape[1], dtype=np.int64)
            if corners.shape[1] == 3:
                faces = corners
            else:
                polygons = sizes, corners.ravel()
    if polygons is not None:
        faces, notes = triangulate(*polygons, len(vertices))
    notes += _unread(left_over(body[at:]), "byte")
    return Contents(vertices, faces, tuple(notes), lambda: values)


def _unread(count: int, what: str) -> list[str]:
    return [f"{plural(count, what)} after the last row left out"] if count else []


def _uniform_rows(body: bytes, at: int, element: _Element, order: str) -> npt.NDArray[Any] | None:
    """All rows as one array if their lists are as long as the first row's, else None."""
    fields: list[Any] = []
    size_fields: dict[str, int] = {}
    offset = at
    for i, prop in enumerate(element.properties):
        if prop.size_dtype is None:
            fields.append((f"p{i}", order + prop.dtype))
            offset += np.dtype(prop.dtype).itemsize
            continue
        size_type = np.dtype(order + prop.size_dtype)
        if offset + size_type.itemsize > len(body):
            return None
        size = int(np.frombuffer(body, size_type, 1, offset)[0])
        offset += size_type.itemsize + size * np.dtype(prop.dtype).itemsize
        if size < 0 or offset > len(body):
            return None
        fields += [(f"n{i}", size_type), (f"p{i}", order + prop.dtype, (size,))]
        size_fields[f"n{i}"] = size
    if element.count * (offset - at) > len(body) - at:
        return None
    rows = np.frombuffer(body, np.dtype(fields), element.count, at)
    uniform = all((rows[name] == size).all() for name, size in size_fields.items())
    return rows if uniform else None


def _ragged_rows(
    body: bytes, at: int, element: _Element, order: str
) -> tuple[tuple[IntArray, IntArray], int]:
    """Walk rows whose lists differ in length; return the index list's sizes and entries."""
    types = [
        (np.dtype(order + p.dtype), p.size_dtype and np.dtype(order + p.size_dtype))
        for p in element.properties
    ]
    wanted = _indices_of(element)
    sizes: list[int] = []
    corners: list[list[int]] = []
    byte_order: Literal["big", "little"] = "big" if order == ">" else "little"
    for _ in range(element.count):
        for i, (dtype, size_type) in enumerate(types):
            size = 1
            if size_type:
                end = at + size_type.itemsize
                size = int.from_bytes(
                    body[at:end], byte_order, signed=size_type.kind == "i"
                )  # fmt: skip
                at = end
            end = at + size * dtype.itemsize
            if size < 0 or end > len(body):
                raise _truncated(element, "fewer")
            if i == wanted:
                sizes.append(size)
                corners.append(np.frombuffer(body, dtype, size, at).astype(np.int64).tolist())
            at = end
    flat = np.fromiter(chain.from_iterable(corners), dtype=np.int64)
    return (np.array(sizes, dtype=np.int64), flat), at


def write(
    file: BinaryIO,
    vertices: FloatArray,
    faces: IntArray,
    scalars: Mapping[str, FloatArray] | None = None,
    colors: npt.NDArray[np.uint8] | None = None,
    uvs: FloatArray | None = None,
) -> None:
    """Write binary little endian, numbers as double, texture coordinates as s and t."""
    scalars = dict(scalars or {})
    if uvs is not None:
        scalars |= {"s": uvs[:, 0], "t": uvs[:, 1]}
    columns: list[tuple[str, str, npt.NDArray[Any]]] = [
        (axis, "double", vertices[:, i]) for i, axis in enumerate("xyz")
    ]
    columns += [(name, "double", values) for name, values in scalars.items()]
    if colors is not None:
        names = ("red", "green", "blue")
        columns += [(name, "uchar", colors[:, i]) for i, name in enumerate(names)]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property {kind} {name}" for name, kind, _ in columns]
    if len(faces):
        header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    file.write("\n".join([*header, "end_header", ""]).encode())
    rows = np.empty(len(vertices), [(name, "<" + _TYPES[kind]) for name, kind, _ in columns])
    for name, _, values in columns:
        rows[name] = values
    file.write(rows.tobytes())
    triangles = np.empty(len(faces), [("n", "u1"), ("corners", "<i4", 3)])
    triangles["n"] = 3
    triangles["corners"] = faces
    file.write(triangles.tobytes())
