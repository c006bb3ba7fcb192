"""Average linkage, against its definition."""

import numpy as np
import pytest

from unbend.report.trees import apart, join_alike


def test_joins_are_as_high_as_the_mean_distance_between_their_branches() -> None:
    places = np.random.default_rng(3).random((9, 2))
    distances = np.linalg.norm(places[:, None] - places, axis=2)
    tree = join_alike(distances)
    assert sorted(tree.order) == list(range(9))
    # A bracket's ends are at the middles of its branches, which are leaves or brackets before it.
    members = {float(i): {int(tree.order[i])} for i in range(9)}
    rows = sorted(zip(tree.heights, tree.places, strict=True), key=lambda row: row[0][1])
    for heights, ends in rows:
        first, second = members.pop(ends[0]), members.pop(ends[3])
        mean = distances[np.ix_(list(first), list(second))].mean()
        assert heights[1] == heights[2] == pytest.approx(mean)
        members[(ends[0] + ends[3]) / 2] = first | second
    assert len(members) == 1


def test_what_is_unknown_is_far_apart() -> None:
    table = np.array([[1.0, 0.9, np.nan], [0.9, 1.0, 0.2], [np.nan, 0.2, 1.0]])
    np.testing.assert_allclose(apart(table), [[0, 0.1, 1], [0.1, 0, 0.8], [1, 0.8, 0]])
