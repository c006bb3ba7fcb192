"""Decimation: truths about what a coarser mesh must share with the fine one."""

import numpy as np
import pytest

from sheets import make_sheet
from unbend.datasets import make_biped, make_sphere
from unbend.matching._decimation import _cost, _quadrics, _turns_over, decimate
from unbend.mesh import Mesh, find_components, find_edges, vertex_areas


def _euler(faces: np.ndarray, n: int) -> int:
    return n - len(find_edges(faces, n).ends) + len(faces)


def test_a_closed_surface_stays_one() -> None:
    mesh = make_biped("running", n_vertices=3000).mesh
    kept, faces, parents = decimate(mesh.vertices, mesh.faces, 500)
    assert len(kept) == 500
    assert (find_edges(faces, 500).n_faces == 2).all()
    assert _euler(faces, 500) == 2
    assert (np.unique(faces) == np.arange(500)).all()
    assert (parents[kept] == np.arange(500)).all()
    area = vertex_areas(Mesh(mesh.vertices[kept], faces)).sum()
    assert 0.93 < area / vertex_areas(mesh).sum() < 1.01
    # Nobody is moved far: not out of a limb into the one beside it.
    moved = np.linalg.norm(mesh.vertices[kept][parents] - mesh.vertices, axis=1)
    assert moved.max() < 0.1 * np.ptp(mesh.vertices, axis=0).max()


def test_a_ball_keeps_its_outside_and_its_evenness() -> None:
    ball = make_sphere(4)
    kept, faces, _ = decimate(ball.vertices, ball.faces, 200)
    corners = ball.vertices[kept][faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normals * corners.mean(axis=1)).sum(axis=1) > 0).all()
    areas = np.linalg.norm(normals, axis=1) / 2
    assert areas.max() < 6 * np.median(areas)


def test_a_boundary_is_not_eaten_into() -> None:
    sheet = make_sheet(21)
    vertices, faces = sheet.vertices, sheet.faces
    kept, coarse, _ = decimate(vertices, faces, 60)
    assert len(kept) == 60
    assert _euler(coarse, 60) == 1
    corners = vertices[kept][coarse]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()
    assert np.linalg.norm(normals, axis=1).sum() / 2 > 0.97


def test_what_is_small_enough_is_left_alone() -> None:
    ball = make_sphere(1)
    kept, faces, parents = decimate(ball.vertices, ball.faces, 1000)
    assert (kept == np.arange(ball.n_vertices)).all()
    assert (faces == ball.faces).all()
    assert (parents == kept).all()


@pytest.mark.kernels
@pytest.mark.parametrize("twice", [False, True])
def test_what_hangs_by_its_corners_is_not_cut_off(twice: bool) -> None:
    # A chain of triangles, single or back to back, that share one corner each.
    ball = make_sphere(2)
    n = ball.n_vertices
    links = np.arange(0, 12, 2)[:, None] + [n - 1, n, n + 1]
    links[0, 0] = 5
    step = np.array([[0.02, 0.01, 0.0], [0.04, 0.0, 0.0]])
    chain = ball.vertices[5] * (1 + np.arange(6)[:, None, None] * 0.04) + step
    vertices = np.vstack([ball.vertices, chain.reshape(-1, 3)])
    faces = np.vstack([ball.faces, links, *([links[:, ::-1]] if twice else [])])
    assert len(find_components(faces, len(vertices)).n_vertices) == 1
    for count in (100, 40, 10):
        kept, coarse, _ = decimate(vertices, faces, count)
        assert (np.unique(coarse) == np.arange(len(kept))).all()
        assert len(find_components(coarse, len(kept)).n_vertices) == 1


@pytest.mark.kernels
def test_a_small_ball_is_decimated_to_a_tetrahedron() -> None:
    ball = make_sphere(1)
    kept, faces, parents = decimate(ball.vertices, ball.faces, 4)
    assert len(kept) == len(faces) == 4
    assert (find_edges(faces, 4).n_faces == 2).all()
    assert (parents[kept] == np.arange(4)).all()


@pytest.mark.kernels
def test_the_cost_of_a_collapse_is_the_sum_of_squared_distances() -> None:
    ball = make_sphere(1)
    points = ball.vertices + 0.1 * np.random.default_rng(0).normal(size=ball.vertices.shape)
    quadrics = _quadrics(points, ball.faces, find_edges(ball.faces, ball.n_vertices))
    corners = points[ball.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(normals, axis=1)
    for u, v in ball.faces[::7, :2]:
        expected = 0.0
        for end in (u, v):
            around = (ball.faces == end).any(axis=1)
            heights = ((points[v] - corners[:, 0]) * normals).sum(axis=1) / double
            expected += (double / 6 * heights**2)[around].sum()
        area = double[(ball.faces == u).any(axis=1)].sum() / 6
        expected += 0.1 * area * ((points[u] - points[v]) ** 2).sum()
        assert _cost(points, quadrics, u, v) == pytest.approx(expected)


@pytest.mark.kernels
def test_a_face_turns_over_when_a_corner_crosses_the_opposite_side() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0.5], [0.8, 0.8, 0.1]])
    face = np.array([[0, 1, 2]])
    assert not _turns_over(points, face, 0, 0, 3)
    assert _turns_over(points, face, 0, 0, 4)
    assert _turns_over(points, face, 0, 0, 1)  # nothing is left of it
