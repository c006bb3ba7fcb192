"""OBJ: a text format with 1-based, possibly negative and slashed indices."""

from __future__ import annotations

import itertools
import math
import re
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from unbend._arrays import sum_rows
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
_EXTRAS = {
    b"vt": "texture coordinates",
    b"vn": "normals",
    b"usemtl": "materials",
    b"g": "groups",
    b"o": "object names",
}
_GAP = rb"(?:[ \t]|\\(?:\r\n|\r|\n))+"
_START = rb"(?:\A\xef\xbb\xbf|(?<![^\r\n]))[ \t]*"
_NUMBER = rb"[^\s#\\]+"
_THREE_NUMBERS = _GAP.join([_NUMBER] * 3)
_V_LINE = re.compile(rb"(%sv%s)(%s)((?:%s%s)*)" % (_START, _GAP, _THREE_NUMBERS, _GAP, _NUMBER))
_VN_LINE = re.compile(rb"(%svn%s)(%s)" % (_START, _GAP, _THREE_NUMBERS))
_F_LINE = re.compile(rb"%sfo?%s(?:[^\r\n#\\]|\\(?:\r\n|\r|\n))*" % (_START, _GAP))
_OF_NORMAL = re.compile(rb"(-?\d+/-?\d+)/-?\d+|(-?\d+)//-?\d+")
_COSINE = 0.9  # of the largest angle between a vertex's normal and the one it is given
_MTLLIB_LINE = re.compile(rb"(%smtllib[ \t]+)([^\r\n]*)" % _START)
_ANY_NAME = re.compile(rb"\A(?![/\\]|\w:)(\S)")
_MTL_NAME = re.compile(rb"(?<!\S)(?![/\\]|\w:)(\S[^\r\n]*?\.mtl)(?=\s|$)", re.IGNORECASE)


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
    polygons = np.array(sizes, dtype=np.int64), np.array(corners, dtype=np.int64)
    faces, notes = triangulate(*polygons, vertices, first=1)
    if not sizes:  # as if the file ended too early
        notes.append("there are no faces: taken as a point cloud")
    if strange:
        notes.append(f"{plural(strange, 'line')} that OBJ does not know left out")
    return Contents(vertices, faces, tuple(notes), lambda: _colors(rows))


def _colors(rows: list[list[str]]) -> dict[str, FloatArray]:
    """Red, green and blue that follow every position, or nothing."""
    if min(map(len, rows)) < 6:
        return {}
    values = positions([row[3:6] for row in rows])
    return dict(zip(("red", "green", "blue"), values.T, strict=True))


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


def write(
    file: BinaryIO,
    vertices: FloatArray,
    faces: IntArray,
    colors: npt.NDArray[np.uint8] | None = None,
    uvs: FloatArray | None = None,
) -> None:
    """Write positions and faces; colours follow the positions, as most programs read them."""
    rows = vertices if colors is None else np.hstack([vertices, colors / 255])
    file.write(write_table(rows, "v "))
    if uvs is None:
        file.write(write_table(faces + 1, "f "))
        return
    file.write(write_table(uvs, "vt "))
    lines = ["f " + " ".join(f"{i}/{i}" for i in face) for face in (faces + 1).tolist()]
    file.write("\n".join([*lines, ""]).encode())


def extras(data: bytes) -> list[str]:
    """Name what a file holds besides positions and faces."""
    found = set(re.findall(rb"(?<![^\r\n])[ \t]*(vt|vn|usemtl|g|o)\s", data))
    first = _V_LINE.search(data)
    colored = first is not None and len(first[3].split()) >= 3
    return ["colours"] * colored + [name for key, name in _EXTRAS.items() if key in found]


