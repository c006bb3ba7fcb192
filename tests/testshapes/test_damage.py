"""Cuts take what they say, leave good surfaces, and keep the truth."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testshapes.damage import Damaged, cut, cut_discs, damaged_truth, keep
from testshapes.measures import along_edges, area
from testshapes.scanning import add_noise, seen_from
from unbend import diagnose
from unbend.datasets import make_biped, make_sphere, rest_map
from unbend.errors import InputError


@cache
def body():
    return make_biped("running", n_vertices=900)


def assert_consistent(damaged: Damaged, whole) -> None:
    """What is left is part of the whole, and both tables say the same."""
    assert (damaged.mesh.vertices == whole.vertices[damaged.origin]).all()
    np.testing.assert_array_equal(damaged.image[damaged.origin], np.arange(len(damaged.origin)))
    assert (damaged.image >= 0).sum() == len(damaged.origin)
    faces = {tuple(face) for face in whole.faces.tolist()}
    assert {tuple(face) for face in damaged.origin[damaged.mesh.faces].tolist()} <= faces


def assert_manifold_with_rims(damaged: Damaged) -> None:
    found = diagnose(damaged.mesh)
    assert len(found.component_faces) == 1
    assert found.boundary_loops >= 1
    assert found.non_manifold_edges == found.non_manifold_vertices == found.inconsistent_edges == 0


@pytest.mark.parametrize(("share", "n_discs"), [(0.05, 1), (0.4, 1), (0.05, 8), (0.4, 8)])
def test_discs_take_the_share_of_the_area_that_was_asked(share, n_discs):
    for seed in range(2):
        torn = cut_discs(body().mesh, share, n_discs, random_state=seed)
        assert_consistent(torn, body().mesh)
        assert_manifold_with_rims(torn)
        assert 1 - area(torn.mesh) / area(body().mesh) == pytest.approx(share, abs=0.011)


def test_on_a_sphere_a_disc_is_exact():
    ball = make_sphere(4)
    for share in (0.02, 0.5):
        torn = cut_discs(ball, share, random_state=1)
        assert 1 - area(torn.mesh) / area(ball) == pytest.approx(share, abs=0.002)
        assert diagnose(torn.mesh).boundary_loops == 1
    middle = np.random.default_rng(1).choice(ball.n_vertices, 1, replace=False)
    away = along_edges(ball, middle)[0]
    gone = np.setdiff1d(np.arange(ball.n_vertices), torn.origin)
    assert away[gone].max() <= away[torn.origin].min() + 0.1


@settings(max_examples=8)
@given(st.floats(0.01, 0.9), st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: sum(map(abs, d))))
def test_a_plane_takes_one_side(share, direction):
    ball = make_sphere(3)
    height = ball.vertices @ (np.array(direction) / np.linalg.norm(direction))
    left = cut(ball, height, share)
    assert_consistent(left, ball)
    assert 1 - area(left.mesh) / area(ball) == pytest.approx(share, abs=0.02)
    # A spherical cap's share of the area is its share of the height.
    assert height[left.origin].min() == pytest.approx(2 * share - 1, abs=0.2)


def test_a_cut_limb_is_gone_and_nothing_else():
    for name in ("left_arm", "right_leg"):
        wanted = body().labels != body().parts.index(name)
        left = keep(body().mesh, wanted)
        assert_consistent(left, body().mesh)
        assert_manifold_with_rims(left)
        assert wanted[left.origin].all()
        assert len(left.origin) > 0.97 * wanted.sum()


def test_the_truth_between_parts_is_that_of_the_wholes():
    one = body()
    other = make_biped("sitting", n_vertices=1000, meshing=1)
    truth = rest_map(one, other)
    source = cut_discs(one.mesh, 0.2, random_state=3)
    target = cut_discs(other.mesh, 0.3, 4, random_state=4)
    left = damaged_truth(truth, source, target)
    assert len(left) == source.mesh.n_vertices
    found = left >= 0
    np.testing.assert_array_equal(target.origin[left[found]], truth[source.origin[found]])
    gone = np.setdiff1d(np.arange(other.mesh.n_vertices), target.origin)
    assert np.isin(truth[source.origin[~found]], gone).all()
    np.testing.assert_array_equal(damaged_truth(truth), truth)
    # What had no partner has none afterwards.
    assert (damaged_truth(np.full(900, -1), source, target) == -1).all()


def test_overlapping_parts_share_what_neither_lost():
    height = body().rest[:, 1]
    lower, upper = cut(body().mesh, -height, 0.25), cut(body().mesh, height, 0.25)
    truth = damaged_truth(np.arange(900), lower, upper)
    shared = keep(body().mesh, (lower.image >= 0) & (upper.image >= 0))
    assert area(shared.mesh) / area(body().mesh) == pytest.approx(0.5, abs=0.08)
    assert abs(int((truth >= 0).sum()) - shared.mesh.n_vertices) < 60


def test_damage_upon_damage():
    first = cut_discs(body().mesh, 0.2, random_state=0)
    second = cut_discs(first.mesh, 0.2, random_state=1)
    both = first.then(second)
    assert_consistent(both, body().mesh)
    noisy = both.then(add_noise(both.mesh, 0.1, random_state=0))
    np.testing.assert_array_equal(noisy.origin, both.origin)
    np.testing.assert_array_equal(noisy.image, both.image)


def test_rims_that_touch_are_parted():
    """Two holes that share a vertex only, cut into a sphere."""
    ball = make_sphere(3)
    middle = 7
    ring = np.unique(ball.faces[(ball.faces == middle).any(axis=1)])
    ring = ring[ring != middle]
    opposite = ring[np.linalg.norm(ball.vertices[ring] - ball.vertices[ring[0]], axis=1).argmax()]
    wanted = np.ones(ball.n_vertices, dtype=bool)
    wanted[[ring[0], opposite]] = False
    assert_manifold_with_rims(keep(ball, wanted))


@pytest.mark.parametrize("share", [-0.1, 1.0, 2.0])
def test_a_share_that_is_none_is_refused(share):
    with pytest.raises(InputError, match="from 0 to less than 1"):
        cut_discs(body().mesh, share)


def test_nothing_cut_is_everything_kept():
    assert cut_discs(body().mesh, 0.0).mesh.n_faces == body().mesh.n_faces
    seen = seen_from(make_sphere(2), (1, 0, 0))
    assert_consistent(seen, make_sphere(2))
