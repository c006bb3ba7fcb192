"""Closest points on faces: on a flat square they are known."""

import numpy as np
import pytest
import scipy.sparse as sp

from unbend.correspondence._landing import Ground, land, make_ground

SIDE = 8
ALONE = sp.csr_matrix((4, 4))


@pytest.fixture(scope="module")
def square() -> Ground:
    """The unit square at z = 0, facing up, with a hole of one cell in the middle."""
    x, y = (one.ravel() for one in np.mgrid[: SIDE + 1, : SIDE + 1])
    column, row = (one.ravel() for one in np.mgrid[:SIDE, :SIDE])
    column, row = np.delete([column, row], 3 * SIDE + 4, axis=1)
    here = column * (SIDE + 1) + row
    there = here + SIDE + 1
    faces = np.stack([here, there, there + 1, here, there + 1, here + 1], axis=1).reshape(-1, 3)
    return make_ground(np.stack([x, y, 0 * x], axis=1) / SIDE, faces)


def landed(square: Ground, points, normal=(0, 0, 1)):
    normals = np.tile(np.array(normal, dtype=float), (4, 1))
    start = np.zeros(4, dtype=np.int64)
    return land(square, np.array(points), normals, ALONE, start, normal_weight=0.0, slack=0.01)


def test_points_fall_straight_down(square: Ground) -> None:
    points = [[0.31, 0.22, 0.1], [0.77, 0.91, -0.2], [0.9, 0.05, 0.3], [0.05, 0.6, 0.0]]
    found = landed(square, points)
    np.testing.assert_allclose(found.places[:, :2], np.array(points)[:, :2], atol=1e-12)
    np.testing.assert_allclose(found.distances, [0.1, 0.2, 0.3, 0], atol=1e-12)
    np.testing.assert_allclose(found.facing, [[0, 0, 1]] * 4, atol=1e-12)
    assert found.there.all()


def test_beyond_a_rim_there_is_nothing(square: Ground) -> None:
    hole = [3.5 / SIDE, 4.5 / SIDE, 0.05]
    found = landed(square, [hole, [1.1, 0.5, 0], [1.2, 1.2, 0.1], [1.005, 0.52, 0.2]])
    np.testing.assert_array_equal(found.there, [False, False, False, True])
    np.testing.assert_allclose(found.places[1:3], [[1, 0.5, 0], [1, 1, 0]], atol=1e-12)


def test_the_back_of_a_sheet_is_no_place(square: Ground) -> None:
    points = np.full((4, 3), 0.2)
    assert not landed(square, points, normal=(0, 0, -1)).there.any()
    turned = square.turned()
    assert landed(turned, points, normal=(0, 0, -1)).there.all()
