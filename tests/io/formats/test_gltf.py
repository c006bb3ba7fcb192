"""glTF: what is written, trimesh finds by other code; what it would read wrong is refused."""

import base64
import json
import struct
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from sheets import cut_along_seam
from unbend import Mesh, write_mesh
from unbend.errors import FileError, InputError, UnbendWarning
from unbend.io import keeps_all, read_mesh, read_values
from unbend.io._foreign import _values
from unbend.io._meshes import read_contents
from unbend.mesh import vertex_normals

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="<f4")
FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype="<u4")
SHARES = np.array([[0, 0], [65535, 0], [65535, 65535], [0, 65535]], dtype="<u2")
TO_BONE = np.diag([0.5, 2, 1, 1]) + np.eye(4, k=3) * 3  # by which bones know the mesh
PARTS = [QUAD, FACES, SHARES, TO_BONE.T.astype("<f4")]  # matrices are stored by columns
_BYTES = b"".join(part.tobytes() for part in PARTS)


def document() -> dict[str, Any]:
    sizes = [part.nbytes for part in PARTS]
    starts = [0, *np.cumsum(sizes).tolist()]
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 6, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5123, "count": 4, "type": "VEC2"},
            {"bufferView": 3, "componentType": 5126, "count": 1, "type": "MAT4"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": size}
            for start, size in zip(starts[:-1], sizes, strict=True)
        ],
        "buffers": [{"byteLength": len(_BYTES)}],
    }


def write(path: Path, given: dict[str, Any]) -> None:
    if path.suffix == ".gltf":
        uri = "data:application/octet-stream;base64," + base64.b64encode(_BYTES).decode()
        path.write_text(json.dumps(given | {"buffers": [given["buffers"][0] | {"uri": uri}]}))
        return
    text = json.dumps(given).encode()
    text += b" " * (-len(text) % 4)
    size = 28 + len(text) + len(_BYTES)
    path.write_bytes(
        struct.pack("<4sIII4s", b"glTF", 2, size, len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(_BYTES), b"BIN\0")
        + _BYTES
    )


def changed(where: str, value: Any) -> dict[str, Any]:
    """The document with something added to one of its parts."""
    given = document()
    part: Any = given
    *ways, last = where.split("/")
    for way in ways:
        part = part[int(way) if way.isdecimal() else way]
    if last.isdecimal():
        part.insert(int(last), value)
    else:
        part[last] = value
    return given


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize(
    ("where", "value", "sentence"),
    [
        ("extensionsRequired", ["EXT_meshopt_compression"], "the glTF extension EXT_meshopt_comp"),
        ("accessors/0/sparse", {"count": 1}, "stores positions or faces sparsely"),
        ("accessors/1/sparse", {"count": 1}, "stores positions or faces sparsely"),
        ("accessors/0/normalized", True, "stores positions as normalized whole numbers"),
        ("meshes/0/primitives/0/mode", 6, "holds triangle fans"),
        ("extensionsUsed", ["EXT_mesh_gpu_instancing"], "the glTF extension EXT_mesh_gpu_inst"),
    ],
)
def test_what_trimesh_would_read_wrong_is_refused(
    tmp_path: Path, suffix: str, where: str, value: Any, sentence: str
) -> None:
    write(tmp_path / f"a{suffix}", changed(where, value))
    with pytest.raises(FileError, match=rf"^a\{suffix}: .*{sentence}"):
        read_mesh(tmp_path / f"a{suffix}")


def test_draco_needs_its_decoder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "a.glb", changed("extensionsRequired", ["KHR_draco_mesh_compression"]))
    monkeypatch.setattr("unbend.io.formats.gltf.find_spec", lambda name: None)
    with pytest.raises(FileError, match="KHR_draco_mesh_compression: install DracoPy, or"):
        read_mesh(tmp_path / "a.glb")
    monkeypatch.setattr("unbend.io.formats.gltf.find_spec", lambda name: name == "DracoPy")
    assert read_mesh(tmp_path / "a.glb").n_faces == 2


