"""In-between shapes: exact ends, rigid motions kept rigid, limbs that do not shrink."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from animals import dog
from testshapes.scanning import add_components
from unbend import Match, Mesh
from unbend.correspondence import morph
from unbend.datasets import make_quadruped, make_sphere
from unbend.errors import InputError, UnbendWarning


def _edges(mesh: Mesh, vertices: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vertices[mesh.faces] - vertices[mesh.faces[:, [1, 2, 0]]], axis=2)


def _turn(degrees: float) -> np.ndarray:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


@pytest.mark.parametrize("side", [1, -1])
def test_the_ends_are_the_shapes(blob: Mesh, side: int) -> None:
    target = Mesh(blob.vertices[:, [1, 2, 0]] * [side, 2, 1] + 4, blob.faces)
    every = np.arange(blob.n_vertices)
    start, end = (morph(blob, target, every, t) for t in (0, 1))
    np.testing.assert_array_equal(start.vertices, blob.vertices)
    np.testing.assert_allclose(end.vertices, target.vertices, atol=1e-12)
    np.testing.assert_array_equal(end.faces, blob.faces)
    assert [one.name for one in (start, end)] == ["blob to target at 0", "blob to target at 1"]
    for near, t in ((blob, 1e-6), (target, 1 - 1e-6)):
        close = morph(blob, target, every, t).vertices
        np.testing.assert_allclose(close, near.vertices, atol=1e-4)


def test_a_rigid_motion_stays_rigid(blob: Mesh) -> None:
    moved = Mesh(blob.vertices @ _turn(120).T + [5, 0, 0], blob.faces)
    half = morph(blob, moved, np.arange(blob.n_vertices), 0.5)
    np.testing.assert_allclose(_edges(blob, half.vertices), _edges(blob, blob.vertices), rtol=1e-6)
    center = blob.vertices.mean(axis=0)
    expected = (blob.vertices - center) @ _turn(60).T + (center + moved.vertices.mean(axis=0)) / 2
    np.testing.assert_allclose(half.vertices, expected, atol=1e-6)


def test_limbs_swing_instead_of_shrinking() -> None:
    # Two poses of one mesh have the same edges; so should what lies between them.
    source = make_quadruped("galloping", n_vertices=1000).mesh
    target = make_quadruped("sitting", n_vertices=1000).mesh
    half = morph(source, target, np.arange(1000), 0.5).vertices
    length = (_edges(source, source.vertices) + _edges(source, target.vertices)) / 2
    ours = np.abs(_edges(source, half) / length - 1)
    line = np.abs(_edges(source, (source.vertices + target.vertices) / 2) / length - 1)
    assert ours.mean() < 0.05
    assert ours.mean() < line.mean() / 4
    assert ours.max() < line.max()


@pytest.mark.parametrize("t", [0.5, 1, 1.5])
def test_joints_stay_in_the_middle_of_what_bends_around_them(t: float) -> None:
    source, target = (dog(pose, n_vertices=1000) for pose in ("standing", "galloping"))
    around = cKDTree(source.mesh.vertices).query([bone.head for bone in source.bones], 40)[1]
    joints = source.mesh.vertices[around].mean(axis=1)
    rigged = Mesh(np.vstack([source.mesh.vertices, joints]), source.mesh.faces)
    images = np.append(np.arange(1000), np.full(len(joints), -1))
    found = morph(rigged, target.mesh, images, t).vertices
    off = np.linalg.norm(found[1000:] - found[around].mean(axis=1), axis=1)
    assert off.max() < _edges(source.mesh, source.mesh.vertices).mean()


def test_vertices_without_an_image_go_along(blob: Mesh) -> None:
    vertices = np.vstack([blob.vertices, [[9, 9, 9], [np.nan] * 3]])
    source = Mesh(vertices, blob.faces)
    every = np.append(np.arange(blob.n_vertices), [-1, -1])
    target = Mesh(blob.vertices + np.array([0, 0, 8]), blob.faces)
    for t in (0.5, 1):
        found = morph(source, target, every, t)
        np.testing.assert_allclose(found.vertices[-2], [9, 9, 9 + 8 * t], atol=1e-6)
        assert np.isnan(found.vertices[-1]).all()


def test_a_component_without_an_image_turns_with_the_whole(blob: Mesh) -> None:
    n = blob.n_vertices
    points = np.vstack([blob.vertices, 0.2 * blob.vertices + [0, 4, 0]])
    source = Mesh(points, np.vstack([blob.faces, blob.faces + n]))
    goal = points @ _turn(70).T + [1, 2, 3]
    every = np.where(np.arange(2 * n) < n, np.arange(2 * n), -1)
    laid = morph(source, Mesh(goal[:n], blob.faces), every, 1)
    np.testing.assert_allclose(laid.vertices, goal, atol=1e-6)


@pytest.mark.parametrize("scale", [0.001, 1, 1000])
def test_a_component_without_an_image_stays_beside_the_rest_in_any_unit(
    blob: Mesh, scale: float
) -> None:
    n, tip = blob.n_vertices, int(blob.vertices[:, 0].argmax())
    speck = make_sphere(0).vertices * 0.02 + blob.vertices[tip]
    both = Mesh(
        np.vstack([blob.vertices, speck, speck[:1]]),  # the last is in no face
        np.vstack([blob.faces, make_sphere(0).faces + n]),
    )
    images = np.append(np.arange(n), np.full(13, -1))
    found = morph(both, (scale * blob.vertices, blob.faces), images, 1).vertices
    np.testing.assert_allclose(found, scale * both.vertices, atol=1e-4 * scale)


def test_an_unused_vertex_holds_no_component() -> None:
    """A ball in a body, nearer the origin than the body's surface is, stays in its middle."""
    ball = make_sphere(2)
    body, inside = ball.vertices * [3, 1, 1], 0.2 * ball.vertices + [0.5, 0, 0]
    n, turn = len(body), _turn(40)
    places = np.vstack([body, inside, [[100, 100, 100]]])
    whole = Mesh(places, np.vstack([ball.faces, ball.faces + n]))
    images = np.append(np.arange(n), np.full(n + 1, -1))
    bare = Mesh(places[:-1], whole.faces)
    stretched = (body * [1.5, 1, 1]) @ turn.T + 10, ball.faces
    expected = morph(bare, stretched, images[:-1], 1).vertices
    found = morph(whole, stretched, images, 1).vertices[:-1]
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("t", [0.5, 1])
def test_smaller_components_of_a_match_keep_their_form_beside_what_is_nearest(t: float) -> None:
    body, pose = (make_quadruped(one, n_vertices=1000).mesh for one in ("standing", "galloping"))
    whole = add_components(body, eyeballs=2, cloth=0, random_state=0)
    matched = Match(whole.origin, np.arange(1000), np.eye(1), 1.0, 1.0)
    alone = morph(body, pose, np.arange(1000), t).vertices
    found = morph(whole.mesh, pose, matched, t).vertices
    np.testing.assert_allclose(found[:1000], alone, atol=3e-3)
    for eye in (np.arange(1000, 1042), np.arange(1042, 1084)):
        before = whole.mesh.vertices[eye]
        middle = int(np.linalg.norm(body.vertices - before.mean(axis=0), axis=1).argmin())
        radius = np.linalg.norm(before - body.vertices[middle], axis=1).mean()
        radii = np.linalg.norm(found[eye] - found[eye].mean(axis=0), axis=1)
        np.testing.assert_allclose(radii, radius, rtol=0.3)
        assert np.linalg.norm(found[eye].mean(axis=0) - found[middle]) < 0.5 * radius


