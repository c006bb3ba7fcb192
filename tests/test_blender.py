"""The Blender add-on, in Blender's own Python module; skipped where that is not installed."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from unbend import write_mesh
from unbend.datasets import make_quadruped
from unbend.mesh import vertex_normals
from unbend.report import match_colors

bpy = pytest.importorskip("bpy", reason="no Blender here: pip install bpy, for a Python it is for")

ROOT = Path(__file__).parents[1]
STANDING = make_quadruped("standing", n_vertices=1500)
WALKING = make_quadruped("walking", n_vertices=1200, meshing=1)


@pytest.fixture(scope="module")
def addon():
    path = ROOT / "integrations" / "blender" / "unbend_blender.py"
    spec = importlib.util.spec_from_file_location("unbend_blender", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    module.register()
    yield module
    module.unregister()


def make_object(name: str, mesh):
    data = bpy.data.meshes.new(name)
    data.from_pydata(mesh.vertices.tolist(), [], mesh.faces.tolist())
    made = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(made)
    return made


def uvs_of(made) -> np.ndarray:
    layer = made.data.uv_layers["atlas"]
    found = np.empty(2 * len(made.data.loops))
    layer.uv.foreach_get("vector", found)
    return found.reshape(-1, 3, 2)


def atlas(places: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Two islands: the left half of the body in one, the right in the other, moved by 2."""
    right = places[faces].mean(axis=1)[:, 0] < 0
    uvs = places[faces][:, :, 1:] / 4
    uvs[right, :, 0] += 2
    return uvs


@pytest.fixture(scope="module")
def scene(addon):
    """A dog with weights, an atlas and a shape key; and another, turned and larger, with none."""
    source = make_object("standing", STANDING.mesh)
    for part in range(STANDING.labels.max() + 1):
        group = source.vertex_groups.new(name=f"part {part}")
        group.add(np.flatnonzero(STANDING.labels == part).tolist(), 1.0, "REPLACE")
    layer = source.data.uv_layers.new(name="atlas")
    layer.uv.foreach_set("vector", atlas(STANDING.rest, STANDING.mesh.faces).ravel())
    source.shape_key_add(name="Basis")
    fat = source.shape_key_add(name="fat")
    normals = vertex_normals(STANDING.mesh.vertices, STANDING.mesh.faces)
    fat.data.foreach_set("co", (STANDING.mesh.vertices + 0.01 * normals).ravel())
    target = make_object("walking", WALKING.mesh)
    target.scale = (2, 2, 2)
    target.rotation_euler = (0.3, 0.2, 1.0)
    bpy.context.view_layer.update()
    for one in (source, target):
        one.select_set(True)
    bpy.context.view_layer.objects.active = source
    assert bpy.ops.object.unbend_carry() == {"FINISHED"}
    return source, target


def test_weights_go_to_the_same_parts(scene) -> None:
    _, target = scene
    weights = np.zeros((1200, len(target.vertex_groups)))
    for vertex in target.data.vertices:
        for one in vertex.groups:
            weights[vertex.index, one.group] = one.weight
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=0.01)
    names = [int(group.name.split()[1]) for group in target.vertex_groups]
    assert (np.array(names)[weights.argmax(axis=1)] == WALKING.labels).mean() > 0.95


def test_uvs_have_no_face_across_islands(scene) -> None:
    _, target = scene
    uvs, want = uvs_of(target), atlas(WALKING.rest, WALKING.mesh.faces)
    right = uvs[..., 0] > 1
    assert (right.all(axis=1) | ~right.any(axis=1)).all()
    same = right[:, 0] == (want[:, 0, 0] > 1)
    assert same.mean() > 0.95
    assert np.median(np.linalg.norm(uvs[same] - want[same], axis=2)) < 0.01


def test_a_shape_key_turns_with_the_surface(scene) -> None:
    _, target = scene
    keys = target.data.shape_keys.key_blocks
    assert [one.name for one in keys] == ["Basis", "fat"]
    places = np.empty((2, 3600))
    for one, key in zip(places, keys, strict=True):
        key.data.foreach_get("co", one)
    moved = (places[1] - places[0]).reshape(-1, 3)
    normals = vertex_normals(WALKING.mesh.vertices, WALKING.mesh.faces)
    lengths = np.linalg.norm(moved, axis=1)
    assert np.median((moved * normals).sum(axis=1) / lengths) > 0.97
    np.testing.assert_allclose(np.median(lengths), 0.01, rtol=0.1)


def test_what_is_asked_for_alone_is_carried(addon, scene) -> None:
    other = make_object("again", WALKING.mesh)
    addon.carry_between(scene[0], other, uvs=False, shape_keys=False)
    assert len(other.vertex_groups) == len(scene[0].vertex_groups)
    assert not other.data.uv_layers
    assert other.data.shape_keys is None


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb"])
def test_blender_sees_the_colours_that_we_write(tmp_path: Path, suffix: str) -> None:
    mesh = WALKING.mesh
    colors, _ = match_colors(mesh, mesh, np.arange(1200))
    path = str(tmp_path / f"a{suffix}")
    write_mesh(path, mesh, colors=colors)
    before = set(bpy.data.objects)
    if suffix == ".ply":
        bpy.ops.wm.ply_import(filepath=path)
    elif suffix == ".obj":
        bpy.ops.wm.obj_import(filepath=path)
    else:
        bpy.ops.import_scene.gltf(filepath=path)
    (data,) = (one.data for one in set(bpy.data.objects) - before if one.type == "MESH")
    attribute = data.color_attributes[0]
    seen = np.empty(4 * len(attribute.data))
    attribute.data.foreach_get("color_srgb", seen)
    seen = 255 * seen.reshape(-1, 4)[:, :3]
    where = np.arange(1200)
    if attribute.domain == "CORNER":
        where = np.empty(len(data.loops), dtype=np.int32)
        data.loops.foreach_get("vertex_index", where)
    np.testing.assert_allclose(seen, colors[where], atol=1)
