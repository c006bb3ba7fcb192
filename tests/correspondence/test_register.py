"""A template laid onto a scan: exact on itself, on the surface elsewhere, smooth over holes."""

import functools

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from animals import dog
from testshapes.damage import cut_discs, damaged_truth
from testshapes.scanning import add_components, sample_points, seen_from
from unbend import Match, Mesh, morph, register
from unbend._types import IntArray
from unbend.datasets import make_quadruped, make_sphere, rest_map
from unbend.deformation import closest_faces
from unbend.errors import InputError, MeshError, UnbendWarning
from unbend.mesh import vertex_areas

# Vertices of a template, and of a scan of another pose.
N, M = 1000, 1200
EVERY = np.arange(N)


_template = functools.partial(dog, "standing", n_vertices=N)
_posed = functools.partial(dog, "galloping", n_vertices=N)  # another pose of the same mesh
_scan = functools.partial(dog, "galloping", n_vertices=M, meshing=1)  # that pose meshed anew


@functools.cache
def _truth() -> IntArray:
    """Where the template's vertices belong on the scan."""
    return rest_map(_template(), _scan())


def mean_edge(mesh: Mesh) -> float:
    sides = mesh.vertices[mesh.faces] - mesh.vertices[mesh.faces[:, [1, 2, 0]]]
    return float(np.linalg.norm(sides, axis=2).mean())


def errors(found, truth) -> np.ndarray:
    """Distances of vertices to where they belong, in mean edges."""
    return np.linalg.norm(found.mesh.vertices - truth, axis=1) / mean_edge(found.mesh)


def normals(vertices: np.ndarray) -> np.ndarray:
    a, b, c = vertices[_template().mesh.faces].transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def distance_to_faces(points: np.ndarray, mesh: Mesh) -> np.ndarray:
    """To the closest of many points on all faces: an upper bound, and a fine one."""
    shares = np.random.default_rng(0).dirichlet(np.ones(3), 40)
    samples = (shares @ mesh.vertices[mesh.faces]).reshape(-1, 3)
    return np.array([np.linalg.norm(samples - point, axis=1).min() for point in points])


@pytest.fixture(scope="module")
def fitted():
    return register(_template().mesh, _scan().mesh, _truth())


def test_onto_a_copy_it_is_that_copy() -> None:
    turn = Rotation.from_rotvec([1, 2, 0.5]).as_matrix()
    template = _template().mesh
    copy = Mesh(70 * template.vertices @ turn.T + [300, -4, 5], template.faces)
    found = register(_template().mesh, copy, EVERY)
    assert errors(found, copy.vertices).max() < 1e-6
    assert found.coverage == 1
    assert found.distances.max() < 1e-6 * mean_edge(copy)
    assert found.tolerance == pytest.approx(0.1 * mean_edge(copy))
    np.testing.assert_array_equal(found.mesh.faces, _template().mesh.faces)


def test_another_pose_and_meshing_is_met_on_its_faces(fitted) -> None:
    edge = mean_edge(fitted.mesh)
    assert fitted.distances.max() < 0.01 * edge
    assert fitted.coverage == 1
    assert np.isnan(fitted.confidence)
    # The distances are what they say, by another route; the samples lie within a face apart.
    some = EVERY[::20]
    assert distance_to_faces(fitted.mesh.vertices[some], _scan().mesh).max() < 0.3 * edge
    assert errors(fitted, _posed().mesh.vertices).mean() < 0.2
    # The nearest vertices are much farther from the truth than points on faces.
    rounded = np.linalg.norm(_scan().mesh.vertices[_truth()] - _posed().mesh.vertices, axis=1)
    assert errors(fitted, _posed().mesh.vertices).mean() < 0.5 * rounded.mean() / edge
    assert ((normals(fitted.mesh.vertices) * normals(_posed().mesh.vertices)).sum(axis=1) > 0).all()


