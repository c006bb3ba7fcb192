"""Rotations, motions and far points against plain NumPy; compiled loops run uncompiled too."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from unbend.alignment import farthest_points, largest_traces, nearest_rotation
from unbend.alignment._motions import lay


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


@pytest.mark.kernels
def test_laid_is_what_is_near_and_faces_alike_and_half_of_what_is_beyond() -> None:
    goal = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    up = np.tile([0.0, 0, 1], (3, 1))
    grid = np.array([0, 1, -1]).reshape(3, 1, 1)  # nearest to the third is a boundary
    points, areas = np.array([[0.0, 0, 0], [1, 0, 0.1], [2, 0, 0]]), np.array([0.5, 0.25, 0.125])
    given = (grid, np.zeros(3), 1.0), goal, up, 0.2
    turns = Rotation.from_euler("x", [[0], [90], [0]], degrees=True).as_matrix()
    shifts, sizes = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 0.3]]), np.array([1.0, 1.0, 1.0])
    laid, larger = np.zeros(3), np.zeros(1)
    lay((points, up, areas), (turns, shifts, sizes), *given, laid)
    near = 0.25 * (1 - 0.1**2 / 0.2**2)
    assert laid == pytest.approx([0.5 + near + 0.0625, 0.0625, 0.0625])
    # A size of 4 leads the second point beyond the grid, to what is nearest in it; and the reach is
    # between the lengths of the one shape and those of the other.
    larger_motion = turns[:1], shifts[:1] + 0.1, 4 * sizes[:1]
    lay((points[:2], up[:2], areas[:2]), larger_motion, *given, larger)
    assert larger == pytest.approx(0.5 * (1 - 0.03 / (4 * 0.2**2)) + 0.125)


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
