"""The Blender extension, in Blender's own Python module; skipped where that is not installed."""

from pathlib import Path

import numpy as np
import pytest

from unbend import Mesh, write_mesh
from unbend.datasets import make_quadruped, make_sphere
from unbend.mesh import vertex_normals
from unbend.report import match_colors

bpy = pytest.importorskip("bpy", reason="no Blender here: pip install bpy, for a Python it is for")

from mathutils import Vector  # noqa: E402 (part of bpy)

STANDING = make_quadruped("standing", n_vertices=1500)
WALKING = make_quadruped("walking", n_vertices=1200, meshing=1)


@pytest.fixture(scope="module", autouse=True)
def extension():
    import blender

    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender.register()
    yield blender
    blender.unregister()


def select(active, *others) -> None:
    bpy.context.view_layer.update()
    for one in bpy.data.objects:
        one.select_set(one in (active, *others))
    bpy.context.view_layer.objects.active = active


def values_of(items, field: str, width: int = 1) -> np.ndarray:
    found = np.empty(width * len(items), dtype=np.int32 if field == "value" else np.float64)
    items.foreach_get(field, found)
    return found.reshape(-1, width) if width > 1 else found


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


def _half_colors(right: np.ndarray) -> np.ndarray:
    return np.where(right[:, None], (1.0, 0, 0, 1), (0, 0, 1.0, 1))


@pytest.fixture(scope="module")
def scene(extension):
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
    points = source.data.color_attributes.new("soft", "FLOAT_COLOR", "POINT")
    ramp = np.column_stack([(STANDING.rest + 1) / 4, np.ones(1500)])
    points.data.foreach_set("color", ramp.ravel())
    corners = source.data.color_attributes.new("halves", "BYTE_COLOR", "CORNER")
    right = STANDING.rest[STANDING.mesh.faces].mean(axis=1)[:, 0] < 0
    corners.data.foreach_set("color", np.repeat(_half_colors(right), 3, axis=0).ravel())
    target = make_object("walking", WALKING.mesh)
    target.scale = (2, 2, 2)
    target.rotation_euler = (0.3, 0.2, 1.0)
    select(source, target)
    assert bpy.ops.object.unbend_transfer() == {"FINISHED"}
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


def test_colours_go_to_the_same_places(scene) -> None:
    _, target = scene
    soft = values_of(target.data.color_attributes["soft"].data, "color", 4)
    assert np.median(np.abs(soft[:, :3] - (WALKING.rest + 1) / 4)) < 0.01
    halves = target.data.color_attributes["halves"]
    assert (halves.domain, halves.data_type) == ("CORNER", "BYTE_COLOR")
    seen = values_of(halves.data, "color", 4).reshape(-1, 3, 4)
    right = WALKING.rest[WALKING.mesh.faces].mean(axis=1)[:, 0] < 0
    wrong = np.abs(seen - _half_colors(right)[:, None]).max(axis=(1, 2)) > 0.1
    assert wrong.mean() < 0.08


def test_only_what_is_asked_for_is_transferred(scene) -> None:
    other = make_object("again", WALKING.mesh)
    select(scene[0], other)
    bpy.ops.object.unbend_transfer(uvs=False, shape_keys=False, colors=False)
    assert len(other.vertex_groups) == len(scene[0].vertex_groups)
    assert not other.data.uv_layers
    assert not other.data.color_attributes
    assert other.data.shape_keys is None


def test_a_match_is_stored_and_painted(scene) -> None:
    source, target = scene
    before = values_of(target.data.vertices, "co", 3)
    select(source, target)
    bpy.ops.object.unbend_match()
    partners = values_of(target.data.attributes["unbend_partner"].data, "value")
    assert (partners >= 0).all()
    assert (STANDING.labels[partners] == WALKING.labels).mean() > 0.95
    ours, theirs = (
        values_of(one.data.color_attributes["unbend_match"].data, "color_srgb", 4)
        for one in (source, target)
    )
    assert np.median(np.abs(ours[partners] - theirs)) < 0.05
    np.testing.assert_array_equal(values_of(target.data.vertices, "co", 3), before)


