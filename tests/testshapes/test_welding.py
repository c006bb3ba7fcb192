"""Welds join parts that are near in space and far on the surface."""

from functools import cache

import numpy as np
import pytest

from testshapes.measures import along_edges
from testshapes.welding import fuse, touching, weld
from unbend import diagnose
from unbend.datasets import make_quadruped, make_sphere
from unbend.errors import InputError


@cache
def dog():
    return make_quadruped("sitting", n_vertices=600).mesh


@pytest.mark.parametrize("n_tubes", [1, 4])
def test_each_tube_is_a_handle(n_tubes):
    welded = weld(dog(), n_tubes, random_state=0)
    found = diagnose(welded.mesh)
    assert diagnose(dog()).genus == 0
    assert found.genus == n_tubes
    assert found.closed
    assert found.non_manifold_edges == found.non_manifold_vertices == found.inconsistent_edges == 0
    assert (welded.mesh.vertices == dog().vertices).all()


def test_parts_that_touch_are_near_in_space_and_far_on_the_shape():
    here, there = touching(dog(), np.random.default_rng(0))
    gap = np.linalg.norm(dog().vertices[here] - dog().vertices[there])
    way = along_edges(dog(), np.array([here]))[0]
    assert way[there] > 0.4 * way.max()
    assert way[there] > 3 * gap
    # No other vertex as far away on the shape is nearer in space.
    gaps = np.linalg.norm(dog().vertices - dog().vertices[here], axis=1)
    assert gap <= 1.5 * gaps[way >= way[there]].min()


def test_the_truth_of_a_weld_is_that_nothing_moved():
    welded = weld(dog(), 2, random_state=1)
    np.testing.assert_array_equal(welded.origin, np.arange(dog().n_vertices))
    np.testing.assert_array_equal(welded.image, np.arange(dog().n_vertices))
    here, there = touching(dog(), np.random.default_rng(1))
    before = along_edges(dog(), np.array([here]))[0, there]
    assert along_edges(welded.mesh, np.array([here]))[0, there] < 0.5 * before


@pytest.mark.parametrize("share", [0.0, 0.005, 0.03])
def test_fused_parts_lose_the_patch_and_make_one_handle(share):
    for seed in range(3):
        fused = fuse(dog(), share, random_state=seed)
        found = diagnose(fused.mesh)
        assert found.genus == 1
        assert found.closed
        assert found.non_manifold_edges == found.non_manifold_vertices == 0
        assert found.inconsistent_edges == found.degenerate_faces == found.duplicate_faces == 0
        assert (fused.mesh.vertices == dog().vertices[fused.origin]).all()
        np.testing.assert_array_equal(fused.image[fused.origin], np.arange(len(fused.origin)))
        n_lost = dog().n_vertices - len(fused.origin)
        assert 2 <= n_lost <= max(2, 3 * share * dog().n_vertices)


def test_more_tubes_than_there_is_room_for_are_refused():
    with pytest.raises(InputError, match="room for"):
        weld(make_sphere(2), 500, random_state=0)
