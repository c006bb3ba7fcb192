"""Nearest neighbours both ways against all distances, written out; run uncompiled too."""

import numpy as np
import pytest

from unbend.alignment import _nearest, nearest_pairs

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("task", [1, 1000, 64_000_000])
def test_pairs_are_the_nearest_of_all(monkeypatch, task: int) -> None:
    monkeypatch.setattr(_nearest, "_TASK", task)
    rng = np.random.default_rng(0)
    source, target = rng.normal(size=(5, 30, 4)), rng.normal(size=(20, 4))
    squares = ((source[:, :, None] - target) ** 2).sum(axis=3)
    found = nearest_pairs(source, target)
    assert found.forward.shape == (5, 30)
    assert found.backward.shape == (5, 20)
    ahead = np.take_along_axis(squares, found.forward[:, :, None], axis=2)[:, :, 0]
    back = np.take_along_axis(squares, found.backward[:, None, :], axis=1)[:, 0]
    np.testing.assert_allclose(ahead, squares.min(axis=2), atol=1e-4)
    np.testing.assert_allclose(back, squares.min(axis=1), atol=1e-4)
    mean = (squares.min(axis=2).mean(axis=1) + squares.min(axis=1).mean(axis=1)) / 2
    np.testing.assert_allclose(found.residual, np.sqrt(mean), rtol=1e-4)


def test_of_equals_the_first_is_taken() -> None:
    source = np.array([[[0.0], [0.0], [4.0]]])
    found = nearest_pairs(source, np.array([[1.0], [-1.0], [4.0], [4.0]]))
    np.testing.assert_array_equal(found.forward, [[0, 0, 2]])
    np.testing.assert_array_equal(found.backward, [[0, 0, 2, 2]])


def test_of_one_point_the_nearest_is_it_alone() -> None:
    source, target = np.ones((2, 1, 3)), np.random.default_rng(0).normal(size=(3000, 3))
    lengths = np.linalg.norm(target - 1, axis=1)
    found = nearest_pairs(source, target)
    assert (found.backward == 0).all()
    np.testing.assert_allclose(lengths[found.forward], lengths.min(), rtol=1e-4)
    expected = np.sqrt(((lengths**2).mean() + lengths.min() ** 2) / 2)
    np.testing.assert_allclose(found.residual, expected, rtol=1e-5)


def test_points_upon_each_other_have_no_residual() -> None:
    points = np.random.default_rng(0).normal(size=(40, 6))
    order = np.random.default_rng(1).permutation(40)
    found = nearest_pairs(points[None], points[order])
    np.testing.assert_array_equal(order[found.forward[0]], np.arange(40))
    np.testing.assert_array_equal(found.backward[0], order)
    assert found.residual[0] < 2e-3  # a squared distance is known to 32 bits of the lengths'