def test_draco_data_that_are_not_decoded_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Trimesh gives zeros for them: if it is older than its decoder, or the data are damaged."""
    monkeypatch.setattr("unbend.io.formats.gltf.find_spec", lambda name: name)
    given = changed("extensionsRequired", ["KHR_draco_mesh_compression"])
    (primitive,) = given["meshes"][0]["primitives"]
    primitive["extensions"] = {
        "KHR_draco_mesh_compression": {"bufferView": 1, "attributes": {"POSITION": 0}}
    }
    for one in given["accessors"][:2]:
        del one["bufferView"]
    write(tmp_path / "a.glb", given)
    with pytest.raises(FileError, match=r"^a\.glb: its Draco data could not be decoded"):
        read_mesh(tmp_path / "a.glb")


@pytest.mark.parametrize(
    "name", ["KHR_texture_transform", "KHR_materials_unlit", "KHR_mesh_quantization"]
)
def test_extensions_that_do_not_matter_to_the_shape_are_read(tmp_path: Path, name: str) -> None:
    write(tmp_path / "a.glb", changed("extensionsRequired", [name]))
    mesh = read_mesh(tmp_path / "a.glb")
    np.testing.assert_array_equal(mesh.vertices, QUAD)
    assert mesh.notes == ("read by trimesh",)


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("bound", [True, False])
def test_meshes_with_bones_are_where_the_first_bone_puts_them(
    tmp_path: Path, suffix: str, bound: bool
) -> None:
    given = document()
    bone = {"translation": [7, 0, 0], "scale": [100, 100, 100], "children": [1, 2]}
    skinned = {"mesh": 0, "skin": 0, "scale": [100, 50, 100], "children": [3]}
    hat = {"mesh": 0, "translation": [0, 0, 1]}
    given["nodes"] = [bone, skinned, hat, {}]
    given["skins"] = [{"joints": [0], **({"inverseBindMatrices": 3} if bound else {})}]
    write(tmp_path / f"a{suffix}", given)
    mesh = read_mesh(tmp_path / f"a{suffix}")
    body = QUAD * [0.5, 2, 1] + [3, 0, 0] if bound else QUAD
    places = np.vstack([QUAD + np.array([0, 0, 1]), body]) * 100 + [7, 0, 0]
    assert sorted(mesh.vertices.tolist()) == sorted(places.tolist())
    assert "bones and their weights left out" in mesh.notes[1]


def test_parts_outside_the_scene_that_is_shown_are_left_out_with_a_note(tmp_path: Path) -> None:
    given = document()
    given["nodes"] = [{"children": [1]}, {"mesh": 0}, {"mesh": 1, "translation": [0, 0, 9]}]
    given["meshes"].append(
        {"primitives": [{"attributes": {"POSITION": len(given["accessors"])}, "indices": 1}]}
    )
    given["accessors"].append(given["accessors"][0] | {"bufferView": 3})
    given["scenes"] = [{"nodes": [2]}, {"nodes": [0]}]
    given["scene"] = 1
    write(tmp_path / "a.glb", given)
    mesh = read_mesh(tmp_path / "a.glb")
    np.testing.assert_array_equal(mesh.vertices, QUAD)
    assert mesh.notes[1:] == ("1 part left out, outside the scene that is shown",)
    assert not keeps_all("b.glb", tmp_path / "a.glb")
    with pytest.raises(FileError, match=r"nothing but its shape .* parts that are not shown"):
        write_mesh(tmp_path / "b.glb", mesh, like=tmp_path / "a.glb")
    given["scenes"][1]["nodes"] = [0, 2]
    write(tmp_path / "a.glb", given)
    assert read_mesh(tmp_path / "a.glb").notes == ("read by trimesh",)
    assert keeps_all("b.glb", tmp_path / "a.glb")
    given["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]
    given["nodes"][2]["camera"] = 0  # which trimesh reads instead
    write(tmp_path / "a.glb", given)
    with pytest.raises(FileError, match="not all of its parts are read"):
        write_mesh(tmp_path / "b.glb", read_mesh(tmp_path / "a.glb"), like=tmp_path / "a.glb")
    write(tmp_path / "a.glb", given | {"scene": 5})
    assert not keeps_all("b.glb", tmp_path / "a.glb")


def test_values_that_some_parts_lack_are_named(blob: Mesh, tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for colors in (None, np.full((642, 4), 255)):
        scene.add_geometry(
            trimesh.Trimesh(blob.vertices, blob.faces, vertex_colors=colors, process=False)
        )
    scene.export(tmp_path / "a.glb")
    why = "color left out, since some parts have none"
    assert why in read_mesh(tmp_path / "a.glb").notes
    with pytest.raises(FileError, match=rf"^a\.glb: holds no values per vertex; {why}$"):
        read_values(tmp_path / "a.glb")


def test_morph_targets_are_left_out_with_a_note(tmp_path: Path) -> None:
    write(tmp_path / "a.glb", changed("meshes/0/weights", [0, 1]))
    assert "morph targets left out" in read_mesh(tmp_path / "a.glb").notes[1]
    write(tmp_path / "a.glb", changed("meshes/0/weights", [0, 0]))
    assert len(read_mesh(tmp_path / "a.glb").notes) == 1


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_colours_and_texture_coordinates_need_no_material(tmp_path: Path, suffix: str) -> None:
    """Without one, trimesh takes the lower half of 16 bits: Blender's colours became others."""
    path, given = tmp_path / f"a{suffix}", changed("accessors/2/normalized", True)
    given["accessors"][2] |= {"type": "VEC4", "count": 4}
    given["bufferViews"][2]["byteLength"] = 32
    given["accessors"].append({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC2"})
    attributes = given["meshes"][0]["primitives"][0]["attributes"]
    attributes |= {"COLOR_0": 2, "TEXCOORD_0": 4}
    write(path, given)
    shorts = np.frombuffer(SHARES.tobytes() + TO_BONE.T.astype("<f4").tobytes(), "<u2")[:16]
    shares = shorts.reshape(4, 4)[:, :3] / 65535
    shown = np.where(shares <= 0.0031308, shares * 12.92, 1.055 * shares ** (1 / 2.4) - 0.055)
    assert [*read_contents(path).values()] == ["alpha", "color", "uv"]  # whatever Python's hashes
    with pytest.warns(UnbendWarning, match="transparency"):
        found = read_values(path)
    np.testing.assert_array_equal(found, np.rint(shown * 255))
    first = np.ravel(QUAD)[:8].reshape(4, 2)
    np.testing.assert_array_equal(read_values(path, name="uv"), first * [1, -1] + [0, 1])
    given["meshes"][0]["primitives"][0]["mode"] = 0
    write(path, given)
    assert "colours of points left out, since they have 16 bits" in read_mesh(path).notes[1]


def test_colours_of_16_bits_that_draco_gives_as_32_are_colours() -> None:
    light = np.array([[65535, 0, 0, 65535]], dtype=np.uint32)
    visual = SimpleNamespace(vertex_attributes={"color": light}, kind="texture")
    assert _values(SimpleNamespace(visual=visual), linear=True)["color"].tolist() == [[255, 0, 0]]


@pytest.mark.parametrize(
    ("kind", "material", "why"),
    [
        (5123, {}, "they are not stored as floats"),
        (5126, {"extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}, "the file moves them"),
    ],
)
def test_texture_coordinates_that_would_be_wrong_are_left_out_with_a_note(
    tmp_path: Path, kind: int, material: dict[str, Any], why: str
) -> None:
    given = changed("meshes/0/primitives/0/attributes/TEXCOORD_0", 2 if kind == 5123 else 4)
    given["accessors"].append({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC2"})
    given["meshes"][0]["primitives"][0]["material"] = 0
    given["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0} | material}}]
    write(tmp_path / "a.glb", given)
    note = f"texture coordinates left out, since {why}"
    assert read_mesh(tmp_path / "a.glb").notes[1] == note
    with pytest.raises(InputError, match="no values per vertex"):
        read_values(tmp_path / "a.glb")


def test_whoever_asks_for_skinning_weights_hears_where_they_are_carried(tmp_path: Path) -> None:
    given = document()
    (primitive,) = given["meshes"][0]["primitives"]
    primitive["attributes"] |= {"JOINTS_0": 2, "WEIGHTS_0": 2}  # which are not looked at
    write(tmp_path / "a.glb", given)
    where = "its skinning weights are not read: in Blender, unbend's extension carries them"
    with pytest.raises(FileError, match=rf"^a\.glb: holds no values per vertex; {where}$"):
        read_values(tmp_path / "a.glb")
    primitive["attributes"]["COLOR_0"] = 0
    write(tmp_path / "a.glb", given)
    with pytest.raises(FileError, match=rf"^a\.glb: holds no weights, but color; .*; {where}$"):
        read_values(tmp_path / "a.glb", name="weights")


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


def test_a_file_written_like_another_has_all_but_positions_and_normals(
    blob: Mesh, tmp_path: Path
) -> None:
    """Of two parts, one has a texture and is placed by the scene, and the other a sharp edge."""
    cut, seam = cut_along_seam(blob)
    uvs = np.random.default_rng(0).random((cut.n_vertices, 2))
    image = pytest.importorskip("PIL.Image").new("RGB", (2, 2), (9, 99, 200))
    placement = trimesh.transformations.compose_matrix(
        [3] * 3, angles=[1, 2, 3], translate=[4, 5, 6]
    )
    fold = QUAD[FACES.ravel()] + np.eye(6)[:, 3:] * [0, 0, 1]
    scene = trimesh.Scene()
    smooth = vertex_normals(blob.vertices, blob.faces)
    smooth = np.concatenate([smooth, smooth[seam]])
    body = trimesh.Trimesh(cut.vertices, cut.faces, vertex_normals=smooth, process=False)
    body.visual = trimesh.visual.TextureVisuals(uv=uvs, image=image)
    scene.add_geometry(body, transform=placement)
    scene.add_geometry(trimesh.Trimesh(fold, [[0, 1, 2], [3, 4, 5]], process=False))
    before, after = tmp_path / "a.glb", tmp_path / "b.glb"
    scene.export(before, include_normals=True)
    mesh = read_mesh(before)
    np.testing.assert_allclose(mesh.vertices[-6:], fold)  # parts are in the order of the file
    moved = Mesh(mesh.vertices[:, [1, 2, 0]] * [3, 2, 2] + 1, mesh.faces)
    assert keeps_all(after, before)
    write_mesh(after, moved, like=before)
    back = read_mesh(after)
    np.testing.assert_allclose(back.vertices, moved.vertices, atol=1e-4)
    np.testing.assert_array_equal(back.faces, moved.faces)
    body, fold = trimesh.load_scene(after, process=False).geometry.values()
    np.testing.assert_allclose(body.visual.uv, uvs, atol=1e-6)
    assert body.visual.material.baseColorTexture.getpixel((0, 0)) == (9, 99, 200)
    smooth = vertex_normals(body.vertices[: blob.n_vertices], blob.faces)
    expected = np.concatenate([smooth, smooth[seam]])
    np.testing.assert_allclose(body.vertex_normals, expected, atol=1e-5)
    np.testing.assert_allclose(fold.vertex_normals, fold.face_normals.repeat(3, axis=0), atol=1e-5)
    document, _ = parts(after)
    keys = document["meshes"][0]["primitives"][0]["attributes"]
    for name, rows in (("POSITION", body.vertices), ("NORMAL", body.vertex_normals)):
        bounds = document["accessors"][keys[name]]
        np.testing.assert_allclose(bounds["min"], rows.min(axis=0), atol=1e-6)
        np.testing.assert_allclose(bounds["max"], rows.max(axis=0), atol=1e-6)


@pytest.mark.parametrize(
    ("where", "value"),
    [
        ("nodes/0/skin", 0),
        ("nodes/1", {"mesh": 0}),
        ("meshes/0/primitives/0/targets", [{}]),
        ("meshes/0/primitives/1", {"attributes": {"POSITION": 0}}),
        ("meshes/0/primitives/0/mode", 1),
        ("accessors/0/componentType", 5123),
        ("extensionsUsed", ["KHR_draco_mesh_compression"]),
    ],
)
def test_of_other_files_only_the_shape_is_kept(tmp_path: Path, where: str, value: Any) -> None:
    path = tmp_path / "a.glb"
    write(path, document())
    assert keeps_all("b.glb", path)
    assert not keeps_all("b.obj", path)
    write(path, changed(where, value))
    assert not keeps_all("b.glb", path)
    with pytest.raises(FileError, match=r"^a\.glb: "):
        write_mesh(tmp_path / "b.glb", (QUAD, FACES), like=path)


@pytest.mark.parametrize("sparse", [False, True])
def test_normals_that_are_no_plain_floats_become_such(tmp_path: Path, sparse: bool) -> None:
    given = changed("meshes/0/primitives/0/attributes/NORMAL", 4)
    kind = {"componentType": 5126, "sparse": {"count": 1}} if sparse else {"componentType": 5120}
    given["accessors"].append({"bufferView": 3, "count": 4, "type": "VEC3"} | kind)
    write(tmp_path / "a.glb", given)
    moved = 2 * QUAD[:, [1, 2, 0]]
    write_mesh(tmp_path / "b.glb", (moved, FACES), like=tmp_path / "a.glb")
    np.testing.assert_array_equal(read_mesh(tmp_path / "b.glb").vertices, moved)
    (part,) = trimesh.load_scene(tmp_path / "b.glb", process=False).geometry.values()
    np.testing.assert_allclose(part.vertex_normals, [[0, 1, 0]] * 4, atol=1e-6)
    document, data = parts(tmp_path / "b.glb")
    assert document["buffers"] == [{"byteLength": len(data)}]
    assert data[: len(_BYTES)][48:] == _BYTES[48:]


def test_parts_that_share_their_normals_get_their_own(blob: Mesh, tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for shift in (0, 4):
        scene.add_geometry(trimesh.Trimesh(blob.vertices + shift, blob.faces, process=False))
    scene.export(tmp_path / "a.glb", include_normals=True)
    keys = [
        mesh["primitives"][0]["attributes"]["NORMAL"]
        for mesh in parts(tmp_path / "a.glb")[0]["meshes"]
    ]
    one, other = (b'"NORMAL":%d' % key for key in keys)
    (tmp_path / "a.glb").write_bytes((tmp_path / "a.glb").read_bytes().replace(other, one))
    mesh = read_mesh(tmp_path / "a.glb")
    moved = mesh.vertices.copy()
    moved[len(moved) // 2 :] *= [1, 2, 3]
    write_mesh(tmp_path / "b.glb", (moved, mesh.faces), like=tmp_path / "a.glb")
    for part in trimesh.load_scene(tmp_path / "b.glb", process=False).geometry.values():
        expected = vertex_normals(part.vertices, part.faces)
        np.testing.assert_allclose(part.vertex_normals, expected, atol=1e-5)


def export(path: Path, *placed: tuple[Mesh, Any]) -> Mesh:
    """Read what nodes place somewhere, whose positions are stored from there."""
    scene = trimesh.Scene()
    for mesh, pivot in placed:
        part = trimesh.Trimesh(mesh.vertices - pivot, mesh.faces, process=False)
        part.remove_unreferenced_vertices()
        scene.add_geometry(part, transform=trimesh.transformations.translation_matrix(pivot))
    scene.export(path)
    return read_mesh(path)


@pytest.mark.parametrize("far", [0.0, 5e6])
def test_parts_that_nodes_place_side_by_side_are_joined(
    blob: Mesh, tmp_path: Path, far: float
) -> None:
    """Their positions have single precision where each part is, and differ where they are put."""
    middles = blob.vertices[blob.faces].mean(axis=1)
    part = (middles[:, 0] > 0) * (1 + (middles[:, 1] > 0))  # three meet in two places
    pivots = np.array([[0.013, 0.93, 0.004], [0, 1.52, 0.01], [0.3, 0.2, 0.1]]) + far
    thirds = [Mesh(blob.vertices + far, blob.faces[part == i]) for i in range(3)]
    mesh = export(tmp_path / "a.glb", *zip(thirds, pivots, strict=True))
    assert mesh.n_vertices > blob.n_vertices
    assert len(np.unique(mesh.vertices, axis=0)) == blob.n_vertices
    away = np.linalg.norm((mesh.vertices - far)[:, None] - blob.vertices, axis=2).min(axis=1)
    assert away.max() < 1e-6


def test_parts_beside_each_other_stay_apart(blob: Mesh, tmp_path: Path) -> None:
    origin, layer = np.zeros(3), Mesh(blob.vertices * 1.0005, blob.faces)
    sides = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    ground = Mesh(1e7 * np.vstack([sides, 1e-7 * sides]), [[0, 1, 2], [4, 5, 6]])
    mesh = export(tmp_path / "a.glb", (blob, origin), (layer, origin), (ground, origin))
    np.testing.assert_allclose(mesh.vertices[:642], blob.vertices, atol=1e-6)
    np.testing.assert_allclose(mesh.vertices[642:1284], layer.vertices, atol=1e-6)
    tiny = Mesh(1e-9 * blob.vertices + 1, blob.faces)  # in single precision, a few positions
    mesh = export(tmp_path / "a.glb", (tiny, origin), (tiny, origin + 1e-8))
    assert len(np.unique(mesh.vertices[:642], axis=0)) == len(
        np.unique(mesh.vertices[642:], axis=0)
    )


def test_colours_are_not_written_like_another_file(blob: Mesh, tmp_path: Path) -> None:
    write_mesh(tmp_path / "a.glb", blob)
    for extras in ({"colors": np.zeros((642, 3), int)}, {"uvs": np.zeros((642, 2))}):
        with pytest.raises(InputError, match="like keeps"):
            write_mesh(tmp_path / "b.glb", blob, like=tmp_path / "a.glb", **extras)
    with pytest.raises(FileError, match=r"a\.glb: has other vertices or faces than the mesh"):
        write_mesh(tmp_path / "b.glb", Mesh(blob.vertices, blob.faces[1:]), like=tmp_path / "a.glb")


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
    told = pytest.warns(UnbendWarning, match=r"a\.glb: 1 vertex without position: 0, 0, 0")
    with nullcontext() if points else told:
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
