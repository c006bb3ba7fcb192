import numpy as np
import pytest

from unbend.datasets import make_sphere
from unbend.mesh import face_normals, find_edges, refinement
from unbend.mesh.refinement import refine


def longest(vertices, faces):
    ends = vertices[find_edges(faces, len(vertices)).ends]
    return np.linalg.norm(np.diff(ends, axis=1), axis=2).max()


@pytest.fixture
def stone():
    """A sphere whose triangles have edges of 0.2 to 2."""
    ball = make_sphere(1)
    return ball.vertices * [3, 1, 1], ball.faces


@pytest.mark.parametrize("most", [0.1, 0.5, 1.0])
def test_no_edge_stays_long_and_the_surface_stays(stone, most):
    vertices, faces = stone
    found = refine(vertices, faces, most)
    assert longest(found.vertices, found.faces) <= most
    np.testing.assert_array_equal(found.vertices[: len(vertices)], vertices)
    np.testing.assert_allclose(
        np.einsum("ijk,ikl->ijl", found.corners, vertices[faces[found.parents]]),
        found.vertices[found.faces],
        atol=1e-12,
    )
    normals = [np.zeros_like(vertices[faces[:, 0]]), face_normals(vertices, faces)]
    np.add.at(normals[0], found.parents, face_normals(found.vertices, found.faces))
    np.testing.assert_allclose(*normals, atol=1e-12)  # areas and windings


def test_what_has_no_long_edge_stays_as_it_is(stone):
    found = refine(*stone, 2.5)
    assert np.array_equal(found.faces, stone[1])
    assert np.array_equal(found.parents, np.arange(len(stone[1])))


def test_a_bound_on_vertices_stops_it_but_once_is_always_possible(stone, monkeypatch):
    monkeypatch.setattr(refinement, "_MOST", 100)
    assert len(refine(*stone, 0.01).vertices) == 162