def test_shapes_in_different_units_are_told(blob: Mesh) -> None:
    large = Mesh(1000 * blob.vertices, blob.faces, name="mm.obj")
    smaller = Mesh(9 * blob.vertices, blob.faces, name="mm.obj")  # where the other is in cm
    every = np.arange(blob.n_vertices)
    for pair, times in (((blob, large), "1,000"), ((large, blob), "1,000"), ((blob, smaller), 9)):
        with pytest.warns(UnbendWarning, match=rf"mm\.obj is {times} times as large as"):
            morph(*pair, every, 0.5)
        morph(*pair, every, 1)
    stray = Mesh(np.vstack([blob.vertices, [[99, 9, 9]]]), blob.faces, name="stray")
    morph(blob, stray, every, 0.5)


def test_points_go_straight() -> None:
    source = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    for n in (3, 4):
        for t in (0.5, 2):
            found = morph(source[:n], source[:n] * 2, np.arange(n), t)
            np.testing.assert_allclose(found.vertices, source[:n] * (1 + t), atol=1e-12)


def test_what_does_not_fit(blob: Mesh) -> None:
    every = np.arange(blob.n_vertices)
    for mapping, t, sentence in (
        (every, np.nan, "t must be"),
        (every[:-1], 0.5, "the map has 641 source vertices"),
        (np.full_like(every, -1), 0.5, "fewer than 3"),
        (every + 1, 0.5, "names target vertex 642"),
    ):
        with pytest.raises(InputError, match=sentence):
            morph(blob, blob, mapping, t)


def test_a_part_without_an_image_goes_along_with_its_neighbours() -> None:
    # A rod, bent at its far end; what is known of it is the middle and the near end only.
    ball = make_sphere(3)
    rod = Mesh(ball.vertices * [3, 0.4, 0.4], ball.faces)
    turned = Mesh(2 * rod.vertices @ _turn(70).T + [1, 2, 3], rod.faces)
    point_map = np.where(rod.vertices[:, 0] < 1, np.arange(rod.n_vertices), -1)
    laid = morph(rod, turned, point_map, 1)
    np.testing.assert_allclose(laid.vertices, turned.vertices, atol=1e-3)
    # Scattered images say as much, whether an edge joins two of them or none.
    every = np.arange(rod.n_vertices)
    for known in (every < 12, every % 160 == 0):
        laid = morph(rod, turned, np.where(known, every, -1), 1)
        np.testing.assert_allclose(laid.vertices, turned.vertices, atol=2e-3)
    # Where the rest is bent, it keeps its shape and its joint.
    source = make_quadruped("galloping", n_vertices=1000)
    target = make_quadruped("sitting", n_vertices=1000).mesh
    lost = source.labels == source.parts.index("left_hindleg")
    point_map = np.where(lost, -1, np.arange(1000))
    laid = morph(source.mesh, target, point_map, 1)
    ratio = _edges(source.mesh, laid.vertices) / _edges(source.mesh, source.mesh.vertices)
    at_leg = lost[source.mesh.faces].any(axis=1)
    assert abs(np.median(ratio[at_leg]) - 1) < 0.05
    assert (np.abs(ratio[at_leg] - 1) < 0.5).mean() > 0.97
    small = [(one.vertices / 1024, one.faces) for one in (source.mesh, target)]  # the same in km
    found = morph(*small, point_map, 1)
    np.testing.assert_allclose(1024 * found.vertices, laid.vertices, atol=1e-9)
