"""Synthetic animals: closed surfaces, exact mirror maps, near-isometric poses."""

import numpy as np
import pytest

from unbend import diagnose
from unbend.datasets import (
    Shape,
    biped,
    make_biped,
    make_octopus,
    make_quadruped,
    octopus,
    quadruped,
    rest_map,
)
from unbend.errors import InputError

MAKERS = {make_quadruped: quadruped, make_biped: biped, make_octopus: octopus}
SPECIES = [(maker, name) for maker, module in MAKERS.items() for name in module._SPECIES]
POSES = [(maker, name) for maker, module in MAKERS.items() for name in module._POSES]


def edge_array(faces):
    return np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)


def edge_lengths(vertices, edges):
    return np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)


def signed_volume(vertices, faces):
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.einsum("fi,fi->", a, np.cross(b, c)) / 6


def min_angles(vertices, faces):
    corners = vertices[faces]
    angles = []
    for i in range(3):
        u, v = corners[:, i - 1] - corners[:, i], corners[:, i - 2] - corners[:, i]
        across = np.linalg.norm(np.cross(u, v), axis=1)
        angles.append(np.degrees(np.arctan2(across, np.einsum("fi,fi->f", u, v))))
    return np.min(angles, axis=0)


def assert_sphere_like(shape: Shape) -> None:
    """One closed, consistently oriented manifold without handles, facing outward."""
    found = diagnose(shape.mesh)
    assert (found.closed, found.genus, found.n_components) == (True, 0, 1)
    assert found.non_manifold_edges == found.non_manifold_vertices == 0
    assert found.inconsistent_edges == found.degenerate_faces == 0
    assert np.bincount(shape.mesh.faces.ravel(), minlength=shape.mesh.n_vertices).min() >= 3
    for vertices in (shape.rest, shape.mesh.vertices):
        assert signed_volume(vertices, shape.mesh.faces) > 0.01


@pytest.mark.parametrize(("maker", "species"), SPECIES)
def test_surface_is_closed_and_even(maker, species):
    shape = maker(species=species, n_vertices=500)
    assert shape.mesh.n_vertices == 500
    assert_sphere_like(shape)
    angles = min_angles(shape.rest, shape.mesh.faces)
    assert np.percentile(angles, 5) > 20
    assert angles.min() > 2


@pytest.mark.parametrize("maker", MAKERS)
def test_fine_meshes_and_odd_counts(maker):
    shape = maker(n_vertices=4001, meshing=3)
    assert shape.mesh.n_vertices == 4001
    assert_sphere_like(shape)
    assert np.percentile(min_angles(shape.rest, shape.mesh.faces), 1) > 25


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("meshing", [0, 5])
def test_mirror_is_an_exact_reflection(maker, meshing):
    shape = maker(n_vertices=500, meshing=meshing)
    mirror = shape.mirror
    np.testing.assert_array_equal(mirror[mirror], np.arange(500))
    np.testing.assert_allclose(shape.rest[mirror], shape.rest * [-1, 1, 1], atol=1e-12)
    reflected = {frozenset(face) for face in mirror[shape.mesh.faces].tolist()}
    assert reflected == {frozenset(face) for face in shape.mesh.faces.tolist()}
    names = np.array(shape.parts)
    swapped = [
        name.replace("left", "*").replace("right", "left").replace("*", "right")
        for name in names[shape.labels]
    ]
    assert np.mean(names[shape.labels][mirror] == swapped) > 0.99


@pytest.mark.parametrize(("maker", "pose"), POSES)
def test_poses_share_the_mesh_and_keep_lengths(maker, pose):
    shape = maker(pose, n_vertices=500)
    other = maker("standing", n_vertices=500)
    np.testing.assert_array_equal(shape.mesh.faces, other.mesh.faces)
    np.testing.assert_array_equal(shape.rest, other.rest)
    edges = edge_array(shape.mesh.faces)
    ratio = edge_lengths(shape.mesh.vertices, edges) / edge_lengths(shape.rest, edges)
    change = np.abs(np.log(ratio))
    assert np.median(change) < 0.04
    assert np.percentile(change, 95) < 0.22
    rest_volume = signed_volume(shape.rest, shape.mesh.faces)
    volume = signed_volume(shape.mesh.vertices, shape.mesh.faces)
    assert 0.87 < volume / rest_volume < 1.1


