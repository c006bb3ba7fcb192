"""VTK's files in XML: surfaces (.vtp), also written, and grids with cells (.vtu)."""

from __future__ import annotations

import lzma
import re
import zlib
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping
from itertools import accumulate, pairwise
from typing import Any, BinaryIO
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.errors import FileError
from unbend.io.formats.contents import Contents, count, misfit, numbers_in
from unbend.io.formats.vtk import STRIPS, contents_of

_TYPES = {
    "f4": "Float32", "f8": "Float64", "i1": "Int8", "i2": "Int16", "i4": "Int32", "i8": "Int64",
    "u1": "UInt8", "u2": "UInt16", "u4": "UInt32", "u8": "UInt64",
}  # fmt: skip
_CODES = {name: code for code, name in _TYPES.items()}
_UNPACK: dict[str, Callable[[bytes], bytes]] = {
    "vtkZLibDataCompressor": zlib.decompress,
    "vtkLZMADataCompressor": lzma.decompress,
}


class _Reader:
    def __init__(self, data: bytes) -> None:
        # What follows the mark may be any bytes, which are no XML.
        text, mark, rest = data.partition(b"<AppendedData")
        try:
            self.root = ElementTree.fromstring(text + b"</VTKFile>" if mark else text)
        except ElementTree.ParseError as error:
            raise FileError(f"truncated, or not a VTK file in XML: {error}") from None
        kind = self.root.get("type", "nothing")
        if self.root.tag != "VTKFile" or kind not in ("PolyData", "UnstructuredGrid"):
            raise FileError(f"holds {kind}, which is no surface; save its surface")
        how, _, data = rest.partition(b"_")
        self.raw, self.appended = b"raw" in how, data.rpartition(b"</AppendedData")[0]
        offsets = (one.get("offset", "0") for one in self.root.iter("DataArray"))
        self.starts = [count(one, "bytes") for one in offsets]
        self.order = ">" if self.root.get("byte_order") == "BigEndian" else "<"
        self.word = np.dtype(
            self.order + ("u8" if self.root.get("header_type") == "UInt64" else "u4")
        )
        self.compressor = self.root.get("compressor")
        if self.compressor and self.compressor not in _UNPACK:
            raise FileError(f"is packed by {self.compressor}, which unbend cannot read; use ZLib")

    def arrays(self, piece: ElementTree.Element, of: str) -> dict[str, npt.NDArray[Any]]:
        """Read the arrays of a piece by name: those of its points, say."""
        return {one.get("Name", ""): self.array(one) for one in piece.iterfind(f"{of}/DataArray")}

    def array(self, one: ElementTree.Element) -> npt.NDArray[Any]:
        """Read an array: text, or numbers in the element or after all."""
        name, kind, how = (one.get(key, "") for key in ("Name", "type", "format"))
        width = count(one.get("NumberOfComponents", "1"), "columns")
        if kind not in _CODES:
            raise misfit(name, kind, ", not a type of numbers that unbend reads")
        if how == "ascii" or not (how or one.get("offset")):
            dtype = np.float64 if "Float" in kind else np.int64
            found = numbers_in([[word] for word in (one.text or "").split()], dtype, "number", name)
        else:
            data = (one.text or "").encode()
            if how == "appended":
                start = count(one.get("offset", ""), "bytes")
                end = min((at for at in self.starts if at > start), default=None)
                data = self.appended[start:end]
            try:
                if not (self.raw and how == "appended"):  # parts, each with its own padding
                    data = b"".join(map(b64decode, re.findall(rb"[A-Za-z0-9+/\s]+=*", data)))
                found = self.unpacked(data, np.dtype(self.order + _CODES[kind]))
            except (ValueError, OverflowError, zlib.error, lzma.LZMAError) as error:
                raise FileError(f"truncated or damaged: {name or 'an array'}: {error}") from None
        if width == 0 or len(found) % width:
            raise FileError(f"damaged: {name} has {len(found)} numbers in rows of {width}")
        return found.reshape(-1, width)

    def unpacked(self, data: bytes, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
        """Take the numbers at the beginning of data, after words that say how many they are."""
        size = self.word.itemsize
        (n,) = np.frombuffer(data, self.word, 1).tolist()
        if self.compressor is None:
            found = np.frombuffer(data, dtype, n // dtype.itemsize, size)
        else:
            sizes = np.frombuffer(data, self.word, n, 3 * size).tolist() if n else []
            ends = accumulate([(3 + n) * size, *sizes])
            blocks = [data[start:end] for start, end in pairwise(ends)]
            found = np.frombuffer(b"".join(map(_UNPACK[self.compressor], blocks)), dtype)
        return found.astype(dtype.newbyteorder("="))


def read(data: bytes) -> Contents:
    """Read positions and polygons of all pieces, and the values of points."""
    file = _Reader(data)
    cells, is_grid = [], file.root.get("type") == "UnstructuredGrid"
    vertices, values, at = [], [], 0
    for piece in file.root.iter("Piece"):
        if piece.get("NumberOfStrips", "0") != "0":
            raise FileError(STRIPS)
        places = next(iter(file.arrays(piece, "Points").values()), np.empty((0, 3)))
        n, found = len(places), file.arrays(piece, "Cells" if is_grid else "Polys")
        none = np.empty((0, 1), dtype=np.int64)
        rows = [found.get(name, none).ravel() for name in ("connectivity", "offsets", "types")]
        promised = count(piece.get("NumberOfPoints", ""), "points")
        if places.shape != (promised, 3) or any(one.dtype.kind == "f" for one in rows):
            raise FileError(
                f"damaged: a piece has not {plural(promised, 'point')} of three numbers, or cells "
                "that are no whole numbers"
            )
        corners, ends, types = (one.astype(np.int64) for one in rows)
        sizes = np.diff(ends, prepend=0)
        if ((sizes < 0) | (sizes > len(corners))).any() or sizes.sum() != len(corners):
            raise FileError(
                f"damaged: its {len(corners)} corners are not those of {len(sizes)} cells"
            )
        if ((corners < 0) | (corners >= n)).any():
            raise FileError(
                f"damaged: a cell of a piece of {plural(n, 'point')} has another corner"
            )
        with np.errstate(invalid="ignore"):  # a signalling NaN, which Mesh refuses
            vertices.append(places.astype(np.float64))
        told = file.arrays(piece, "PointData")
        if lacking := [name for name, one in told.items() if len(one) != n]:
            raise FileError(f"damaged: {lacking[0]} does not have a row for each point")
        values.append({(name, one.shape[1]): one for name, one in told.items()})
        cells.append((sizes, corners + at, types))
        at += n
    if not cells:
        raise FileError("holds no pieces")
    sizes, corners, types = map(np.concatenate, zip(*cells, strict=True))
    shared = {
        key[0]: np.concatenate([one[key] for one in values])
        for key in sorted(set.intersection(*map(set, values)))
    }
    return contents_of(np.concatenate(vertices), sizes, corners, types if is_grid else None, shared)


def write(
    file: BinaryIO,
    vertices: FloatArray,
    faces: IntArray,
    scalars: Mapping[str, FloatArray] | None = None,
    colors: npt.NDArray[np.uint8] | None = None,
    uvs: FloatArray | None = None,
) -> None:
    """Write positions and point data in double precision; a point cloud has a vertex cell each."""
    point_data = [_array(name, values) for name, values in (scalars or {}).items()]
    if colors is not None:
        point_data.append(_array("color", colors))
    if uvs is not None:
        point_data.append(_array("uv", uvs))
    coordinates = "" if uvs is None else ' TCoords="uv"'
    cells = faces if len(faces) else np.arange(len(vertices))[:, None]
    kind, width = ("Polys", 3) if len(faces) else ("Verts", 1)
    ends = np.arange(1, len(cells) + 1) * width
    lines = [
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        f'<PolyData><Piece NumberOfPoints="{len(vertices)}" NumberOf{kind}="{len(cells)}">',
        f"<PointData{coordinates}>",
        *point_data,
        "</PointData><Points>",
        _array("Points", vertices),
        f"</Points><{kind}>",
        _array("connectivity", cells.ravel()),
        _array("offsets", ends),
        f"</{kind}></Piece></PolyData></VTKFile>\n",
    ]
    file.write("\n".join(lines).encode())


def _array(name: str, values: npt.NDArray[Any]) -> str:
    values = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
    data = b64encode(values.nbytes.to_bytes(8, "little") + values.tobytes()).decode()
    width = values[:1].size if len(values) else 1
    return (
        f'<DataArray type="{_TYPES[values.dtype.str[1:]]}" Name="{name}" '
        f'NumberOfComponents="{width}" format="binary">{data}</DataArray>'
    )
