"""Closest points on faces: on a flat square they are known."""

import numpy as np
import pytest
import scipy.sparse as sp

from unbend.correspondence._projection import Target, make_target, project, project_anywhere
from unbend.datasets import make_sphere
from unbend.deformation import closest_faces

SIDE = 8


@pytest.fixture(scope="module")
def square() -> Target:
    """The unit square at z = 0, facing up, with a hole of one cell in the middle."""
    x, y = (one.ravel() for one in np.mgrid[: SIDE + 1, : SIDE + 1])
    column, row = (one.ravel() for one in np.mgrid[:SIDE, :SIDE])
    column, row = np.delete([column, row], 3 * SIDE + 4, axis=1)
    here = column * (SIDE + 1) + row
    there = here + SIDE + 1
    faces = np.stack([here, there, there + 1, here, there + 1, here + 1], axis=1).reshape(-1, 3)
    return make_target(np.stack([x, y, 0 * x], axis=1) / SIDE, faces)


def projected(square: Target, points, normal=(0, 0, 1)):
    n = len(points)
    normals = np.tile(np.array(normal, dtype=float), (n, 1))
    alone, start = sp.csr_matrix((n, n)), np.zeros(n, dtype=np.int64)
    return project(square, np.array(points), normals, alone, start, normal_weight=0.0, slack=0.01)


def test_the_closest_of_all_faces_is_found_however_uneven_they_are() -> None:
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(60, 1, 3)) + 10 ** rng.uniform(-3, 1, (60, 1, 1)) * rng.normal(
        size=(60, 3, 3)
    )
    faces = np.arange(180).reshape(60, 3)
    soup = make_target(np.vstack([corners.reshape(-1, 3), [[0, 0, 0]]]), faces)  # one is in no face
    points = 3 * rng.normal(size=(200, 3))
    every = np.arange(201) * 60, np.tile(np.arange(60), 200)
    found, weights = closest_faces(points, soup.vertices, faces, every, np.arange(200))
    places = np.einsum("ij,ijk->ik", weights, soup.vertices[faces[found]])
    least = np.linalg.norm(places - points, axis=1)
    projected = project_anywhere(soup, points, np.zeros((200, 3)), slack=0.0)
    np.testing.assert_allclose(projected.distances, least, rtol=1e-9)


def test_points_fall_straight_down(square: Target) -> None:
    points = [[0.27, 0.26, 0.1], [0.77, 0.91, -0.2], [0.9, 0.05, 0.3], [0.05, 0.62, 0.0]]
    found = projected(square, points)
    nearest = np.rint(SIDE * np.array(points)[:, :2]) @ [SIDE + 1, 1]
    np.testing.assert_array_equal(found.partners, nearest)
    np.testing.assert_allclose(found.places[:, :2], np.array(points)[:, :2], atol=1e-12)
    np.testing.assert_allclose(found.distances, [0.1, 0.2, 0.3, 0], atol=1e-12)
    np.testing.assert_allclose(found.normals, [[0, 0, 1]] * 4, atol=1e-12)
    assert found.valid.all()


def test_beyond_a_boundary_there_is_nothing(square: Target) -> None:
    hole = [3.5 / SIDE, 4.5 / SIDE, 0.05]
    found = projected(square, [hole, [1.1, 0.5, 0], [1.2, 1.2, 0.1], [1.005, 0.52, 0.2]])
    np.testing.assert_array_equal(found.valid, [False, False, False, True])
    np.testing.assert_allclose(found.places[1:3], [[1, 0.5, 0], [1, 1, 0]], atol=1e-12)


def test_beyond_every_side_and_every_vertex_of_a_boundary_there_is_nothing(square: Target) -> None:
    along = np.arange(2 * SIDE + 1) / (2 * SIDE)  # vertices, and the middles between them
    for one, other in ((0, 1), (1, 0)):
        for off in (-0.1, 1.1):
            points = np.zeros((len(along), 3))
            points[:, one], points[:, other] = along, off
            assert not projected(square, points).valid.any()
            points[:, other] = np.clip(off, 0, 1)
            assert projected(square, points).valid.all()


def test_an_edge_joins_two_neighbours(square: Target) -> None:
    n_edges = 2 * SIDE * (SIDE + 1) + SIDE**2 - 1
    assert square.neighbors.sum() == 2 * n_edges


def test_the_back_of_a_sheet_is_no_place(square: Target) -> None:
    points = np.full((4, 3), 0.2)
    assert not projected(square, points, normal=(0, 0, -1)).valid.any()
    turned = square._replace(normals=-square.normals)
    assert projected(turned, points, normal=(0, 0, -1)).valid.all()


def test_on_a_ball_the_surface_faces_outwards() -> None:
    ball = make_sphere(2)
    outwards = ball.vertices[ball.faces].mean(axis=1)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    start, alone = ball.faces[:, 0], sp.csr_matrix((len(outwards),) * 2)
    target = make_target(ball.vertices, ball.faces)
    found = project(target, 2 * outwards, outwards, alone, start, normal_weight=0.0, slack=0.0)
    np.testing.assert_allclose(found.normals, outwards, atol=0.05)
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1, rtol=1e-12)
    # A closed surface has no boundary, for points askew of vertices either.
    n = ball.n_vertices
    askew = 2 * ball.vertices + 0.01 * ball.vertices[:, [1, 2, 0]]
    start, alone = np.arange(n), sp.csr_matrix((n, n))
    found = project(target, askew, ball.vertices, alone, start, normal_weight=0.0, slack=0.0)
    assert found.valid.all()
