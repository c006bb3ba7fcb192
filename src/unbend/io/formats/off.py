"""OFF: a text format; also COFF, NOFF and the like, whose extra columns follow the position."""

from __future__ import annotations

import re
from typing import BinaryIO

from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.errors import FileError
from unbend.io.formats.contents import (
    NO_FACES,
    Contents,
    count,
    data_lines,
    left_out,
    polygon_rows,
    positions,
)
from unbend.io.formats.contents import table as write_table

_KEYWORD = re.compile(r"\s*((?:ST|C|N)*)(4?n?)OFF(\s+BINARY)?")
_EXTRAS = {"ST": "texture coordinates", "C": "colours", "N": "normals"}


def extras(data: bytes) -> list[str]:
    """Name what a file holds besides positions and faces."""
    keyword, n_vertices, n_faces, rows = _header(data)
    found = [name for letters, name in _EXTRAS.items() if letters in keyword]
    if not found and n_vertices and len(rows[0].split()) > 3:
        found.append("colours")
    faces = (row.split() for row in rows[n_vertices : n_vertices + n_faces])
    return found + ["colours of faces"] * any(len(row) > int(row[0]) + 1 for row in faces)


def read(data: bytes) -> Contents:
    """Read the positions and faces; colours, normals and texture coordinates are left out."""
    _, n_vertices, n_faces, rest = _header(data)
    vertices = positions([line.split() for line in rest[:n_vertices]])
    rows = [line.split() for line in rest[n_vertices : n_vertices + n_faces]]
    faces, notes = polygon_rows(rows, vertices) if rows else (NO_FACES, [])
    notes += left_out(len(rest) - n_vertices - n_faces, "line", "face")
    return Contents(vertices, faces, tuple(notes))


def _header(data: bytes) -> tuple[str, int, int, list[str]]:
    """Letters before OFF, the numbers of vertices and faces, and the lines of these."""
    if re.match(rb"(\s*#.*\n)*\s*\w*OFF\s+BINARY", data):
        raise FileError("binary OFF cannot be read; save it as text OFF or PLY")
    lines = data_lines(data, "OFF")
    if not lines:
        raise FileError("holds nothing but comments")
    keyword = _KEYWORD.match(lines[0])
    if keyword is None:
        raise FileError(f"not an OFF file: it starts with {lines[0].strip()[:20]!r}")
    if keyword[2]:
        raise FileError("has vertices that are not three-dimensional; save it as plain OFF")
    # Some well-known collections glue the counts to the keyword: "OFF490 518 0".
    header = lines[0][keyword.end() :].split()
    rest = lines[1:]
    if not header and rest:
        header, rest = rest[0].split(), rest[1:]
    if len(header) < 2:
        raise FileError("lacks the line with the numbers of vertices and faces")
    n_vertices, n_faces = count(header[0], "vertices"), count(header[1], "faces")
    if n_vertices + n_faces > len(rest):
        raise FileError(
            f"truncated: it promises {plural(n_vertices, 'vertex')} and {plural(n_faces, 'face')}, "
            f"but {plural(len(rest), 'line')} follow"
        )
    return keyword[1], n_vertices, n_faces, rest


def write(file: BinaryIO, vertices: FloatArray, faces: IntArray) -> None:
    """Write positions and faces."""
    file.write(f"OFF\n{len(vertices)} {len(faces)} 0\n".encode())
    file.write(write_table(vertices))
    file.write(write_table(faces, "3 "))
