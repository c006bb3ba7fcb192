"""What readers of mesh formats share. Vertex order is sacred, and truncated files are refused.

Readers raise FileError and MeshError without the file's name; :mod:`unbend.io` puts it in front.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._arrays import first_equal_row, sum_rows
from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.errors import FileError, MeshError


@dataclass(frozen=True, eq=False)
class Contents:
    """What a reader found: positions, triangles, what it did to get them, and values by name."""

    vertices: FloatArray
    faces: IntArray
    notes: tuple[str, ...] = ()
    values: Callable[[], dict[str, npt.NDArray[Any]]] = dict


_ROUNDING = 1e-6  # share of a polygon's area that a triangle may be turned against it
_EXACT = 1e-12  # share of its area, twice, below which a triangle is flat
_MOST_CLIPPED = 1000  # corners of a polygon: the time grows with their square
NO_FACES: IntArray = np.empty((0, 3), dtype=np.int64)
BYTE_ORDER_MARK = b"\xef\xbb\xbf"  # with which some editors begin UTF-8


def text_lines(data: bytes, format_name: str) -> list[str]:
    """Split a text file into lines, whatever its line ends, or say why it is not text."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise FileError("this is UTF-16 text; save it again as UTF-8")
    if b"\0" in data:
        raise FileError(f"holds binary data, so it is not a text {format_name} file")
    # Old files carry comments and names in other encodings. They do no harm there; inside the
    # data, the replacement character fails as "not a number" and is reported with its place.
    text = data.removeprefix(BYTE_ORDER_MARK).decode("utf-8", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def data_lines(data: bytes, format_name: str) -> list[str]:
    """Lines of a text file without ``#`` comments and blank lines."""
    lines = text_lines(data, format_name)
    if b"#" in data:
        lines = [line.partition("#")[0] for line in lines]
    return [line for line in lines if line and not line.isspace()]


def refuse_blank_rows(lines: list[str], advice: str, *, may_be_doubled: bool = True) -> None:
    """Refuse a blank line between rows of one value: those after it would be shifted.

    If newlines are doubled, as some programs write them, every second line is blank.
    """
    text = "\n".join(line.strip() for line in lines if line.lstrip()[:1] != "#").strip()
    rows = text.split("\n")
    if "" in rows and (any(rows[1::2]) or not may_be_doubled):
        raise FileError(f"row {rows.index('')} is blank; {advice}")


def count(token: str, what: str) -> int:
    """Read a count written in a header."""
    if not token.isdecimal() or len(token) > 4000:  # Python reads no longer ones
        raise FileError(f"{token[:40]!r} is not a number of {what}; correct the header")
    return int(token)


def misfit(place: str, text: str, problem: str) -> FileError:
    """Make the error for a place in a file whose text, cut off here, cannot be meant."""
    return FileError(f"{place} holds {text[:40]!r}{problem}")


def left_over(data: bytes) -> int:
    """Count what follows the last row of a binary file; padding does not count."""
    return len(data) if data.strip(b"\0\r\n\t ") else 0


def left_out(count: int, what: str, last: str) -> list[str]:
    """Note that lines or bytes follow the last row of a file, if there are any."""
    return [f"{plural(count, what)} after the last {last} left out"] if count else []


def pythonic(words: Iterable[str]) -> bool:
    """Whether some of these words are numbers to Python alone, like 1_000."""
    return "_" in "".join(words)


def are_numbers(words: Iterable[str]) -> bool:
    """Whether all words are numbers to every program."""
    try:
        for word in words:
            float(word)
    except ValueError:
        return False
    return not pythonic(words)


def positions(rows: Sequence[Sequence[str]], what: str = "vertex") -> FloatArray:
    """Turn the first three words of each row into a position."""
    for index, row in enumerate(rows):
        if len(row) < 3:
            raise FileError(f"{what} {index} has {len(row)} numbers instead of 3")
    return numbers_in([row[:3] for row in rows], np.float64, "number", what).reshape(-1, 3)


def numbers_in(rows: Sequence[Sequence[str]], dtype: Any, kind: str, what: str) -> npt.NDArray[Any]:
    """Convert all words of all rows; if that fails, name the first bad one."""
    array = _converted(list(chain.from_iterable(rows)), dtype)
    if array is not None:
        return array
    index, bad = next(
        (i, word) for i, row in enumerate(rows) for word in row if _converted([word], dtype) is None
    )
    raise misfit(f"{what} {index}", bad, f", not a {kind}")


def _converted(words: list[str], dtype: Any) -> npt.NDArray[Any] | None:
    try:
        return None if pythonic(words) else np.array(words, dtype=dtype)
    except (ValueError, OverflowError):
        return None


def polygon_rows(rows: Sequence[Sequence[str]], vertices: FloatArray) -> tuple[IntArray, list[str]]:
    """Triangles from rows that hold a count, that many vertex indices, and perhaps more."""
    if all(row[0] == "3" and len(row) > 3 for row in rows):
        triangles = [row[1:4] for row in rows]
        return numbers_in(triangles, np.int64, "vertex index", "face").reshape(-1, 3), []
    sizes = []
    for index, row in enumerate(rows):
        size = int(row[0]) if row[0].isdecimal() and len(row[0]) < 10 else -1
        if size < 0:
            raise misfit(f"face {index}", row[0], ", not a number of vertices")
        if len(row) <= size:
            raise FileError(f"face {index} promises {size} vertices but names {len(row) - 1}")
        sizes.append(size)
    polygons = [row[1 : size + 1] for row, size in zip(rows, sizes, strict=True)]
    corners = numbers_in(polygons, np.int64, "vertex index", "face")
    return triangulate(np.array(sizes, dtype=np.int64), corners, vertices)


def triangulate(
    sizes: IntArray, corners: IntArray, vertices: FloatArray, first: int = 0
) -> tuple[IntArray, list[str]]:
    """Split polygons into triangles, in order, and say so in notes.

    A polygon becomes a fan around its first corner, unless its triangles would overlap. Polygons
    are given by their sizes (m,) and by the corners of all, one after the other. Vertex
    numbers are checked here, because the triangles are counted differently from the file's faces;
    the file counts vertices from `first`.
    """
    n_vertices, starts = len(vertices), np.cumsum(sizes) - sizes
    outside = np.flatnonzero((corners < 0) | (corners >= n_vertices))
    if len(outside):
        face = int(np.searchsorted(starts + sizes, outside[0], side="right"))
        raise MeshError(
            f"face {face} names vertex {corners[outside[0]] + first}, but the vertices are "
            f"numbered {first} to {n_vertices - 1 + first}; correct or remove that face"
        )
    n_triangles = np.maximum(sizes - 2, 0)
    owner = np.repeat(np.arange(len(sizes)), n_triangles)
    first_triangles = np.cumsum(n_triangles) - n_triangles
    step = np.arange(len(owner)) - np.repeat(first_triangles, n_triangles)
    apex = starts[owner]
    faces = np.column_stack([corners[apex], corners[apex + step + 1], corners[apex + step + 2]])
    with np.errstate(all="ignore"):  # unused vertices may be anywhere
        overlapping = _overlapping(faces, owner, sizes, vertices)
        for one in overlapping[sizes[overlapping] <= _MOST_CLIPPED]:
            ring = corners[starts[one] : starts[one] + sizes[one]]
            rows = first_triangles[one] + np.arange(n_triangles[one])
            faces[rows] = ring[_clip_ears(vertices[ring])]
        left = len(_overlapping(faces, owner, sizes, vertices)) if len(overlapping) else 0
    notes = []
    if n_polygons := int((sizes > 3).sum()):
        notes.append(f"{plural(n_polygons, 'polygon')} split into triangles")
    if left:
        notes.append(f"{plural(left, 'polygon')} split into triangles that overlap")
    if n_lines := int((sizes < 3).sum()):
        notes.append(f"{plural(n_lines, 'face')} with fewer than 3 vertices left out")
    return faces.reshape(-1, 3), notes


def _overlapping(
    faces: IntArray, owner: IntArray, sizes: IntArray, vertices: FloatArray
) -> IntArray:
    """Polygons of more than three corners of which a triangle is turned against the whole."""
    ours = np.flatnonzero(sizes[owner] > 3)
    a, b, c = vertices[faces[ours]].swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    whole = sum_rows(owner[ours], normals, len(sizes))[owner[ours]]
    turned = (normals * whole).sum(axis=1) < -_ROUNDING * (whole * whole).sum(axis=1)
    return np.unique(owner[ours[turned]])


def _clip_ears(places: FloatArray) -> IntArray:
    """Triangles (n - 2, 3) of a polygon that does not cross itself: corners that contain no other.

    What is left of one that does becomes a fan.
    """
    places = places - places[0]
    normal = np.cross(places, np.roll(places, -1, axis=0)).sum(axis=0)
    left, triangles, at, tried = list(range(len(places))), [], 0, 0
    while len(left) > 3 and tried < len(left):
        ear = [left[at - 1], left[at], left[(at + 1) % len(left)]]
        corners, others = places[ear], places[[i for i in left if i not in ear]]
        edges = np.roll(corners, -1, axis=0) - corners
        sides = np.cross(edges[:, None], others - corners[:, None]) @ normal
        elsewhere = (others[:, None] != corners).any(axis=2).all(axis=1)
        inside = (sides >= -_EXACT * (normal @ normal)).all(axis=0) & elsewhere
        if np.cross(edges[0], edges[1]) @ normal > 0 and not inside.any():
            triangles.append(ear)
            del left[at]
            at, tried = at % len(left), 0
        else:
            at, tried = (at + 1) % len(left), tried + 1
    triangles += [[left[0], *pair] for pair in pairwise(left[1:])]
    return np.array(triangles)


def weld(points: FloatArray) -> tuple[IntArray, IntArray]:
    """Index of the first point at each position, and for each point its place among these."""
    return np.unique(first_equal_row(points), return_inverse=True)


def table(array: npt.NDArray[Any], prefix: str = "") -> bytes:
    """Write rows as text in which every number reads back exactly."""
    lines = [f"{prefix}{' '.join(map(repr, row))}\n" for row in array.tolist()]
    return "".join(lines).encode()
