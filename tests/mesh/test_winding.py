"""Which way round faces are, where a surface has two sides, and where it all but has."""

import numpy as np
import pytest

from sheets import make_sheet, make_twisted_ball
from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.mesh import _winding, find_edges, orient_consistently, outwardness


def test_faces_are_wound_alike_and_the_fewer_turned():
    sphere = make_sphere(2)
    strip = np.array([[i, i + 1, i + 2][:: 1 if i % 2 else -1] for i in range(6)]) + 162
    right = np.vstack([sphere.faces, strip, [[170, 171, 172]]])
    points = np.random.default_rng(0).random((173, 3))
    for seed in range(5):
        draw = np.random.default_rng(seed)
        flip = draw.random(len(right)) < 0.3
        flip[-7:] = [0, 1, 0, 1, 0, 0, 0]
        mixed = np.where(flip[:, None], right[:, ::-1], right)
        np.testing.assert_array_equal(orient_consistently(points, mixed), right)
        np.testing.assert_array_equal(orient_consistently(points, mixed[::-1]), right[::-1])
    tie = orient_consistently(points, right[-7:-5])
    np.testing.assert_array_equal(tie, right[-7:-5])
    halves = np.vstack([right[-7:-6], right[-6:-5, ::-1]])
    turned = orient_consistently(points, halves)
    assert (turned == halves).all(axis=1).sum() == 1
    edges = find_edges(turned, 173)
    assert (edges.n_upward[edges.n_faces == 2] == 1).all()


def test_a_face_that_names_a_vertex_twice_turns_nothing():
    faces = np.array([[0, 1, 2], [2, 1, 3], [3, 3, 1], [4, 4, 4]])
    np.testing.assert_array_equal(orient_consistently(np.zeros((5, 3)), faces), faces)


def test_a_surface_of_one_side_cannot_be_wound(moebius_strip: Mesh) -> None:
    assert orient_consistently(moebius_strip.vertices, moebius_strip.faces) is None
    sphere = make_sphere(1)
    both = np.vstack([sphere.faces, moebius_strip.faces + 42])
    assert orient_consistently(np.vstack([sphere.vertices, moebius_strip.vertices]), both) is None
    for size in (1e-200, 1e200):
        assert orient_consistently(size * moebius_strip.vertices, moebius_strip.faces) is None


@pytest.mark.parametrize("size", [1e-200, 1.0, 1e200])
def test_faces_disagree_along_the_short_seam_of_a_small_twist_alone(size: float) -> None:
    """A Möbius strip as small as a detail does not make one of a ball: only its faces can tell."""
    ball, ring = make_twisted_ball(4)
    seam = find_edges(ball.faces, ball.n_vertices)
    assert (seam.n_faces == 2).all()
    before = seam.ends[seam.n_upward != 1]
    np.testing.assert_array_equal(np.unique(before), np.sort(ring))
    for seed in range(6):
        flip = np.random.default_rng(seed).random(ball.n_faces) < 0.4
        mixed = np.where(flip[:, None], ball.faces[:, ::-1], ball.faces)
        wound = orient_consistently(size * ball.vertices, mixed)
        assert wound is not None
        edges = find_edges(wound, ball.n_vertices)
        assert (edges.n_upward != 1).sum() <= 3
        # Which few beside the twist are turned is open; the rest are as they were, all of them.
        turned = (wound != ball.faces).any(axis=1)
        assert turned.sum() <= 12
        near = np.isin(ball.faces[turned], ball.faces[np.isin(ball.faces, ring).any(axis=1)])
        assert near.all()


def test_beside_a_twist_all_else_is_wound_as_if_there_were_none() -> None:
    ball, _ = make_twisted_ball(4)
    other = make_sphere(2)
    flip = np.random.default_rng(0).random(other.n_faces) < 0.4
    mixed = np.where(flip[:, None], other.faces[:, ::-1], other.faces)
    points = np.vstack([other.vertices, ball.vertices])
    wound = orient_consistently(points, np.vstack([mixed, ball.faces + other.n_vertices]))
    assert wound is not None
    np.testing.assert_array_equal(wound[: other.n_faces], other.faces)


@pytest.mark.parametrize("level", [2, 3])
def test_a_twist_as_wide_as_a_limb_is_the_nature_of_a_surface(level: int) -> None:
    ball, _ = make_twisted_ball(level)
    assert orient_consistently(ball.vertices, ball.faces) is None


def test_a_seam_is_as_long_as_its_edges_in_roots_of_the_area() -> None:
    sheet = make_sheet(3)
    ends = np.array([[0, 1], [3, 4], [6, 7]])
    for size in (1e-200, 3.0):
        assert _winding._length(size * sheet.vertices, ends, sheet.faces) == pytest.approx(1.5)


@pytest.mark.parametrize("scale", [1e-200, 1, 1e200])
def test_faces_of_a_surface_with_an_inside_face_in_or_out(scale):
    ball = make_sphere(3)
    x = ball.vertices[:, 0]
    far = scale * (ball.vertices + 30)
    most = ball.faces[(x[ball.faces] < 0.5).all(axis=1)]
    holes = ball.faces[(abs(x[ball.faces]) < 0.9).any(axis=1)]
    shell = ball.faces[(x[ball.faces] > 0.5).any(axis=1)]  # a bent sheet
    for faces in (ball.faces, most, holes):
        assert outwardness(far, faces[:, ::-1]) < -1
        assert outwardness(far, faces) > 1
    for faces in (shell, shell[:, ::-1], shell[:0]):
        assert abs(outwardness(far, faces)) < 1
