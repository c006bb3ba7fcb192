"""VTP: surfaces of VTK in XML, for ParaView. Written only."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from unbend._types import FloatArray, IntArray

_TYPES = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}


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
        point_data.append(_array("colors", colors))
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