def test_a_match_is_found_where_none_is_given() -> None:
    stages = []
    found = register(
        _template().mesh, _scan().mesh, progress=lambda stage, share: stages.append(stage)
    )
    assert found.confidence > 0.5
    assert errors(found, _posed().mesh.vertices).mean() < 0.3
    assert found.distances.max() < 0.01 * mean_edge(found.mesh)
    assert {"register", "spectrum"} <= set(stages)
    assert "on the scan, confidence" in repr(found)


def test_another_body_is_met_too() -> None:
    body = make_quadruped("walking", species="horse", n_vertices=M, meshing=2)
    truth = rest_map(_template(), body)
    found = register(_template().mesh, (9 * body.mesh.vertices, body.mesh.faces), truth)
    assert found.coverage > 0.99
    assert np.quantile(found.distances, 0.95) < 0.01 * mean_edge(found.mesh)
    assert errors(found, 9 * body.mesh.vertices[truth]).mean() < 0.6


@pytest.mark.parametrize("known", [True, False])
def test_over_holes_it_goes_on_smoothly(known: bool) -> None:
    torn = cut_discs(_scan().mesh, 0.15, 3, random_state=0)
    left = damaged_truth(_truth(), target=torn)
    gone = left < 0
    if not known:  # everything has a partner, what has none the nearest vertex at the rim
        places = torn.mesh.vertices
        apart = np.linalg.norm(places[:, None] - _scan().mesh.vertices[_truth()[gone]], axis=2)
        left[gone] = apart.argmin(axis=0)
    found = register(_template().mesh, torn.mesh, left)
    assert 0.8 < found.coverage < 0.9
    assert (found.covered == ~gone).mean() > 0.95
    assert found.distances[found.covered].max() <= found.tolerance
    away = np.flatnonzero(~found.covered)[::4]
    by_samples = distance_to_faces(found.mesh.vertices[away], torn.mesh)
    np.testing.assert_allclose(found.distances[away], by_samples, atol=0.2 * mean_edge(torn.mesh))
    assert ((normals(found.mesh.vertices) * normals(_posed().mesh.vertices)).sum(axis=1) > 0).all()
    off = errors(found, _posed().mesh.vertices)
    assert off[found.covered].mean() < 0.2
    assert off[~found.covered].mean() < 0.3


def test_what_a_camera_did_not_see_keeps_its_shape() -> None:
    seen = seen_from(_scan().mesh, np.array([1, 0.3, 0.2]))
    left = damaged_truth(_truth(), target=seen)
    found = register(_template().mesh, seen.mesh, left)
    assert not found.covered[left < 0].sum() > 0.1 * (left < 0).sum()
    assert found.covered[left >= 0].mean() > 0.8
    vertices = found.mesh.vertices
    areas = np.linalg.norm(normals(vertices), axis=1)
    ratio = areas / np.linalg.norm(normals(_posed().mesh.vertices), axis=1)
    assert ratio.min() > 0.3
    assert ratio.max() < 3
    assert ((normals(vertices) * normals(_posed().mesh.vertices)).sum(axis=1) > 0).all()


def test_distances_are_those_to_the_closest_of_all_faces_of_a_coarse_scan() -> None:
    ball = make_sphere(2)
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    i, after = np.arange(24), np.roll(np.arange(24), -1)
    ends = [[0, 0, -4], [0, 0, 4]]
    scan = Mesh(
        np.vstack([ring - np.array([0, 0, 4]), ring - np.array([0, 0, -4]), ends]),
        np.vstack(
            [
                np.stack(one, axis=1)
                for one in (
                    (i, after, after + 24),
                    (i, after + 24, i + 24),
                    (after, i, 0 * i + 48),
                    (i + 24, after + 24, 0 * i + 49),
                )
            ]
        ),
    )
    template = Mesh(ball.vertices * [1, 1, 4], ball.faces)
    nearest = cKDTree(scan.vertices).query(template.vertices)[1]
    found = register(template, scan, nearest)
    rows, m = template.n_vertices, scan.n_faces
    every = m * np.arange(rows + 1), np.tile(np.arange(m), rows)
    points = found.mesh.vertices
    faces, weights = closest_faces(points, scan.vertices, scan.faces, every, np.arange(rows))
    places = np.einsum("ij,ijk->ik", weights, scan.vertices[scan.faces[faces]])
    least = np.linalg.norm(places - points, axis=1)
    np.testing.assert_allclose(found.distances, least, atol=1e-9)


