"""glTF 2.0 (Khronos Group): .glb files are written, and files made fit for trimesh to read."""

from __future__ import annotations

import base64
import json
import re
import struct
from importlib.util import find_spec
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from unbend._arrays import first_equal_row, unit_vectors
from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.errors import FileError
from unbend.mesh import vertex_normals

# As the specification numbers them.
_UNSIGNED_SHORT, _UNSIGNED_INT, _FLOAT = 5123, 5125, 5126
_NORMALS = {5120: "i1", 5122: "<i2", _FLOAT: "<f4"}  # as which normals may be stored
_POINTS, _LINES, _TRIANGLES, _FAN = 0, (1, 2, 3), 4, 6
_VERTICES, _INDICES = 34962, 34963
# Extensions that matter to looks, and one that allows whole numbers as positions.
_HARMLESS = re.compile(r"[A-Z]+_(materials|texture|lights|animation|xmp)_\w+|KHR_mesh_quantization")
DRACO = "KHR_draco_mesh_compression"
_COPIES = "EXT_mesh_gpu_instancing"  # matters although files may call it not required


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
    columns = {"POSITION": np.where(held[:, None], vertices, 0.0).astype("<f4")}
    if colors is not None:
        shares = colors / 255  # as screens take them; amounts of light by IEC 61966-2-1
        light = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
        # Bytes are too coarse for dark colours, and MeshLab misreads the shorts between.
        columns["COLOR_0"] = light.astype("<f4")
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
    file.write(_beginning(document, 8 + len(data)))
    file.write(struct.pack("<I4s", len(data), b"BIN\0") + data)


def is_movable(data: bytes) -> bool:
    """Whether :func:`move` can move the vertices of a .glb file.

    Not if it has bones, morph targets, compression, lines, copies of parts, parts that share
    vertices, or parts that are not shown.
    """
    document = _document(data)[0]
    primitives, nodes = _primitives(document), document.get("nodes", [])
    placed = sorted(one["mesh"] for one in nodes if "mesh" in one)
    places = [document["accessors"][one["attributes"]["POSITION"]] for one in primitives]
    return (
        all("skin" not in one for one in nodes)
        and all("targets" not in one for one in primitives)
        and all(one.get("mode", _TRIANGLES) not in _LINES for one in primitives)
        and DRACO not in document.get("extensionsUsed", [])
        and ["uri" in one for one in document.get("buffers", [])] == [False]
        and all("bufferView" in one and one["componentType"] == _FLOAT for one in places)
        and len({_stored(one) for one in places}) == len(places)
        and placed == sorted(_shown(document)) == [*range(len(document["meshes"]))]
    )


