"""The matcher's compiled loops against plain NumPy, on small input; run uncompiled too."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from unbend.alignment import nearest_rotation
from unbend.matching._score import largest_traces
from unbend.matching._shape import farthest_points

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("d", [1, 3, 6])
def test_every_chosen_point_is_the_farthest_from_those_before_it(d: int) -> None:
    points = np.random.default_rng(d).normal(size=(60, d))
    chosen = farthest_points(points, 20, 7)
    assert chosen[0] == 7
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    for i in range(1, 20):
        to_chosen = apart[chosen[:i]].min(axis=0)
        assert to_chosen[chosen[i]] == pytest.approx(to_chosen.max())
    assert len(np.unique(farthest_points(points, 60, 0))) == 60


def test_of_points_that_are_equally_far_the_first_is_chosen() -> None:
    points = np.array([[0.0, 0], [3, 4], [1, 1], [5, 0], [-4, 3], [0, -5]])
    np.testing.assert_array_equal(farthest_points(points, 3, 0), [0, 1, 4])


def test_largest_traces_are_those_of_the_nearest_rotations() -> None:
    rng = np.random.default_rng(0)
    matrices = rng.standard_normal((40, 3, 3)) * 10.0 ** rng.integers(-9, 9, (40, 1, 1))
    turns = Rotation.random(8, random_state=0).as_matrix()
    flat = turns @ (rng.standard_normal((8, 3, 1)) * rng.standard_normal((8, 1, 3)))  # of rank 1
    equal = [np.eye(3), -np.eye(3), np.diag([1.0, 1, -1]), np.diag([2.0, 2, 1]), np.zeros((3, 3))]
    left, right = (Rotation.random(60, random_state=seed).as_matrix() for seed in (1, 2))
    alike = [left @ np.diag(one) @ right for one in ([2.0, 2, 1], [3, 0.5, 0.5])]
    matrices = np.concatenate([equal, matrices, turns, -turns, flat, *alike])
    best = nearest_rotation(matrices.transpose(0, 2, 1))
    expected = np.einsum("iab,iba->i", best, matrices)
    sizes = np.linalg.norm(matrices, axis=(1, 2))
    # What should be 0 is the root of rounding.
    assert (np.abs(largest_traces(matrices) - expected) <= 1e-7 * sizes).all()