def test_few_partners_are_enough_and_wrong_ones_are_overruled() -> None:
    chance = np.random.default_rng(0)
    few = np.where(chance.random(N) < 0.1, _truth(), -1)
    wrong = np.where(chance.random(N) < 0.05, chance.integers(0, M, N), _truth())
    for given in (few, wrong):
        found = register(_template().mesh, _scan().mesh, given)
        assert found.coverage > 0.98
        assert errors(found, _posed().mesh.vertices).mean() < 0.3


@pytest.mark.parametrize("apart", [1, 83])
def test_units_do_not_matter(apart: int) -> None:
    # Every partner is known, or scattered ones without a face between them; the scan has holes.
    torn = cut_discs(_scan().mesh, 0.15, 3, random_state=0)
    left = np.where(EVERY % apart == 0, damaged_truth(_truth(), target=torn), -1)
    one = register(_template().mesh, torn.mesh, left)
    template = Mesh(_template().mesh.vertices / 4, _template().mesh.faces)
    other = register(template, (64 * torn.mesh.vertices, torn.mesh.faces), left)
    np.testing.assert_allclose(other.mesh.vertices, 64 * one.mesh.vertices, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(other.distances, 64 * one.distances, rtol=1e-6, atol=1e-6)
    assert other.tolerance == pytest.approx(64 * one.tolerance)
    assert other.coverage == pytest.approx(one.coverage)


def test_what_lies_apart_on_a_scan_draws_nothing() -> None:
    stray = make_sphere(2)
    clutter = Mesh(
        np.vstack([_scan().mesh.vertices, 0.2 * stray.vertices + [0, 2, 0]]),
        np.vstack([_scan().mesh.faces, stray.faces + M]),
    )
    found = register(_template().mesh, clutter, _truth())
    assert found.coverage == 1
    assert errors(found, _posed().mesh.vertices).max() < 1.5


def test_a_scan_wound_inside_out_is_the_same_surface(fitted) -> None:
    turned = register(
        _template().mesh, (_scan().mesh.vertices, _scan().mesh.faces[:, ::-1]), _truth()
    )
    np.testing.assert_allclose(turned.mesh.vertices, fitted.mesh.vertices, atol=1e-6)


def test_faces_on_both_sides_are_one_surface(fitted) -> None:
    both = [
        (one.mesh.vertices, np.vstack([one.mesh.faces, one.mesh.faces[:, ::-1]]))
        for one in (_template(), _scan())
    ]
    found = register(*both, _truth())
    np.testing.assert_allclose(found.mesh.vertices, fitted.mesh.vertices, atol=1e-6)
    assert found.coverage == pytest.approx(fitted.coverage)


def test_an_open_template_is_itself() -> None:
    half = make_sphere(3)
    cap = Mesh(half.vertices, half.faces[(half.vertices[half.faces, 2] > 0).all(axis=1)])
    found = register(cap, cap, np.arange(cap.n_vertices))
    used = np.unique(cap.faces)
    assert found.coverage == pytest.approx(1)
    np.testing.assert_allclose(found.mesh.vertices[used], cap.vertices[used], atol=1e-6)


def test_vertices_that_no_face_uses_go_along() -> None:
    vertices = np.vstack([_template().mesh.vertices, [[0, 2, 0], [np.nan] * 3]])
    template = Mesh(vertices, _template().mesh.faces)
    scan = (3 * _template().mesh.vertices + [1, 0, 5], _template().mesh.faces)
    found = register(template, scan, np.append(EVERY, [-1, -1]))
    np.testing.assert_allclose(found.mesh.vertices[N], [1, 6, 5], atol=1e-5)
    assert np.isnan(found.mesh.vertices[N + 1]).all()
    assert np.isnan(found.distances[N:]).all()
    assert not found.covered[N:].any()


def test_a_vertex_that_only_an_improper_face_names_goes_along() -> None:
    ball = make_sphere(2)
    n = ball.n_vertices
    places = np.vstack([ball.vertices, [[0, 0, 1.1]]])
    odd, plain = Mesh(places, np.vstack([ball.faces, [[0, n, n]]])), Mesh(places, ball.faces)
    scan, images = (ball.vertices * [1, 1, 1.3], ball.faces), np.append(np.arange(n), -1)
    found, expected = (register(one, scan, images).mesh.vertices for one in (odd, plain))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_joints_stay_in_the_middle_of_what_bends_around_them() -> None:
    template, posed = _template(), _posed()
    joints = [bone.head for bone in template.bones]
    around = cKDTree(template.mesh.vertices).query(joints, 40)[1]
    joints = template.mesh.vertices[around].mean(axis=1)
    rigged = Mesh(np.vstack([template.mesh.vertices, joints]), template.mesh.faces)
    found = register(rigged, posed.mesh, np.append(EVERY, np.full(len(joints), -1)))
    off = np.linalg.norm(found.mesh.vertices[N:] - posed.mesh.vertices[around].mean(axis=1), axis=1)
    assert off.max() < mean_edge(posed.mesh)


@pytest.mark.parametrize("matched", [False, True])
def test_parts_without_a_partner_stay_where_they_belong(matched: bool) -> None:
    whole = add_components(_template().mesh, eyeballs=2, cloth=0, random_state=0)
    eyes = np.arange(N, whole.mesh.n_vertices)
    images = np.append(_truth(), np.full(len(eyes), -1))
    # In a match, smaller components have the partners of what is nearest to them.
    back = np.zeros(_scan().mesh.n_vertices, dtype=np.int64)
    found = Match(_truth()[whole.origin], back, np.eye(1), 1.0, 1.0)
    found = register(whole.mesh, _scan().mesh, found if matched else images).mesh.vertices
    for eye in (eyes[:42], eyes[42:]):  # each as round and as far from its place as before
        center, before = found[eye].mean(axis=0), whole.mesh.vertices[eye].mean(axis=0)
        radii = np.linalg.norm(found[eye] - center, axis=1)
        rest = np.linalg.norm(whole.mesh.vertices[eye] - before, axis=1)
        np.testing.assert_allclose(radii, rest, rtol=0.25)
        middle = int(np.linalg.norm(_template().mesh.vertices - before, axis=1).argmin())
        assert np.linalg.norm(found[middle] - center) < 0.5 * rest.mean()


def test_a_part_of_more_vertices_than_the_matched_body_goes_along() -> None:
    ball, scan = make_sphere(5), _scan().mesh
    button = _template().mesh.vertices[17] + 0.02 * ball.vertices
    template = Mesh(
        np.vstack([_template().mesh.vertices, button]),
        np.vstack([_template().mesh.faces, ball.faces + N]),
    )
    assert ball.n_vertices > N
    images = np.append(_truth(), np.full(len(button), -1))
    back = np.zeros(scan.n_vertices, dtype=np.int64)
    found = register(template, scan, Match(images, back, np.eye(1), 1.0, 1.0)).mesh.vertices
    size = np.ptp(found[:N], axis=0).max() / np.ptp(template.vertices[:N], axis=0).max()
    radii = np.linalg.norm(found[N:] - found[N:].mean(axis=0), axis=1)
    np.testing.assert_allclose(radii, 0.02 * size, rtol=0.25)
    assert np.linalg.norm(found[N:].mean(axis=0) - found[17]) < 0.02 * size


def test_what_the_template_lacks_of_the_scan_is_told() -> None:
    body, scan = _template().mesh, _posed().mesh
    kept = body.vertices[:, 0] < np.quantile(body.vertices[:, 0], 0.85)
    faces = body.faces[kept[body.faces].all(axis=1)]
    areas = vertex_areas(scan)
    found = register((body.vertices, faces), scan, np.where(kept, EVERY, -1))
    assert found.coverage == 1
    assert found.scan_coverage == pytest.approx(areas[kept].sum() / areas.sum(), abs=0.03)
    assert register(body, scan, EVERY).scan_coverage == 1


def test_a_loose_part_does_not_hold_back_the_body_that_it_follows() -> None:
    """A ring around two legs, near which they do not stay."""
    body, scan = _template().mesh, _posed().mesh
    feet = body.vertices[body.vertices[:, 1] < np.quantile(body.vertices[:, 1], 0.2)]
    ring = make_sphere(3).vertices * np.ptp(feet, axis=0) * [0.6, 0.3, 0.6] + feet.mean(axis=0)
    template = np.vstack([body.vertices, ring]), np.vstack([body.faces, make_sphere(3).faces + N])
    found = register(template, scan, np.append(EVERY, np.full(len(ring), -1)))
    off = np.linalg.norm(found.mesh.vertices[:N] - scan.vertices, axis=1)
    assert off.max() < mean_edge(scan)


@pytest.mark.parametrize("radius", [0, 1e-9])
def test_a_speck_goes_along(radius: float) -> None:
    # Surfaces of CT scans have them: components whose vertices lie in one place, or nearly.
    ball = make_sphere(0)
    speck = _template().mesh.vertices[17] + radius * ball.vertices
    template = (
        np.vstack([_template().mesh.vertices, speck]),
        np.vstack([_template().mesh.faces, ball.faces + N]),
    )
    found = register(template, _posed().mesh, np.append(EVERY, np.full(12, 17))).mesh.vertices
    np.testing.assert_allclose(found[N:], found[[17] * 12], atol=1e-3)
    off = np.linalg.norm(found[:N] - _posed().mesh.vertices, axis=1)
    assert off.max() < 0.5 * mean_edge(_posed().mesh)


def test_onto_points_it_lies_on_their_surface() -> None:
    cloud = sample_points(_scan().mesh, 3000, random_state=0)
    match = cloud.image[_truth()]
    found = register(_template().mesh, cloud.mesh, match)
    assert found.coverage > 0.9
    some = found.mesh.vertices[::10]
    assert np.median(distance_to_faces(some, _scan().mesh)) < 0.2 * mean_edge(_scan().mesh)


def test_a_template_of_four_vertices_comes_to_lie_on_the_scan() -> None:
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    template = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], faces)
    found = register(template, make_sphere(3), np.array([0, 1, 2, 3]))
    np.testing.assert_allclose(np.linalg.norm(found.mesh.vertices, axis=1), 1, atol=0.05)