def move(
    data: bytes,
    places: list[tuple[slice, FloatArray]],
    before: FloatArray,
    vertices: FloatArray,
    faces: IntArray,
) -> bytes:
    """Move the vertices of a .glb file, and turn their normals; everything else stays.

    `places` has for each part its rows among the vertices and the matrix (4, 4) that places it.
    """
    document, rest = _document(data)
    accessors, primitives = document["accessors"], _primitives(document)
    if len(places) != len(primitives):  # such as where a node has a camera, too
        raise FileError("not all of its parts are read, so nothing but its shape can be kept")

    def column(key: int) -> npt.NDArray[Any]:
        accessor = accessors[key]
        view = document["bufferViews"][accessor["bufferView"]]
        start = 8 + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        kind = np.dtype(_NORMALS[accessor["componentType"]])
        strides = view.get("byteStride", 3 * kind.itemsize), kind.itemsize
        return np.ndarray((accessor["count"], 3), kind, rest, start, strides)

    def room_for(count: int) -> int:  # so many normals; the number of their accessor
        end = int.from_bytes(rest[:4], "little")
        rest[8 + end : 8 + end] = bytes(12 * count)
        rest[:4] = struct.pack("<I", end + 12 * count)
        document["buffers"][0]["byteLength"] = end + 12 * count
        views = document["bufferViews"]
        views.append({"buffer": 0, "byteOffset": end, "byteLength": 12 * count})
        accessor = {"bufferView": len(views) - 1, "componentType": _FLOAT}
        accessors.append(accessor | {"count": count, "type": "VEC3"})
        return len(accessors) - 1

    vertices = np.nan_to_num(vertices)  # of vertices in no face
    turned = np.zeros_like(vertices)
    taken = {_stored(accessors[one["attributes"]["POSITION"]]) for one in primitives}
    for one, (rows, _) in zip(primitives, places, strict=True):
        one["attributes"].pop("TANGENT", None)
        key = one["attributes"].get("NORMAL")
        if key is None:
            continue
        kind, stored = accessors[key]["componentType"], _stored(accessors[key])
        plain = kind in _NORMALS and stored[0] is not None and "sparse" not in accessors[key]
        if plain:
            turned[rows] = column(key)
        if stored in taken or not plain or kind != _FLOAT:
            one["attributes"]["NORMAL"] = room_for(rows.stop - rows.start)
        taken.add(stored)
    # Vertices at one position had one normal at a seam, and unlike ones at a sharp edge.
    number = first_equal_row(np.column_stack([before, turned]))
    turned = vertex_normals(vertices, number[faces])[number]
    for one, (rows, placement) in zip(primitives, places, strict=True):
        values, turn = one["attributes"], placement[:3, :3]
        columns = {
            "POSITION": (vertices[rows] - placement[:3, 3]) @ np.linalg.inv(turn).T,
            "NORMAL": unit_vectors(turned[rows] @ turn),
        }
        for name in columns.keys() & values.keys():
            moved = column(values[name])
            moved[:] = columns[name]
            bounds = {"min": moved.min(axis=0).tolist(), "max": moved.max(axis=0).tolist()}
            accessors[values[name]] |= bounds
    return _beginning(document, len(rest)) + rest


def _document(data: bytes) -> tuple[dict[str, Any], bytearray]:
    """Give the document of a .glb file, and the bytes behind it."""
    size = int.from_bytes(data[12:16], "little")
    return json.loads(data[20 : 20 + size]), bytearray(data[20 + size :])


