"""GLB: glTF 2.0 in one binary file, a chunk of JSON and one of numbers. Written only."""

from __future__ import annotations

import json
import struct
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from unbend._types import FloatArray, IntArray
from unbend.errors import InputError

# What the specification (Khronos Group, glTF 2.0) calls them.
_FLOAT, _UNSIGNED_INT = 5126, 5125
_POINTS, _TRIANGLES = 0, 4
_VERTICES, _INDICES = 34962, 34963


def write(
    file: BinaryIO,
    vertices: FloatArray,
    faces: IntArray,
    colors: npt.NDArray[np.uint8] | None = None,
    uvs: FloatArray | None = None,
) -> None:
    """Write positions in single precision, faces, colours and texture coordinates.

    Vertices that no face uses are put at the origin if single precision cannot hold them. Colours
    are linear in glTF, those of PLY and OBJ files are as screens take them; the first row of a
    texture is its highest here.
    """
    held = np.asarray((np.abs(vertices) <= np.finfo(np.float32).max).all(axis=1))
    if not (held[faces] if len(faces) else held).all():
        raise InputError("GLB holds single-precision numbers, which these positions exceed")
    positions = np.where(held[:, None], vertices, 0.0)
    columns: dict[str, npt.NDArray[Any]] = {"POSITION": positions.astype("<f4")}
    if colors is not None:
        # Bytes are too coarse for dark colours, and MeshLab misreads the shorts between.
        columns["COLOR_0"] = _linear(colors / 255).astype("<f4")
    if uvs is not None:
        columns["TEXCOORD_0"] = np.column_stack([uvs[:, 0], 1 - uvs[:, 1]]).astype("<f4")
    accessors: list[dict[str, Any]] = []
    views: list[dict[str, int]] = []
    data = b""
    for name, array in [*columns.items(), ("indices", faces.astype("<u4").reshape(-1, 1))]:
        if not array.size:
            continue
        accessor: dict[str, Any] = {
            "bufferView": len(views),
            "componentType": _UNSIGNED_INT if name == "indices" else _FLOAT,
            "count": len(array),
            "type": {1: "SCALAR", 2: "VEC2", 3: "VEC3"}[array.shape[1]],
        }
        if name == "POSITION":
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        use = _INDICES if name == "indices" else _VERTICES
        one = array.tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(one), "target": use})
        accessors.append(accessor)
        data += one
    primitive: dict[str, Any] = {
        "attributes": {name: i for i, name in enumerate(columns)},
        "mode": _TRIANGLES if len(faces) else _POINTS,
        "material": 0,
    }
    if len(faces):
        primitive["indices"] = len(columns)
    document = {
        "asset": {"version": "2.0", "generator": "unbend"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "materials": [
            {
                "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.8},
                "doubleSided": True,
            }
        ],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(data)))
    file.write(struct.pack("<I4s", len(text), b"JSON") + text)
    file.write(struct.pack("<I4s", len(data), b"BIN\0") + data)


def _linear(shares: FloatArray) -> FloatArray:
    """Turn colours as screens take them, 0 to 1, into amounts of light (IEC 61966-2-1)."""
    return np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
