"""What trimesh would read wrong in glTF: refused, or taken out before it reads."""

from __future__ import annotations

import json
import re
import struct
from importlib.util import find_spec
from typing import Any

from unbend.errors import FileError

# Extensions that matter to looks, and one that allows whole numbers as positions.
_HARMLESS = re.compile(r"[A-Z]+_(materials|texture|lights|animation|xmp)_\w+|KHR_mesh_quantization")
_DRACO = "KHR_draco_mesh_compression"
_FLOAT, _FAN = 5126, 6  # as the specification (Khronos Group, glTF 2.0) numbers them


def readable_gltf(suffix: str, data: bytes) -> tuple[bytes, list[str]]:
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
        raise FileError("its data stand in other files: save it as .glb")
    _refuse(document)
    notes = _without_coordinates(document) + _without_bones(document)
    changed = bool(notes)
    meshes, nodes = document.get("meshes", []), document.get("nodes", [])
    if any(any(one.get("weights", [])) for one in meshes + nodes):
        notes.append("morph targets left out: the shape is the one that they change")
    if not changed:
        return data, notes
    text = json.dumps(document).encode()
    if suffix == ".gltf":
        return text, notes
    text += b" " * (-len(text) % 4)
    rest = data[at + size :]
    head = struct.pack("<4sIII4s", b"glTF", 2, at + len(text) + len(rest), len(text), b"JSON")
    return head + text + rest, notes


def _primitives(document: dict[str, Any]) -> list[dict[str, Any]]:
    return [one for mesh in document.get("meshes", []) for one in mesh["primitives"]]


def _refuse(document: dict[str, Any]) -> None:
    for name in document.get("extensionsRequired", []):
        if name == _DRACO and find_spec("DracoPy"):
            continue
        if not _HARMLESS.fullmatch(name):
            raise FileError(f"needs the glTF extension {name}, which is not read; save it without")
    accessors = document.get("accessors", [])
    for one in _primitives(document):
        if one.get("mode") == _FAN:
            raise FileError("holds triangle fans, which are not read; save it as triangles")
        for key in (one["attributes"].get("POSITION"), one.get("indices")):
            if key is not None and "sparse" in accessors[key]:
                raise FileError("stores positions or faces sparsely; save it without compression")
        if accessors[one["attributes"]["POSITION"]].get("normalized"):
            raise FileError("stores positions as normalized whole numbers; save it as floats")


def _without_coordinates(document: dict[str, Any]) -> list[str]:
    """Take out texture coordinates that trimesh misreads."""
    found = False
    for one in _primitives(document):
        if (key := one["attributes"].get("TEXCOORD_0")) is not None:
            accessor = document["accessors"][key]
            if accessor["componentType"] != _FLOAT or "sparse" in accessor:
                del one["attributes"]["TEXCOORD_0"]
                found = True
    return ["texture coordinates left out, since they are not stored as floats"] * found


def _without_bones(document: dict[str, Any]) -> list[str]:
    """Put meshes with bones at the root of the scene: the specification places them by bones."""
    nodes = document.get("nodes", [])
    scenes = document.get("scenes", [])
    if not scenes or not any("skin" in one for one in nodes):
        return []
    scene = scenes[document.get("scene", 0)]
    left, seen = list(scene.get("nodes", [])), set[int]()
    while left:
        if (at := left.pop()) in seen:
            continue
        seen.add(at)
        left += nodes[at].get("children", [])
    for at in sorted(seen):
        if "skin" in nodes[at] and "mesh" in nodes[at]:
            scene["nodes"].append(len(nodes))
            nodes.append({"mesh": nodes[at].pop("mesh")})
    return ["bones left out: the shape is where its vertices are stored, not where bones move it"]