def _beginning(document: dict[str, Any], more: int) -> bytes:
    """Head of a file and its document, after which so many bytes follow."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    size = 20 + len(text) + more
    return struct.pack("<4sIII4s", b"glTF", 2, size, len(text), b"JSON") + text


def readable(suffix: str, data: bytes) -> tuple[bytes, list[str]]:
    """Give what trimesh reads right, and notes of what was taken out.

    Raises FileError for shapes that it would read wrong.
    """
    at, size = 0, len(data)
    if suffix == ".glb":
        if not data.startswith(b"glTF\2\0\0\0"):
            return data, []  # trimesh says what it is
        at, size = 20, int.from_bytes(data[12:16], "little")
    document = json.loads(data[at : at + size])
    if suffix == ".gltf" and not all(
        one.get("uri", "").startswith("data:") for one in document.get("buffers", [])
    ):
        raise FileError("its data are in other files: save it as .glb")
    _refuse(document)
    notes = _without_misread(document) + _without_bones(document, data[at + size + 8 :])
    bare = [one for one in _primitives(document) if "material" not in one]
    if bare:  # without one trimesh rounds or garbles colours, and drops texture coordinates
        materials = document.setdefault("materials", [])
        for one in bare:
            one["material"] = len(materials)
        materials.append({})
    if (notes or bare) and suffix == ".gltf":
        data = json.dumps(document).encode()
    elif notes or bare:
        rest = data[at + size :]
        data = _beginning(document, len(rest)) + rest
    meshes, nodes = document.get("meshes", []), document.get("nodes", [])
    if hidden := len({*range(len(meshes))} - {*_shown(document)}):
        notes.append(f"{plural(hidden, 'part')} left out, outside the scene that is shown")
    if any(any(one.get("weights", [])) for one in meshes + nodes):
        notes.append("morph targets left out: the shape is the one that they change")
    return data, notes


def _primitives(document: dict[str, Any]) -> list[dict[str, Any]]:
    return [one for mesh in document.get("meshes", []) for one in mesh["primitives"]]


def _stored(accessor: dict[str, Any]) -> tuple[int | None, int]:
    """Where its numbers are: a view, and an offset."""
    return accessor.get("bufferView"), accessor.get("byteOffset", 0)


def _shown(document: dict[str, Any]) -> list[int]:
    """Meshes that nodes of the shown scene place, as often as they do."""
    nodes, scene = document.get("nodes", []), document.get("scene", 0)
    shown = document.get("scenes", [])[scene : scene + 1]  # none, if there is no such scene
    left = [number for one in shown for number in one.get("nodes", [])]
    found: set[int] = set()
    while left:
        number = left.pop()
        if number not in found:
            found.add(number)
            left += nodes[number].get("children", [])
    return [nodes[number]["mesh"] for number in found if "mesh" in nodes[number]]


def _refuse(document: dict[str, Any]) -> None:
    copies = {_COPIES} & {*document.get("extensionsUsed", [])}
    for name in [*document.get("extensionsRequired", []), *copies]:
        is_draco = name == DRACO
        if not (find_spec("DracoPy") if is_draco else _HARMLESS.fullmatch(name)):
            advice = ": install DracoPy, or" if is_draco else ", which is not read;"
            raise FileError(f"needs the glTF extension {name}{advice} save it without")
    accessors = document.get("accessors", [])
    for one in _primitives(document):
        if one.get("mode") == _FAN:
            raise FileError("holds triangle fans, which are not read; save it as triangles")
        for key in (one["attributes"].get("POSITION"), one.get("indices")):
            if key is not None and "sparse" in accessors[key]:
                raise FileError("stores positions or faces sparsely; save it without compression")
        if accessors[one["attributes"]["POSITION"]].get("normalized"):
            raise FileError("stores positions as normalized whole numbers; save it as floats")


def _without_misread(document: dict[str, Any]) -> list[str]:
    """Take out texture coordinates and colours that trimesh misreads."""
    accessors, notes = document.get("accessors", []), {}
    for one in _primitives(document):
        values = one["attributes"]
        kinds = {name: accessors[key]["componentType"] for name, key in values.items()}
        if "TEXCOORD_0" in values:
            material = document.get("materials", [{}])[one.get("material", 0)]
            moved = "KHR_texture_transform" in json.dumps(material)
            sparse = "sparse" in accessors[values["TEXCOORD_0"]]
            if moved or sparse or kinds["TEXCOORD_0"] != _FLOAT:
                del values["TEXCOORD_0"]
                why = "the file moves them" if moved else "they are not stored as floats"
                notes[f"texture coordinates left out, since {why}"] = True
        if one.get("mode") == _POINTS and kinds.get("COLOR_0") == _UNSIGNED_SHORT:
            del values["COLOR_0"]
            notes["colours of points left out, since they have 16 bits"] = True
    return [*notes]


def _without_bones(document: dict[str, Any], chunk: bytes) -> list[str]:
    """Put meshes with bones where their first bone puts them: their own place does not count."""
    nodes = document.get("nodes", [])
    placed = [one for one in nodes if "skin" in one and "mesh" in one]
    for one in placed:
        skin, node = document["skins"][one["skin"]], {"mesh": one.pop("mesh")}
        if "inverseBindMatrices" in skin:
            accessor = document["accessors"][skin["inverseBindMatrices"]]
            view = document["bufferViews"][accessor["bufferView"]]
            uri = document["buffers"][view["buffer"]].get("uri")
            data = chunk if uri is None else base64.b64decode(uri.partition(",")[2])
            start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            node["matrix"] = np.frombuffer(data, "<f4", 16, start).tolist()
        nodes[skin["joints"][0]].setdefault("children", []).append(len(nodes))
        nodes.append(node)
    return ["bones and their weights left out: the shape is the one that they move"] * bool(placed)