def test_landmarks_are_vertex_groups_and_are_not_transferred(extension) -> None:
    thing = make_object("marked", WALKING.mesh)
    group = thing.vertex_groups.new(name="landmark nose")
    group.add([3], 0.5, "REPLACE")
    group.add([7], 0.9, "REPLACE")
    thing.vertex_groups.new(name="landmark of nothing")
    assert extension.carry.landmarks(thing) == {"landmark nose": 7}
    other = make_object("unmarked", WALKING.mesh)
    extension.carry.carry_vertex_groups(thing, other, lambda weights: weights)
    assert not other.vertex_groups


def test_a_template_keeps_its_quads_and_lies_on_the_scan() -> None:
    cube = Mesh(
        np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).T.reshape(-1, 3) / 1.0, [[0, 1, 2]]
    )
    data = bpy.data.meshes.new("cube")
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    data.from_pydata(cube.vertices.tolist(), [], quads)
    template = bpy.data.objects.new("template", data)
    bpy.context.collection.objects.link(template)
    template.scale = (1.0, 1.2, 0.7)
    select(template)
    modifier = template.modifiers.new("smooth", "SUBSURF")
    modifier.levels = 3
    bpy.ops.object.modifier_apply(modifier="smooth")
    ball = make_sphere(3)
    scan = make_object("scan", Mesh(ball.vertices * [1.0, 1.2, 0.7], ball.faces))
    scan.location, scan.scale = (5, 0, 0), (2, -2, 2)  # mirrored: still not inside out
    select(template, scan)
    before = values_of(template.data.vertices, "co", 3)
    bpy.ops.object.unbend_register()
    made = bpy.data.objects["template on scan"]
    assert {len(polygon.vertices) for polygon in made.data.polygons} == {4}
    places = values_of(made.data.vertices, "co", 3) * template.scale - (5, 0, 0)
    np.testing.assert_allclose(np.linalg.norm(places / [2, 2.4, 1.4], axis=1), 1, atol=0.03)
    np.testing.assert_array_equal(values_of(template.data.vertices, "co", 3), before)


def test_a_registered_copy_keeps_the_groups_but_no_shape_keys(scene) -> None:
    source, target = scene
    select(source, target)
    bpy.ops.object.unbend_register()
    made = bpy.data.objects["standing on walking"]
    assert made.vertex_groups.keys() == source.vertex_groups.keys()
    assert made.data.shape_keys is None
    assert len(source.data.shape_keys.key_blocks) == 2
    places = values_of(made.data.vertices, "co", 3)
    for place in places[::50]:
        there = target.matrix_world.inverted() @ made.matrix_world @ Vector(place)
        near = target.closest_point_on_mesh(there)[1]
        assert (near - there).length < 0.01


def test_canonical_forms_of_two_poses_agree(scene) -> None:
    things = [
        make_object(pose, make_quadruped(pose, n_vertices=800).mesh)
        for pose in ("standing", "walking")
    ]
    things[1].scale = (1, 1, -1)
    select(*things)
    assert bpy.ops.object.unbend_canonical() == {"FINISHED"}
    spans = []
    for thing in things:
        basis, form = thing.data.shape_keys.key_blocks
        assert (basis.name, form.name, form.value) == ("Basis", "canonical", 1)
        points = values_of(form.data, "co", 3)
        picked = points[::10] / np.linalg.norm(points - points.mean(axis=0))
        spans.append(np.linalg.norm(picked[:, None] - picked[None], axis=2))
    assert np.abs(spans[0] - spans[1]).max() < 0.1 * spans[0].max()


def test_errors_are_sentences_and_change_nothing(scene) -> None:
    empty = make_object("flat", WALKING.mesh)
    empty.scale = (1, 0, 1)
    good = make_object("good", WALKING.mesh)
    select(scene[0], good, empty)
    with pytest.raises(RuntimeError, match="its scale is zero along an axis"):
        bpy.ops.object.unbend_transfer()
    assert not good.vertex_groups
    select(scene[0])
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.object.unbend_match()


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
