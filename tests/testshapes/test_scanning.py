"""What a camera sees, noise, and separate pieces."""

from functools import cache

import numpy as np
import pytest

from testshapes.measures import area, face_normals, mean_edge
from testshapes.scanning import _visible, add_components, add_noise, seen_from
from unbend import diagnose
from unbend.datasets import make_quadruped, make_sphere


@cache
def dog():
    return make_quadruped("sitting", n_vertices=600).mesh


def hidden_by_a_face(mesh, direction):
    """Whether the ray from each face's middle towards the camera meets a face, one by one."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    result = []
    for face, start in enumerate((a + b + c) / 3):
        across = np.cross(direction, c - a)
        volume = np.einsum("ni,ni->n", b - a, across)
        volume[face] = 0
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ni,ni->n", start - a, across) / volume
            around = np.cross(start - a, b - a)
            v = around @ direction / volume
            t = np.einsum("ni,ni->n", c - a, around) / volume
        result.append(bool(((u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (volume != 0)).any()))
    return np.array(result)


@pytest.mark.parametrize("direction", [(0, 0, 1), (0.3, 0.5, -0.8), (-1, 0.1, 0.2)])
def test_visible_faces_are_those_that_rays_reach(direction):
    direction = np.array(direction) / np.linalg.norm(direction)
    normals = face_normals(dog())
    facing = normals @ direction > 0.1 * np.linalg.norm(normals, axis=1)
    expected = facing & ~hidden_by_a_face(dog(), direction)
    assert np.mean(_visible(dog(), direction) == expected) > 0.999


def test_of_a_sphere_the_front_is_seen():
    ball = make_sphere(4)
    seen = seen_from(ball, (0, 3, 0))
    # Of the hemisphere, all but what is seen at a grazing angle.
    assert area(seen.mesh) / area(ball) == pytest.approx(0.45, abs=0.01)
    assert seen.mesh.vertices[:, 1].min() > 0.0
    assert diagnose(seen.mesh).boundary_loops == 1


def test_a_scan_is_one_manifold_piece():
    for direction in np.random.default_rng(0).standard_normal((5, 3)):
        found = diagnose(seen_from(dog(), direction).mesh)
        assert len(found.component_faces) == 1
        assert found.non_manifold_edges == found.non_manifold_vertices == 0


def test_noise_is_as_strong_as_asked_and_along_the_view():
    ball = make_sphere(4)
    for direction in (None, (0.0, 0.0, 2.0)):
        noisy = add_noise(ball, 0.5, direction=direction, random_state=0)
        moved = noisy.mesh.vertices - ball.vertices
        ways = ball.vertices if direction is None else np.array([[0, 0, 1.0]])
        along = (moved * ways).sum(axis=1)
        assert along.std() == pytest.approx(0.5 * mean_edge(ball), rel=0.05)
        assert np.abs(moved - along[:, None] * ways).max() < 0.02 * np.abs(along).max()
        np.testing.assert_array_equal(noisy.origin, np.arange(ball.n_vertices))
        np.testing.assert_array_equal(noisy.mesh.faces, ball.faces)


def test_components_are_added_and_the_body_stays_as_it_is():
    body = dog()
    dressed = add_components(body, eyeballs=2, cloth=0.1, random_state=3)
    found = diagnose(dressed.mesh)
    assert len(found.component_faces) == 4
    np.testing.assert_array_equal(dressed.mesh.vertices[:600], body.vertices)
    np.testing.assert_array_equal(dressed.mesh.faces[: body.n_faces], body.faces)
    np.testing.assert_array_equal(dressed.image, np.arange(600))
    away = np.linalg.norm(dressed.mesh.vertices - body.vertices[dressed.origin], axis=1)
    assert away.max() < 3 * mean_edge(body)
    cloth = away[600 + 2 * 42 :]
    np.testing.assert_allclose(cloth, 0.5 * mean_edge(body))
    extra = area(dressed.mesh) - area(body)
    assert extra / area(body) > 0.09
