"""The Blender extension, in Blender's own Python module; skipped where that is not installed."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from unbend import Mesh, write_mesh
from unbend.datasets import make_quadruped, make_sphere
from unbend.errors import UnbendWarning
from unbend.mesh import vertex_normals
from unbend.report import match_colors

bpy = pytest.importorskip("bpy", reason="no Blender here: pip install bpy, for a Python it is for")

import bmesh  # noqa: E402 (part of bpy)
from mathutils import Vector  # noqa: E402 (part of bpy)


@cache
def standing():
    return make_quadruped("standing", n_vertices=1500)


@cache
def walking():
    return make_quadruped("walking", n_vertices=1200, meshing=1)


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
    source = make_object("standing", standing().mesh)
    for part in range(standing().labels.max() + 1):
        group = source.vertex_groups.new(name=f"part {part}")
        group.add(np.flatnonzero(standing().labels == part).tolist(), 1.0, "REPLACE")
    layer = source.data.uv_layers.new(name="atlas")
    layer.uv.foreach_set("vector", atlas(standing().rest, standing().mesh.faces).ravel())
    source.shape_key_add(name="Basis")
    fat = source.shape_key_add(name="fat")
    normals = vertex_normals(standing().mesh.vertices, standing().mesh.faces)
    fat.data.foreach_set("co", (standing().mesh.vertices + 0.01 * normals).ravel())
    points = source.data.color_attributes.new("soft", "FLOAT_COLOR", "POINT")
    ramp = np.column_stack([(standing().rest + 1) / 4, np.ones(1500)])
    points.data.foreach_set("color", ramp.ravel())
    corners = source.data.color_attributes.new("halves", "BYTE_COLOR", "CORNER")
    right = standing().rest[standing().mesh.faces].mean(axis=1)[:, 0] < 0
    corners.data.foreach_set("color", np.repeat(_half_colors(right), 3, axis=0).ravel())
    target = make_object("walking", walking().mesh)
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
    assert (np.array(names)[weights.argmax(axis=1)] == walking().labels).mean() > 0.95


def test_uvs_have_no_face_across_islands(scene) -> None:
    _, target = scene
    uvs, want = uvs_of(target), atlas(walking().rest, walking().mesh.faces)
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
    normals = vertex_normals(walking().mesh.vertices, walking().mesh.faces)
    lengths = np.linalg.norm(moved, axis=1)
    assert np.median((moved * normals).sum(axis=1) / lengths) > 0.97
    np.testing.assert_allclose(np.median(lengths), 0.01, rtol=0.1)


def test_colours_go_to_the_same_places(scene) -> None:
    _, target = scene
    soft = values_of(target.data.color_attributes["soft"].data, "color", 4)
    assert np.median(np.abs(soft[:, :3] - (walking().rest + 1) / 4)) < 0.01
    halves = target.data.color_attributes["halves"]
    assert (halves.domain, halves.data_type) == ("CORNER", "BYTE_COLOR")
    seen = values_of(halves.data, "color", 4).reshape(-1, 3, 4)
    right = walking().rest[walking().mesh.faces].mean(axis=1)[:, 0] < 0
    wrong = np.abs(seen - _half_colors(right)[:, None]).max(axis=(1, 2)) > 0.1
    assert wrong.mean() < 0.08


def test_only_what_is_asked_for_is_transferred(scene) -> None:
    other = make_object("again", walking().mesh)
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
    assert (standing().labels[partners] == walking().labels).mean() > 0.95
    ours, theirs = (
        values_of(one.data.color_attributes["unbend_match"].data, "color_srgb", 4)
        for one in (source, target)
    )
    assert np.median(np.abs(ours[partners] - theirs)) < 0.05
    np.testing.assert_array_equal(values_of(target.data.vertices, "co", 3), before)


def test_landmarks_are_vertex_groups_and_are_not_transferred(extension) -> None:
    thing = make_object("marked", walking().mesh)
    group = thing.vertex_groups.new(name="landmark nose")
    group.add([3], 0.5, "REPLACE")
    group.add([7], 0.9, "REPLACE")
    thing.vertex_groups.new(name="landmark of nothing")
    assert extension.carry.landmarks(thing) == {"landmark nose": 7}
    other = make_object("unmarked", walking().mesh)
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
    empty = make_object("flat", walking().mesh)
    empty.scale = (1, 0, 1)
    good = make_object("good", walking().mesh)
    select(scene[0], good, empty)
    with pytest.raises(RuntimeError, match="its scale is zero along an axis"):
        bpy.ops.object.unbend_transfer()
    assert not good.vertex_groups
    select(scene[0])
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.object.unbend_match()


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb"])
def test_blender_sees_the_colours_that_we_write(tmp_path: Path, suffix: str) -> None:
    mesh = walking().mesh
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


@pytest.fixture
def dogs():
    """Two small dogs of one body, the standing one with a vertex group for each part."""
    found = [make_quadruped(pose, n_vertices=600) for pose in ("standing", "walking")]
    source, target = (make_object(one.mesh.name, one.mesh) for one in found)
    for part in range(found[0].labels.max() + 1):
        group = source.vertex_groups.new(name=f"part {part}")
        group.add(np.flatnonzero(found[0].labels == part).tolist(), 1.0, "REPLACE")
    return source, target, found[0]


def parts_of(thing) -> np.ndarray:
    weights = np.zeros((len(thing.data.vertices), len(thing.vertex_groups)))
    for vertex in thing.data.vertices:
        for one in vertex.groups:
            weights[vertex.index, one.group] = one.weight
    numbers = np.array([int(group.name.split()[1]) for group in thing.vertex_groups])
    return numbers[weights.argmax(axis=1)]


def test_what_an_import_cut_along_seams_is_matched_as_a_whole(dogs) -> None:
    source, _, shape = dogs
    faces, places = shape.mesh.faces, shape.mesh.vertices
    right = places[faces].mean(axis=1)[:, 0] < 0
    halves = [np.unique(faces[side]) for side in (right, ~right)]
    order = np.concatenate(halves)
    cut = np.concatenate(
        [
            np.searchsorted(half, faces[side]) + start
            for half, side, start in zip(halves, (right, ~right), (0, len(halves[0])), strict=True)
        ]
    )
    assert len(order) > 600
    target = make_object("imported", Mesh(places[order], cut))
    select(source, target)
    bpy.ops.object.unbend_transfer()
    np.testing.assert_array_equal(parts_of(target), shape.labels[order])
    bpy.ops.object.unbend_match()
    partners = values_of(target.data.attributes["unbend_partner"].data, "value")
    np.testing.assert_array_equal(partners, order)
    select(target)
    assert bpy.ops.object.unbend_canonical() == {"FINISHED"}


def test_a_sheared_template_lies_on_the_scan(dogs) -> None:
    source, target, _ = dogs
    parent = bpy.data.objects.new("parent", None)
    bpy.context.collection.objects.link(parent)
    parent.scale, source.parent, source.rotation_euler = (1, 3, 1), parent, (0.6, 0.3, 0.8)
    select(source, target)
    bpy.ops.object.unbend_register()
    made = bpy.data.objects[f"{source.name} on {target.name}"]
    bpy.context.view_layer.update()
    for place in values_of(made.data.vertices, "co", 3)[::40]:
        there = target.matrix_world.inverted() @ made.matrix_world @ Vector(place)
        assert (target.closest_point_on_mesh(there)[1] - there).length < 0.02


def test_each_place_that_any_of_the_others_has_is_painted(dogs) -> None:
    source, target, shape = dogs
    back = shape.mesh.vertices[shape.mesh.faces].mean(axis=1)
    front = make_object(
        "front", Mesh(shape.mesh.vertices, shape.mesh.faces[back[:, 2] > np.median(back[:, 2])])
    )
    select(source, target, front)
    bpy.ops.object.unbend_match()
    ours, theirs = (
        values_of(one.data.color_attributes["unbend_match"].data, "color_srgb", 4)
        for one in (source, target)
    )
    partners = values_of(target.data.attributes["unbend_partner"].data, "value")
    assert np.quantile(np.abs(ours[partners] - theirs).max(axis=1), 0.95) < 0.1


def test_what_a_target_cannot_take_is_refused_before_anything_changes(dogs) -> None:
    source, target, _ = dogs
    for i in range(8):
        target.data.uv_layers.new(name=f"map {i}")
    source.data.uv_layers.new(name="atlas")
    select(source, target)
    with pytest.raises(RuntimeError, match="it would have 9 UV maps"):
        bpy.ops.object.unbend_transfer()
    assert not target.vertex_groups
    twin = bpy.data.objects.new("twin", source.data)
    bpy.context.collection.objects.link(twin)
    select(source, twin)
    with pytest.raises(RuntimeError, match="share one mesh"):
        bpy.ops.object.unbend_transfer()
    assert source.vertex_groups
    source.shape_key_add(name="Basis")
    dots = make_object("dots", Mesh(make_quadruped("walking", n_vertices=4000).mesh.vertices))
    select(source, dots)
    with pytest.raises(RuntimeError, match="which shape keys need"):
        bpy.ops.object.unbend_transfer()


def test_what_is_linked_is_refused(dogs, tmp_path: Path) -> None:
    source, target, _ = dogs
    file, name = str(tmp_path / "library.blend"), target.name
    bpy.data.libraries.write(file, {target})
    bpy.data.objects.remove(target)
    with bpy.data.libraries.load(file, link=True) as (_, wanted):
        wanted.objects = [name]
    (linked,) = wanted.objects
    bpy.context.collection.objects.link(linked)
    select(source, linked)
    for operator in (bpy.ops.object.unbend_transfer, bpy.ops.object.unbend_match):
        with pytest.raises(RuntimeError, match="its mesh is linked from a library"):
            operator()


def test_shape_keys_leave_the_rest_shape_and_keep_their_settings(dogs) -> None:
    source, target, _ = dogs
    for name in ("Basis", "fat"):
        source.shape_key_add(name=name)
    fat = source.data.shape_keys.key_blocks["fat"]
    fat.data.foreach_set("co", 1.1 * values_of(source.data.vertices, "co", 3).ravel())
    fat.slider_max, fat.slider_min, fat.mute = 3, 2, True
    rest = target.shape_key_add(name="fat")
    before = values_of(rest.data, "co", 3)
    select(source, target)
    bpy.ops.object.unbend_transfer()
    first, second = target.data.shape_keys.key_blocks
    np.testing.assert_array_equal(values_of(first.data, "co", 3), before)
    assert (second.slider_min, second.slider_max, second.mute) == (2, 3, True)
    assert second.relative_key == first


def test_groups_keep_their_lock_and_weights_without_a_group_are_nobodys(dogs) -> None:
    source, target, _ = dogs
    for name in ("own", "part 0"):
        target.vertex_groups.new(name=name)
    target.vertex_groups["part 0"].lock_weight = True
    select(source, target)
    bpy.ops.object.unbend_transfer()
    assert [group.name for group in target.vertex_groups][:2] == ["own", "part 0"]
    assert target.vertex_groups["part 0"].lock_weight
    form = bmesh.new()
    form.from_mesh(source.data)
    form.to_mesh(bpy.data.meshes.new("copy"))
    lone = bpy.data.objects.new("lone", bpy.data.meshes["copy"])
    bpy.context.collection.objects.link(lone)
    assert lone.data.vertices[0].groups
    select(lone, target)
    assert bpy.ops.object.unbend_transfer() == {"FINISHED"}


def test_a_wrong_landmark_is_named_each_time(dogs, extension) -> None:
    source, target, shape = dogs
    far = np.argsort(shape.mesh.vertices[:, 2])
    places = {"a": (far[0],) * 2, "b": (far[-1],) * 2, "c": (far[300],) * 2, "d": (far[5], far[-5])}
    for name, pair in places.items():
        for one, vertex in zip((source, target), pair, strict=True):
            one.vertex_groups.new(name=f"landmark {name}").add([int(vertex)], 1.0, "REPLACE")
    for _ in range(2):
        with pytest.warns(UnbendWarning, match="^landmark 'landmark d' at vertices .* is ignored"):
            extension.find_match(source, target)