def test_meshings_differ_but_describe_one_surface():
    source = make_quadruped("walking", n_vertices=800)
    target = make_quadruped("walking", n_vertices=600, meshing=7)
    nearest = rest_map(source, target)
    edge = edge_lengths(target.rest, edge_array(target.mesh.faces)).mean()
    rest_gap = np.linalg.norm(source.rest - target.rest[nearest], axis=1)
    assert rest_gap.max() < 2 * edge
    assert np.median(rest_gap) > 0.1 * edge
    posed_gap = np.linalg.norm(source.mesh.vertices - target.mesh.vertices[nearest], axis=1)
    assert posed_gap.max() < 3 * edge
    assert rest_map(source, source).tolist() == list(range(800))


def test_same_arguments_same_shape():
    first = make_biped(None, n_vertices=500, random_state=4)
    from unbend.datasets.shape import _rest_body

    _rest_body.cache_clear()
    second = make_biped(None, n_vertices=500, random_state=4)
    np.testing.assert_array_equal(first.mesh.vertices, second.mesh.vertices)
    np.testing.assert_array_equal(first.mesh.faces, second.mesh.faces)
    third = make_biped(None, n_vertices=500, random_state=5)
    assert np.abs(first.mesh.vertices - third.mesh.vertices).max() > 0.05


def test_own_pose_and_proportions():
    shape = make_quadruped(
        {"neck": (20, 0, 0), "left_thigh": (-10, 0, 0)}, n_vertices=500, legs=1.3
    )
    plain = make_quadruped({}, n_vertices=500, legs=1.3)
    np.testing.assert_array_equal(plain.mesh.vertices, plain.rest)
    assert np.abs(shape.mesh.vertices - plain.mesh.vertices).max() > 0.02
    dog = make_quadruped(n_vertices=500)
    assert np.ptp(plain.rest[:, 1]) > 1.1 * np.ptp(dog.rest[:, 1])
    head = plain.labels == plain.parts.index("head")
    assert plain.rest[head, 2].mean() > 0.3
    assert not plain.rest.flags.writeable
    assert not plain.reference.flags.writeable


@pytest.mark.parametrize(("maker", "ends"), [(make_quadruped, "paw"), (make_octopus, "arm_4_9")])
def test_thin_limbs_keep_their_ends(maker, ends):
    shape = maker({}, n_vertices=500, limbs=0.37)
    for bone in shape.bones:
        if bone.name.endswith(ends):
            off = np.linalg.norm(shape.rest - bone.tail, axis=1).min()
            assert off < 2 * bone.tail_radius


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"pose": "flying"}, "galloping"),
        ({"pose": {"wing": (1, 2, 3)}}, "left_thigh"),
        ({"pose": {"neck": (1, 2)}}, "three finite numbers"),
        ({"pose": {"neck": (1, 2, np.nan)}}, "three finite numbers"),
        ({"species": "unicorn"}, "horse"),
        ({"wings": 2.0}, "muzzle"),
        ({"pose": ["neck"]}, "pose must be one of"),
        ({"pose": {"neck": "left"}}, "the angles of 'neck': needs real numbers"),
        ({"species": ["dog"]}, "species must be one of"),
        ({"legs": -1.0}, "above 0"),
        ({"legs": 1e9}, "at most 10"),
        ({"legs": "long"}, "legs must be above 0"),
        ({"body": 1.65, "girth": 0.37}, "touch or come off; choose milder ones"),
        ({"tail_lift": None}, "tail_lift must be above -180"),
        ({"n_vertices": 20}, "500"),
        ({"n_vertices": "600"}, "n_vertices must be a whole number from 500"),
        ({"n_vertices": 600.0}, "n_vertices must be a whole number from 500"),
        ({"meshing": -1}, "meshing must be a whole number of at least 0, not -1"),
        ({"pose": None, "random_state": 0.5}, "random_state must be a whole number"),
    ],
)
def test_unusable_arguments_are_named(arguments, message):
    with pytest.raises(InputError, match=message):
        make_quadruped(**arguments)


def test_whole_numbers_of_numpy_do_not_overflow():
    assert make_octopus(n_vertices=np.int16(30_000)).mesh.n_vertices > 29_000
