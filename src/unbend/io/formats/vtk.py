"""VTK's older files (.vtk) of surfaces and of grids with cells: text or binary, of all versions."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.errors import FileError
from unbend.io.formats.contents import Contents, count, misfit, numbers_in, triangulate

_START = re.compile(rb"# vtk DataFile.* (\d)\.\d.*\n.*\n\s*(ASCII|BINARY)\s+DATASET\s+(\w+)", re.I)
_TYPES = {
    "char": "i1", "unsigned_char": "u1", "short": "i2", "unsigned_short": "u2",
    "int": "i4", "unsigned_int": "u4", "long": "i8", "unsigned_long": "u8", "vtkidtype": "i4",
    "vtktypeint64": "i8", "vtktypeuint64": "u8", "float": "f4", "double": "f8",
}  # fmt: skip
STRIPS = "holds triangle strips, which unbend cannot read; save triangles"
_ROUNDED = 1e-6  # by which shares of 255 may be beyond 0 and 1
_AT_ONCE = 1000  # numbers: where one is none, the block that holds it is named
_CELLS = ("VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS", "CELLS")
# Types of the cells of a grid, as VTK numbers them.
_POLYGONS, _STRIP, _POINTS_AND_LINES = (5, 7, 9), 6, (1, 2, 3, 4)
_WIDTHS = {"VECTORS": "3", "NORMALS": "3", "TENSORS6": "6", "TENSORS": "9"}


class _Reader:
    def __init__(self, data: bytes) -> None:
        start = _START.match(data)
        if start is None:
            raise FileError("not a VTK file: it does not start with # vtk DataFile, and a DATASET")
        if (kind := start[3].decode().upper()) not in ("POLYDATA", "UNSTRUCTURED_GRID"):
            raise FileError(f"holds {kind}, which is no surface; save its surface")
        self.data, self.at = data, start.end()
        self.new, self.binary = int(start[1]) >= 5, start[2].upper() == b"BINARY"

    def line(self) -> list[str]:
        """Four words or more of the next line that is neither blank nor describes an array."""
        described = False
        while self.at < len(self.data):
            end = self.data.find(b"\n", self.at)
            end = len(self.data) if end < 0 else end
            row = self.data[self.at : end].decode(errors="replace").split()
            self.at = end + 1
            described = row[:1] == ["METADATA"] or (described and bool(row))
            if row and not described:
                return row + [""] * (4 - len(row))
        return [""] * 4

    def array(self, name: str, n_rows: str, width: str, kind: str) -> npt.NDArray[Any]:
        """Read rows of numbers."""
        size = count(n_rows, "rows"), count(width, "columns")
        n, left = size[0] * size[1], len(self.data) - self.at
        if kind == "string":
            self.skip_strings(n)
            return np.empty((0, 1))
        if kind.lower() not in _TYPES:
            raise misfit(name, kind, ", not a type of numbers that unbend reads")
        if not n:
            return np.empty((0, 1))
        dtype = np.dtype(f">{_TYPES[kind.lower()]}")
        if (n * dtype.itemsize if self.binary else 2 * n - 1) > left:
            raise FileError(f"truncated: it promises {n} numbers of {name}, but ends before")
        if self.binary:
            found = np.frombuffer(self.data, dtype, n, self.at).astype(dtype.newbyteorder("="))
            self.at += found.nbytes
            return found.reshape(size)
        words = self.data[self.at :].split(None, n)
        self.at = len(self.data) - sum(map(len, words[n:]))
        if len(words) < n:
            raise FileError(f"truncated: it promises {n} numbers of {name}, but holds {len(words)}")
        text = b" ".join(words[:n]).decode(errors="replace").split(" ")
        wide = np.float64 if dtype.kind == "f" else np.int64
        rows = [text[i : i + _AT_ONCE] for i in range(0, n, _AT_ONCE)]
        return numbers_in(rows, wide, "number", f"{name}, block").reshape(size)

    def skip_strings(self, n: int) -> None:
        """Pass over text, each in a line, or after its length in 1, 2, 4 or 8 bytes."""
        for _ in range(n):
            if self.at >= len(self.data):
                raise FileError(f"truncated: it promises {n} strings, but ends before")
            if self.binary:
                n_bytes = 8 >> (self.data[self.at] >> 6)
                length = int.from_bytes(self.data[self.at : self.at + n_bytes])
                self.at += n_bytes + length % (1 << 8 * n_bytes - 2)
            else:
                self.at = self.data.find(b"\n", self.at) + 1 or len(self.data)

    def cells(self, name: str, n_cells: str, size: str) -> tuple[IntArray, IntArray]:
        """Read the sizes of cells, and the corners of all."""
        if self.new:
            ends = self.array(name, n_cells, "1", self.line()[1]).ravel().astype(np.int64)
            corners = self.array(name, size, "1", self.line()[1]).ravel().astype(np.int64)
            sizes = np.diff(ends)
            fits = not len(ends) or (ends[0] == 0 and ends[-1] == len(corners))
        else:
            flat = self.array(name, size, "1", "int").ravel().astype(np.int64)
            starts = [0]
            while starts[-1] < len(flat) and flat[starts[-1]] >= 0:
                starts.append(starts[-1] + int(flat[starts[-1]]) + 1)
            fits = starts[-1] == len(flat) and len(starts) - 1 == count(n_cells, "cells")
            sizes, corners = flat[starts[:-1]] if fits else flat, np.delete(flat, starts[:-1])
        if not fits or (sizes < 0).any():
            raise FileError(f"damaged: the {size} numbers of {name} are not {n_cells} cells")
        return sizes, corners


def read(data: bytes) -> Contents:
    """Read positions and polygons, and the values of points."""
    file, rows = _Reader(data), "0"
    vertices, cells = np.empty((0, 3)), (np.empty(0, np.int64), np.empty(0, np.int64))
    types: npt.NDArray[Any] | None = None
    values: dict[str, npt.NDArray[Any]] = {}
    arrays: dict[str, npt.NDArray[Any]] = {}  # those of the whole, of points, or of cells
    left: list[str] = []
    while (words := file.line())[0]:
        key, name, size, third = words[0].upper(), *words[1:4]
        if key == "POINTS":
            vertices = file.array(key, name, "3", size).astype(np.float64).reshape(-1, 3)
        elif key in _CELLS:
            found = file.cells(key, name, size)
            if key == "TRIANGLE_STRIPS" and len(found[0]):
                raise FileError(STRIPS)
            cells = found if key in ("POLYGONS", "CELLS") else cells
        elif key == "CELL_TYPES":
            types = file.array(key, name, "1", "int").ravel()
        elif key in ("POINT_DATA", "CELL_DATA"):
            arrays, rows = values if key == "POINT_DATA" else {}, name
        elif key == "FIELD":
            for _ in range(count(size, "arrays")):
                one, width, n_rows, kind = file.line()[:4]
                arrays[one] = file.array(one, n_rows, width, kind)
        elif key == "SCALARS":
            file.line()  # which names a table of colours
            arrays[name] = file.array(name, rows, third or "1", size)
        elif key in _WIDTHS:
            arrays[name] = file.array(name, rows, _WIDTHS[key], size)
        elif key == "TEXTURE_COORDINATES":
            arrays[name] = file.array(name, rows, size, third)
        elif key in ("COLOR_SCALARS", "LOOKUP_TABLE"):
            kind = "unsigned_char" if file.binary else "float"
            n_rows, width = (rows, size) if key == "COLOR_SCALARS" else (size, "4")
            colors = file.array(name, n_rows, width, kind)
            if key == "COLOR_SCALARS":  # in text shares of 255
                if file.binary:
                    arrays[name] = colors
                elif ((colors >= -_ROUNDED) & (colors <= 1 + _ROUNDED)).all():
                    arrays[name] = np.rint(colors * 255).astype(np.uint8)
                else:
                    left.append(f"colours {name} left out, which are not from 0 to 1")
        else:
            unread = " ".join(words).strip()
            raise misfit("a line", unread, ", which unbend cannot read; save it as .ply")
    named = {unquote(one): values[one] for one in values}
    contents = contents_of(vertices, *cells, types, named)
    return replace(contents, notes=(*contents.notes, *left))


def contents_of(
    vertices: FloatArray,
    sizes: IntArray,
    corners: IntArray,
    types: npt.NDArray[Any] | None,
    values: dict[str, npt.NDArray[Any]],
) -> Contents:
    """Take the polygons among cells, which are of types if they are a grid's, and split them."""
    left = []
    if types is not None:
        if len(types) != len(sizes):
            raise FileError(f"has {len(sizes)} cells, but {len(types)} types of cells")
        if (types == _STRIP).any():
            raise FileError(STRIPS)
        ours = np.isin(types, _POLYGONS)
        n_others = int((~ours & ~np.isin(types, _POINTS_AND_LINES)).sum())
        if n_others and not ours.any():
            raise FileError(
                f"holds {plural(n_others, 'cell')}, but no polygons: save its surface as triangles"
            )
        if n_others:
            are = "is no polygon" if n_others == 1 else "are no polygons"
            left.append(f"{plural(n_others, 'cell')} left out that {are}")
        sizes, corners = sizes[ours], corners[np.repeat(ours, sizes)]
    faces, notes = triangulate(sizes, corners, vertices)
    per_point = {
        name: array[:, 0] if array.shape[1] == 1 else array
        for name, array in values.items()
        if len(array) == len(vertices)
    }
    return Contents(vertices, faces, tuple(notes + left), lambda: per_point)
