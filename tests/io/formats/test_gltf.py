"""GLB files hold what trimesh, which reads them by other code, finds in them."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from unbend import Mesh, write_mesh
from unbend.errors import InputError


def parts(path: Path) -> tuple[dict, bytes]:
    """Both chunks, their lengths checked against the file's."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    rest, other = struct.unpack_from("<I4s", data, 20 + size)
    assert (kind, other) == (b"JSON", b"BIN\0")
    assert 28 + size + rest == len(data)
    assert size % 4 == rest % 4 == 0
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def test_positions_faces_and_colours_come_back(blob: Mesh, tmp_path: Path) -> None:
    colors = np.random.default_rng(0).integers(0, 256, (642, 3))
    write_mesh(tmp_path / "a.glb", blob, colors=colors)
    (back,) = trimesh.load(tmp_path / "a.glb", process=False).geometry.values()
    np.testing.assert_allclose(back.vertices, blob.vertices, atol=1e-6)
    np.testing.assert_array_equal(back.faces, blob.faces)
    # As light, which trimesh keeps as it is.
    shares = colors / 255
    light = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(back.visual.vertex_attributes["color"], light, atol=1e-6)


def test_texture_coordinates_count_from_the_top(blob: Mesh, tmp_path: Path) -> None:
    uvs = np.random.default_rng(0).random((642, 2))
    write_mesh(tmp_path / "a.glb", blob, uvs=uvs)
    document, data = parts(tmp_path / "a.glb")
    primitive = document["meshes"][0]["primitives"][0]
    view = document["bufferViews"][primitive["attributes"]["TEXCOORD_0"]]
    stored = np.frombuffer(data, "<f4", 2 * 642, view["byteOffset"]).reshape(-1, 2)
    np.testing.assert_allclose(stored, np.column_stack([uvs[:, 0], 1 - uvs[:, 1]]), atol=1e-6)


@pytest.mark.parametrize("points", [True, False])
def test_positions_beyond_single_precision_are_refused(
    blob: Mesh, tmp_path: Path, points: bool
) -> None:
    with pytest.raises(InputError, match="single-precision numbers, which these positions exceed"):
        write_mesh(tmp_path / "a.glb", Mesh(1e200 * blob.vertices, None if points else blob.faces))


@pytest.mark.parametrize("points", [True, False])
def test_what_the_specification_asks_for(blob: Mesh, tmp_path: Path, points: bool) -> None:
    vertices = np.vstack([blob.vertices, np.full((int(not points), 3), np.nan)])
    mesh = Mesh(vertices, None if points else blob.faces)
    write_mesh(tmp_path / "a.glb", mesh, colors=np.zeros((len(vertices), 3), int))
    document, data = parts(tmp_path / "a.glb")
    primitive = document["meshes"][0]["primitives"][0]
    assert primitive["mode"] == (0 if points else 4)
    assert ("indices" in primitive) != points
    place = document["accessors"][primitive["attributes"]["POSITION"]]
    stored = np.frombuffer(data, "<f4", 3 * place["count"]).reshape(-1, 3)
    assert np.isfinite(stored).all()
    np.testing.assert_array_equal(stored.min(axis=0), place["min"])
    np.testing.assert_array_equal(stored.max(axis=0), place["max"])
    (root,) = document["scenes"][document["scene"]]["nodes"]
    assert document["nodes"][root] == {"mesh": 0}
    material = document["materials"][primitive["material"]]
    assert material["doubleSided"]  # winding may be mixed
    assert material["pbrMetallicRoughness"] == {"metallicFactor": 0, "roughnessFactor": 0.8}
    for i, view in enumerate(document["bufferViews"]):
        assert view["target"] == (34963 if i == primitive.get("indices") else 34962)
    sizes = {5126: 4, 5125: 4}
    for accessor, view in zip(document["accessors"], document["bufferViews"], strict=True):
        assert view["byteOffset"] % 4 == 0
        count = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        width = count * sizes[accessor["componentType"]]
        assert width % 4 == 0
        assert view["byteLength"] == width * accessor["count"]
    assert document["buffers"] == [{"byteLength": len(data)}]