def rewrite(
    data: bytes,
    vertices: FloatArray,
    colors: npt.NDArray[np.uint8] | None = None,
    folder: bytes = b"",
    *,
    normals: bool = True,
) -> bytes:
    """Replace the positions in a file, recompute its normals if asked to, and keep other lines.

    Faces lose their normals where these are shared by vertices that now face elsewhere. A vertex
    that is not finite keeps its line. The names of material files are put after `folder`.
    """
    rows = iter(_texts(vertices))
    tails = None if colors is None else iter(_texts(colors / 255))

    def position(line: re.Match[bytes]) -> bytes:
        row = next(rows, None)
        tail = line[3] if tails is None else b" " + (next(tails, None) or b"")
        return line[1] + (row or line[2]) + tail

    text, count = _V_LINE.subn(position, data)
    if count != len(vertices):
        raise FileError(
            f"has {count} plain v lines for {plural(len(vertices), 'vertex')}, so its lines cannot "
            "be kept; save it again, or write another format"
        )
    if normals and b"vn" in data:
        found, apart, n_faces = _normals(data, vertices)
        rows, faces = iter(_texts(found.round(6))), itertools.count()
        text = _VN_LINE.sub(lambda line: line[1] + (next(rows, None) or line[2]), text)
        if apart and len(_F_LINE.findall(text)) == n_faces:
            text = _F_LINE.sub(
                lambda line: _OF_NORMAL.sub(rb"\1\2", line[0]) if next(faces) in apart else line[0],
                text,
            )
    return with_materials_in(text, folder)


def with_materials_in(data: bytes, folder: bytes) -> bytes:
    """Put the names of material files after `folder`, if it is not empty."""
    if not folder:
        return data

    def line(found: re.Match[bytes]) -> bytes:
        names = _MTL_NAME if b".mtl" in found[2].lower() else _ANY_NAME
        return found[1] + names.sub(lambda name: folder + b"/" + name[1], found[2])

    return _MTLLIB_LINE.sub(line, data)


def _texts(rows: npt.NDArray[np.float64]) -> list[bytes | None]:
    """Rows of numbers as text, None where they are not finite."""
    return [
        " ".join(map(repr, row)).encode() if all(map(math.isfinite, row)) else None
        for row in rows.tolist()
    ]


def _normals(data: bytes, vertices: FloatArray) -> tuple[FloatArray, set[int], int]:
    """Average the normals of the faces that share each ``vn`` line; NaN where there are none.

    Also gives the numbers of faces for which such an average is wrong, because it is shared by
    vertices where the surface now faces elsewhere, and the number of faces.
    """
    n_vertices = n_normals = n_faces = 0
    sizes: list[int] = []
    corners: list[int] = []
    shared: list[int] = []  # normals of the corners
    numbers: list[int] = []  # of the faces
    for line in _logical_lines(data):
        keyword, *words = line.split() or [""]
        n_vertices += keyword == "v"
        n_normals += keyword == "vn"
        if keyword not in ("f", "fo"):
            continue
        thirds = [word.split("/")[2] for word in words if word.count("/") == 2]
        if 0 < len(thirds) == len(words) and all(thirds):
            corners += _corners(words, n_vertices, len(sizes))
            shared += _corners(thirds, n_normals, len(sizes))
            sizes.append(len(words))
            numbers.append(n_faces)
        n_faces += 1
    if not sizes:
        return np.full((n_normals, 3), np.nan), set(), n_faces
    face = np.repeat(np.arange(len(sizes)), sizes)
    ends = np.cumsum(sizes)
    following = np.arange(len(face)) + 1
    following[ends - 1] = ends - sizes
    # Newell: the cross products along a polygon's boundary sum to twice its area.
    places = (vertices - np.nanmean(vertices, axis=0))[corners]
    of_faces = sum_rows(face, np.cross(places, places[following]), len(sizes))
    normal = np.minimum(shared, n_normals)  # those that do not exist share the last row
    normals = _unit(sum_rows(normal, of_faces[face], n_normals + 1))
    _, pair = np.unique(normal * len(vertices) + corners, return_inverse=True)
    at_vertices = _unit(sum_rows(pair, of_faces[face], int(pair.max()) + 1))[pair]
    agree = (at_vertices * normals[normal]).sum(axis=1) >= _COSINE
    apart = ~agree & np.isfinite(at_vertices).all(axis=1) & (normal < n_normals)
    return normals[:n_normals], {numbers[i] for i in face[apart].tolist()}, n_faces


def _unit(rows: FloatArray) -> FloatArray:
    with np.errstate(invalid="ignore"):
        return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))
