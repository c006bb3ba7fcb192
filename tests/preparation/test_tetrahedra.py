import numpy as np
import pytest

from unbend import Mesh, diagnose
from unbend.mesh import find_edges
from unbend.preparation._tetrahedra import (
    Tetrahedra,
    boundary,
    find_inside,
    make_tetrahedra,
    split,
)

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)


def made(corners: list[list[int]], beyond: list[list[int]]) -> Tetrahedra:
    n = len(corners)
    nothing = np.zeros((n, 3)), np.zeros(n), np.zeros((n, 4))
    return Tetrahedra(CUBE, np.ones(8), np.array(corners), np.array(beyond), *nothing)


def test_tetrahedra_fill_the_cube_and_their_balls_are_empty() -> None:
    points = np.vstack([CUBE, np.random.default_rng(0).random((200, 3))])
    found = make_tetrahedra(points, np.ones(208))
    edges = points[found.corners[:, 1:]] - points[found.corners[:, :1]]
    volumes = np.linalg.det(edges) / 6
    assert (volumes >= 0).all()
    assert volumes.sum() == pytest.approx(1)
    solid = found.radii > 0
    away = np.linalg.norm(points - found.centres[solid][:, None], axis=2)
    np.testing.assert_allclose(away.min(axis=1), found.radii[solid], rtol=1e-6)


def test_neighbours_share_the_face_opposite_the_corner() -> None:
    found = make_tetrahedra(np.random.default_rng(1).random((60, 3)), np.ones(60))
    tetrahedron, corner = np.nonzero(found.beyond >= 0)
    for i, k in zip(tetrahedron, corner, strict=True):
        face = set(np.delete(found.corners[i], k))
        assert face <= set(found.corners[found.beyond[i, k]])


def test_the_cut_of_a_ball_with_points_around_it() -> None:
    """Points on the unit sphere face outward; those of a larger one face inward."""
    chance = np.random.default_rng(2)
    sphere = chance.standard_normal((1500, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    points = np.vstack([sphere[:500], 2 * sphere[500:]])
    normals = np.vstack([sphere[:500], -sphere[500:]])
    found = make_tetrahedra(points, np.full(1500, 0.16))
    nothing = np.zeros(len(found.corners))
    faces = boundary(found, find_inside(found, normals, nothing))[0]
    assert (faces < 500).all()
    volume = np.linalg.det(points[faces]).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi, rel=0.05)


def test_no_edge_has_more_than_two_faces() -> None:
    """Two tetrahedra that share an edge only."""
    found = made([[0, 1, 2, 3], [0, 1, 4, 5]], [[-1] * 4] * 2)
    faces = boundary(found, np.array([True, False]))[0]
    assert find_edges(faces, 8).n_faces.max() == 2
    assert len(boundary(found, np.array([True, True]))[0]) == 0


def test_a_vertex_of_two_fans_becomes_two() -> None:
    """Two tetrahedra that share a vertex only."""
    found = made([[0, 1, 2, 3], [0, 4, 5, 6]], [[-1] * 4] * 2)
    faces, edges, cut = boundary(found, np.array([True, True]))
    assert not cut.any()
    point, new = split(faces, edges)
    assert sorted(point) == [0, 0, 1, 2, 3, 4, 5, 6]
    np.testing.assert_array_equal(point[new], faces)


@pytest.mark.parametrize(("spacing", "genus"), [(0.1, 1), (0.3, 0)])
def test_a_ring_is_cut_unless_it_is_thick(spacing: float, genus: int) -> None:
    """A ring that is 0.6 thick: six and two spacings. Both ends of a cut are closed."""
    around, across = 2 * np.pi * np.random.default_rng(3).random((2, 3000))
    radius = 1 + 0.3 * np.cos(across)
    points = np.stack(
        [radius * np.cos(around), radius * np.sin(around), 0.3 * np.sin(across)], axis=1
    )
    found = make_tetrahedra(points, np.full(3000, spacing))
    middle = points[found.corners].mean(axis=1)
    inside = np.hypot(np.hypot(middle[:, 0], middle[:, 1]) - 1, middle[:, 2]) < 0.3
    faces, edges, cut = boundary(found, inside)
    point, new = split(faces, edges)
    np.testing.assert_array_equal(point[new], faces)
    health = diagnose(Mesh(points[point], new))
    assert health.n_components == 1
    assert health.genus == genus
    assert health.closed
    # Each face of a cut is there twice, once for either end.
    sides = np.sort(faces[cut], axis=1)
    assert (np.unique(sides, axis=0, return_counts=True)[1] == 2).all()
    assert len(sides) == 0 if genus else len(sides) > 0
