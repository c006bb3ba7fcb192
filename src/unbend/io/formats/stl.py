"""STL: triangles without shared vertices, binary or text; equal positions are welded."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.errors import FileError, MeshError
from unbend.io.formats.contents import (
    BYTE_ORDER_MARK,
    Contents,
    data_lines,
    left_out,
    left_over,
    positions,
    weld,
)
from unbend.io.formats.junctions import divide_at_junctions

_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84  # bytes: 80 of free text and the number of triangles


def read(data: bytes) -> Contents:
    """Read triangles and weld corners whose positions are exactly equal."""
    triangles = _binary(data)
    n_unread = 0
    if triangles is None:
        corners = _text(data)
    else:
        with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN like others
            corners = triangles["corners"].reshape(-1, 3).astype(np.float64)
        n_unread = left_over(data[_HEADER + triangles.nbytes :])
    if len(corners) == 0:
        raise FileError("holds no triangles")
    is_finite = np.isfinite(corners).all(axis=1)
    if not is_finite.all():  # the number of a vertex would be ours, not the file's
        raise MeshError(
            f"triangle {is_finite.argmin() // 3} has a corner that is not at a finite position; "
            "correct or remove that triangle"
        )
    kept, faces = weld(corners)
    welded = (
        f"{plural(len(corners), 'corner')} of {plural(len(corners) // 3, 'triangle')} welded into "
        f"{plural(len(kept), 'vertex')} where their positions are equal (STL does not store "
        "vertices: other programs may number them otherwise)"
    )
    divided, n_divided = divide_at_junctions(corners[kept], faces.reshape(-1, 3))
    notes = [welded, *left_out(n_unread, "byte", "triangle")]
    if n_divided:
        where = "corners of other triangles that lie on " + ("it" if n_divided == 1 else "them")
        now = plural(len(divided), "triangle")
        notes.append(f"{plural(n_divided, 'edge')} divided at {where}, to close slits: {now}")
    return Contents(corners[kept], divided, tuple(notes))


def extras(data: bytes) -> list[str]:
    """Name what a file holds besides triangles: programs put colours into unused bits."""
    triangles = _binary(data)
    colored = triangles is not None and triangles["attribute"].any()
    return ["colours of triangles"] * bool(colored)


def _binary(data: bytes) -> npt.NDArray[np.void] | None:
    """Triangles of a binary file, or None if it is a text file."""
    n_triangles = int.from_bytes(data[80:_HEADER], "little")
    n_bytes = _HEADER + n_triangles * _TRIANGLE.itemsize
    if n_bytes > len(data) or n_triangles == 0:
        words = data.removeprefix(BYTE_ORDER_MARK).lower()
        if words.lstrip()[:5] == b"solid" and (b"facet" in words or b"endsolid" in words):
            return None
        raise FileError(
            f"truncated: it promises {plural(n_triangles, 'triangle')}, {n_bytes:,} bytes, "
            f"but has {plural(len(data), 'byte')}"
            if len(data) >= _HEADER and n_triangles
            else "not an STL file, or one without triangles"
        )
    return np.frombuffer(data, dtype=_TRIANGLE, count=n_triangles, offset=_HEADER)


def _text(data: bytes) -> FloatArray:
    lines = [line.split() for line in data_lines(data, "STL")]
    rows = [words[1:] for words in lines if words[0].lower() == "vertex"]
    n_facets = sum(words[0].lower() == "endfacet" for words in lines)
    if lines[-1][0].lower() != "endsolid":
        raise FileError("truncated: its last line is not endsolid")
    if len(rows) != 3 * n_facets:
        corners = plural(len(rows), "corner")
        raise FileError(f"has {plural(n_facets, 'facet')} but {corners}; 3 each needed")
    return positions(rows, "corner")


def write(file: BinaryIO, vertices: FloatArray, faces: IntArray) -> None:
    """Write a binary file; positions are rounded to single precision."""
    triangles = np.zeros(len(faces), dtype=_TRIANGLE)
    triangles["corners"] = vertices[faces]
    file.write(b"binary STL".ljust(80) + len(faces).to_bytes(4, "little"))
    file.write(triangles.tobytes())
