"""Closest points on a mesh: vertices found by descent, and points on faces, by other means."""

import itertools

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.deformation import ElasticSurface, closest_faces, walk
from unbend.mesh import faces_around

pytestmark = pytest.mark.kernels


def _graph(mesh: Mesh) -> sp.csr_matrix:
    return ElasticSurface(mesh.vertices, mesh.faces, np.ones(mesh.n_vertices)).edge_weights


def _walk(left: np.ndarray, right: np.ndarray, guess: np.ndarray, graph) -> np.ndarray:
    return walk(left, right, guess, graph, graph)


@pytest.mark.parametrize("rows", [5, 1024])
def test_a_walk_ends_where_no_neighbour_is_closer_and_goes_only_downhill(
    rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("unbend.deformation._kernels._ROWS", rows)
    mesh = make_sphere(1)
    n, graph = mesh.n_vertices, _graph(mesh)
    rng = np.random.default_rng(0)
    left, right = rng.normal(size=(2, n, 4))
    guess = rng.integers(n, size=n)
    found = _walk(left, right, guess, graph)
    apart = np.linalg.norm(left[:, None] - right, axis=2)
    near = graph.toarray() > 0
    for i in range(n):
        starts = [guess[i], *guess[near[i]]]
        assert apart[i, found[i]] <= apart[i, starts].min()
        assert apart[i, found[i]] <= apart[i, near[found[i]]].min()


def test_a_walk_stays_where_nothing_is_closer() -> None:
    mesh = make_sphere(1)
    same = np.ones((mesh.n_vertices, 3))
    guess = np.random.default_rng(0).integers(mesh.n_vertices, size=mesh.n_vertices)
    np.testing.assert_array_equal(_walk(same, same, guess, _graph(mesh)), guess)


def test_on_a_ball_a_walk_finds_the_nearest_point_from_anywhere() -> None:
    # On a round triangulated ball whoever is not nearest has a neighbour that is nearer.
    ball = make_sphere(2)
    turned = ball.vertices @ Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix().T
    found = _walk(turned, ball.vertices, np.zeros(ball.n_vertices, dtype=np.int64), _graph(ball))
    apart = np.linalg.norm(turned[:, None] - ball.vertices, axis=2)
    np.testing.assert_allclose(np.take_along_axis(apart, found[:, None], 1)[:, 0], apart.min(1))


def test_several_walks_side_by_side_are_as_each_alone() -> None:
    mesh = make_sphere(1)
    graph, n, rng = _graph(mesh), mesh.n_vertices, np.random.default_rng(0)
    rows = rng.integers(n, size=(n, 3))
    left, right = rng.normal(size=(2, n, 3, 5))
    walked = _walk(left, right, rows, graph)
    for i in range(3):
        one = (np.ascontiguousarray(each[:, i]) for each in (left, right, rows))
        np.testing.assert_array_equal(walked[:, i], _walk(*one, graph))


def _closest(
    points: np.ndarray, places: np.ndarray, faces: np.ndarray, vertices: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    return closest_faces(points, places, faces, faces_around(faces, len(places)), vertices)


def _nearest_distance(point: np.ndarray, corners: np.ndarray) -> float:
    """Distance to a triangle: that to the flat through one, two or three corners, if inside."""
    least = np.inf
    for count in (1, 2, 3):
        for some in itertools.combinations(corners, count):
            origin, sides = some[0], np.array(some)[1:] - some[0]
            shares = np.linalg.pinv(sides.T) @ (point - origin)
            if (shares >= 0).all() and shares.sum() <= 1:
                least = min(least, float(np.linalg.norm(origin + shares @ sides - point)))
    return least


@pytest.mark.parametrize("d", [2, 3, 6])
def test_the_nearest_point_of_the_faces_around_a_vertex(d: int) -> None:
    faces = make_sphere(1).faces
    rng = np.random.default_rng(d)
    places = rng.normal(size=(faces.max() + 1, d))
    points = 1.5 * rng.normal(size=(50, d))
    vertices = rng.integers(len(places), size=50)
    found, weights = _closest(points, places, faces, vertices)
    assert (faces[found] == vertices[:, None]).any(axis=1).all()
    assert (weights >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    landed = np.einsum("ij,ijk->ik", weights, places[faces[found]])
    for point, vertex, place in zip(points, vertices, landed, strict=True):
        fan = places[faces[(faces == vertex).any(axis=1)]]
        expected = min(_nearest_distance(point, corners) for corners in fan)
        assert np.linalg.norm(place - point) == pytest.approx(expected, abs=1e-9)


def test_what_lies_on_the_surface_stays_there() -> None:
    ball = make_sphere(1)
    rng = np.random.default_rng(0)
    shares = rng.dirichlet(np.ones(3), size=len(ball.faces))
    points = np.einsum("ij,ijk->ik", shares, ball.vertices[ball.faces])
    found, weights = _closest(points, ball.vertices, ball.faces, ball.faces[:, 1])
    np.testing.assert_array_equal(found, np.arange(len(ball.faces)))
    np.testing.assert_allclose(weights, shares, atol=1e-9)
    every = np.arange(ball.n_vertices)
    found, weights = _closest(ball.vertices, ball.vertices, ball.faces, every)
    landed = np.einsum("ij,ijk->ik", weights, ball.vertices[ball.faces[found]])
    np.testing.assert_allclose(landed, ball.vertices, atol=1e-12)


@pytest.mark.parametrize("size", [2.0**-170, 2.0**-100, 2.0**170])
def test_of_any_size(size: float) -> None:
    ball = make_sphere(1)
    points = 1.1 * np.random.default_rng(0).normal(size=(50, 3))
    vertices = np.arange(50) % ball.n_vertices
    at_one = _closest(points, ball.vertices, ball.faces, vertices)
    found = _closest(points * size, ball.vertices * size, ball.faces, vertices)
    for one, other in zip(found, at_one, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_face_without_area_is_a_line_or_a_point() -> None:
    places = np.array([[0.0, 0, 0], [2, 0, 0], [1, 0, 0]])
    face, first = np.array([[0, 1, 2]]), np.zeros(1, dtype=np.int64)
    for corners, point, nearest in (
        (places, [1.5, 1, 0], [1.5, 0, 0]),
        (places, [3.0, 1, 0], [2, 0, 0]),
        (0 * places + 1, [3.0, 1, 0], [1, 1, 1]),
    ):
        _, weights = _closest(np.array([point]), np.asarray(corners, float), face, first)
        np.testing.assert_allclose(weights[0] @ corners, nearest, atol=1e-12)
