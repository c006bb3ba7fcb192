"""Perturbations do what they say, leave good surfaces, and do the same each time."""

from functools import cache

import numpy as np
import pytest

from paper.perturbations import perturb
from testshapes.measures import area, mean_edge
from unbend import diagnose
from unbend.datasets import make_quadruped, make_sphere
from unbend.errors import InputError, MissingExtraError

BALL = make_sphere(3)


@cache
def dog():
    return make_quadruped("sitting", n_vertices=600).mesh


def test_noise_is_normal_and_as_strong_as_asked():
    moved = perturb(BALL, "noise", 0.5)
    height = np.linalg.norm(moved.mesh.vertices, axis=1) - 1
    assert height.std() == pytest.approx(0.5 * mean_edge(BALL), rel=0.1)
    along = (moved.mesh.vertices * BALL.vertices).sum(axis=1)[:, None] * BALL.vertices
    assert np.abs(moved.mesh.vertices - along).max() < 0.02 * np.abs(height).max()
    assert (moved.mesh.faces == BALL.faces).all()
    assert (moved.origin == np.arange(BALL.n_vertices)).all()


@pytest.mark.parametrize(("kind", "n_rims"), [("part missing", 1), ("holes", 8)])
def test_what_is_cut_out_leaves_its_share_and_its_rims(kind, n_rims):
    ball = make_sphere(4)
    cut = perturb(ball, kind, 0.1)
    assert area(cut.mesh) / area(ball) == pytest.approx(0.9, abs=0.01)
    assert (cut.mesh.vertices == ball.vertices[cut.origin]).all()
    # Discs may run into each other, and cut a crumb off that is left out.
    assert 1 <= diagnose(cut.mesh).boundary_loops <= n_rims


def test_decimation_keeps_the_surface():
    pytest.importorskip("fast_simplification")
    coarse = perturb(BALL, "decimation", 0.25)
    assert coarse.mesh.n_faces == pytest.approx(0.25 * BALL.n_faces, rel=0.02)
    assert np.abs(np.linalg.norm(coarse.mesh.vertices, axis=1) - 1).max() < 0.05
    away = np.linalg.norm(BALL.vertices[coarse.origin] - coarse.mesh.vertices, axis=1)
    assert away.max() < mean_edge(BALL)


def test_decimation_without_its_extra_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "fast_simplification", None)
    with pytest.raises(MissingExtraError, match="pip install fast-simplification"):
        perturb(BALL, "decimation", 0.5)


def test_the_same_each_time():
    for kind, strength in (("noise", 0.5), ("holes", 0.1), ("shortcut", 2)):
        one, other = perturb(dog(), kind, strength).mesh, perturb(dog(), kind, strength).mesh
        assert (one.vertices == other.vertices).all()
        assert (one.faces == other.faces).all()


def test_an_unknown_kind_is_refused():
    with pytest.raises(InputError, match="no perturbation 'fire'"):
        perturb(BALL, "fire", 1)
