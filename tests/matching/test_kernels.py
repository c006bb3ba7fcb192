"""The matcher's compiled loops against plain NumPy, on small input; run uncompiled too."""

import numpy as np
import pytest

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
