"""Average linkage, against its definition."""

import numpy as np
import pytest

from unbend.report.collection_figures import apart, join_alike


def test_joins_are_as_high_as_the_mean_distance_between_their_branches() -> None:
    points = np.random.default_rng(3).random((9, 2))
    distances = np.linalg.norm(points[:, None] - points, axis=2)
    order, heights, places = join_alike(distances)
    assert sorted(order) == list(range(9))
    # A bracket's ends are at the middles of its branches, which are leaves or brackets before it.
    members = {float(i): {int(order[i])} for i in range(9)}
    rows = sorted(zip(heights, places, strict=True), key=lambda row: row[0][1])
    for height, ends in rows:
        first, second = members.pop(ends[0]), members.pop(ends[3])
        mean = distances[np.ix_(list(first), list(second))].mean()
        assert height[1] == height[2] == pytest.approx(mean)
        members[(ends[0] + ends[3]) / 2] = first | second
    assert len(members) == 1


def test_what_is_unknown_is_far_apart() -> None:
    table = np.array([[1.0, 0.9, np.nan], [0.9, 1.0, 0.2], [np.nan, 0.2, 1.0]])
    np.testing.assert_allclose(apart(table), [[0, 0.1, 1], [0.1, 0, 0.8], [1, 0.8, 0]])
