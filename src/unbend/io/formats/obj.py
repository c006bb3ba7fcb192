"""OBJ: a text format with 1-based, possibly negative and slashed indices."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.errors import FileError, MeshError
from unbend.io.formats.contents import Contents, positions, pythonic, text_lines, triangulate
from unbend.io.formats.contents import table as write_table

# What an OBJ file may hold besides vertices and faces. Anything else is reported in the notes.
_OTHER = """
    vt vn vp p l curv curv2 surf parm trim hole scrv sp end con g s mg o cstype deg bmat step bevel
    c_interp d_interp lod usemtl mtllib usemap maplib shadow_obj trace_obj ctech stech bzp bsp cdc
    cdp res call csh
"""
_OTHER_KEYWORDS = frozenset(_OTHER.split())


def read(data: bytes) -> Contents:
    """Read ``v`` and ``f`` lines; vertices keep their order whatever the faces say of texture."""
    rows: list[list[str]] = []
    sizes: list[int] = []
    corners: list[int] = []
    strange = 0
    for line in _logical_lines(data):
        words = line.split()
        if not words:
            continue
        keyword = words[0]
        if keyword == "v":
            rows.append(words[1:])
        elif keyword in ("f", "fo"):
            sizes.append(len(words) - 1)
            corners += _corners(words[1:], len(rows), len(sizes) - 1)
        elif keyword not in _OTHER_KEYWORDS:
            strange += 1
    if not rows:
        raise FileError("holds no vertices: no line of it starts with v")
    vertices = positions(rows)
    indices = np.array(corners, dtype=np.int64)
    _check(np.array(sizes, dtype=np.int64), indices, len(rows))
    faces, notes = triangulate(np.array(sizes, dtype=np.int64), indices, len(rows))
    if strange:
        notes.append(f"{plural(strange, 'line')} that OBJ does not know left out")
    return Contents(vertices, faces, tuple(notes))


def _logical_lines(data: bytes) -> list[str]:
    """Lines without comments, continued lines joined."""
    lines = text_lines(data, "OBJ")
    if b"#" in data:  # first: a comment may end in a backslash, as a folder's name does
        lines = [line.partition("#")[0] for line in lines]
    if b"\\" in data:
        lines = "\n".join(lines).replace("\\\n", " ").split("\n")
    return lines


def _corners(words: list[str], n_so_far: int, face: int) -> list[int]:
    """0-based vertex indices of one face; negative ones count back from the latest vertex."""
    try:
        if pythonic(words):
            raise ValueError
        indices = [int(word.partition("/")[0]) for word in words]
    except ValueError:
        raise FileError(f"face {face} holds {' '.join(words)[:60]!r}, not vertex indices") from None
    result = [index - 1 if index >= 0 else index + n_so_far for index in indices]
    for index, word in zip(result, words, strict=True):
        # An index of 0 names no vertex; a far too negative one would wrap to a wrong vertex.
        if index < 0 or index >= 2**62:
            raise MeshError(
                f"face {face} names vertex {word.partition('/')[0]}, but {n_so_far} vertices "
                "precede it; correct or remove that face"
            )
    return result


def _check(sizes: np.ndarray, corners: np.ndarray, n_vertices: int) -> None:
    """Say an index that is too large in the file's own numbering."""
    outside = np.flatnonzero(corners >= n_vertices)
    if len(outside):
        face = int(np.searchsorted(np.cumsum(sizes), outside[0], side="right"))
        raise MeshError(
            f"face {face} names vertex {corners[outside[0]] + 1}, but the file's vertices are "
            f"numbered 1 to {n_vertices}; correct or remove that face"
        )


def write(
    file: BinaryIO,
    vertices: FloatArray,
    faces: IntArray,
    colors: npt.NDArray[np.uint8] | None = None,
    uvs: FloatArray | None = None,
) -> None:
    """Write positions and faces; colours follow the positions, as most programs read them."""
    rows = vertices
    if colors is not None:
        rows = np.hstack([rows, colors / 255])
    file.write(write_table(rows, "v "))
    if uvs is None:
        file.write(write_table(faces + 1, "f "))
        return
    file.write(write_table(uvs, "vt "))
    lines = ["f " + " ".join(f"{i}/{i}" for i in face) for face in (faces + 1).tolist()]
    file.write("\n".join([*lines, ""]).encode())