def test_a_reflection_turns_the_source_inside_out_with_a_warning() -> None:
    ball = make_sphere(1)
    image = (ball.vertices * [-1, 1, 1], ball.faces[:, ::-1])
    every = np.arange(ball.n_vertices)
    reflection = Match(every, every, np.eye(1), -1.0, 1.0)
    with pytest.warns(UnbendWarning, match="is turned inside out: mirror it"):
        register(ball, image, reflection)
    with pytest.warns(UnbendWarning, match="is turned inside out: mirror it"):
        morph(ball, image, reflection, 0.5)


def test_what_does_not_fit(moebius_strip: Mesh) -> None:
    body = _template().mesh
    for template, scan, mapping, kind, sentence in (
        (body.vertices, body, EVERY, InputError, "a template needs faces"),
        (body, body, EVERY[1:], InputError, f"the map has {N - 1} source vertices, but .* has {N}"),
        (body, body, EVERY + 1, InputError, f"names target vertex {N}"),
        (body, body, np.full(N, -1), InputError, "fewer than 4 vertices"),
        (Mesh(1e-170 * body.vertices, body.faces), body, EVERY, MeshError, "its area is 0; give"),
        (body, moebius_strip, np.zeros(N, int), MeshError, "only one side"),
    ):
        with pytest.raises(kind, match=sentence):
            register(template, scan, mapping)
