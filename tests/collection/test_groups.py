"""Groups without labels: clusters that are there are found."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from sklearn.metrics import silhouette_score

from unbend.collection import find_groups
from unbend.collection._groups import silhouette
from unbend.errors import InputError

CHANCE = np.random.default_rng(0)
CENTRES = np.array([[0, 0], [9, 0], [0, 9]])
LABELS = np.repeat([0, 1, 2], [4, 9, 6])
POINTS = CENTRES[LABELS] + 0.5 * CHANCE.normal(size=(19, 2))


def test_clusters_are_found_the_largest_first() -> None:
    order = CHANCE.permutation(19)
    found = find_groups(cdist(POINTS[order], POINTS[order]))
    np.testing.assert_array_equal(found, np.array([2, 0, 1])[LABELS[order]])


def test_as_many_as_asked_for() -> None:
    table = cdist(POINTS, POINTS)
    for n in (1, 2, 5, 19):
        assert len(np.unique(find_groups(table, n))) == n
    with pytest.raises(InputError, match="from 1 to 19, the number of shapes, not 20"):
        find_groups(table, 20)


@pytest.mark.parametrize(("table", "n", "most"), [(np.zeros((4, 4)), 3, 1), (1 - np.eye(4), 2, 1)])
def test_what_is_equally_far_apart_is_not_separated_by_chance(table, n, most) -> None:
    with pytest.raises(InputError, match=f"{n} groups would separate .*; ask for {most}, or"):
        find_groups(table, n)
    np.testing.assert_array_equal(find_groups(1 - np.eye(4), 4), np.arange(4))


@pytest.mark.parametrize("n", [1, 2])
def test_few_shapes(n: int) -> None:
    table = 1.0 - np.eye(n)
    np.testing.assert_array_equal(find_groups(table), np.zeros(n))
    np.testing.assert_array_equal(find_groups(table, n), np.arange(n))


def test_none_and_three() -> None:
    assert len(find_groups(np.zeros((0, 0)))) == 0
    places = np.array([0.0, 9.0, 0.1])
    assert find_groups(np.abs(places[:, None] - places)).tolist() == [0, 1, 0]


def test_few_that_are_far_off_do_not_hide_the_groups_of_the_others() -> None:
    table = cdist(*2 * [np.vstack([POINTS, POINTS[:3] + 200])])
    assert len(np.unique(find_groups(table))) == 4


def test_at_most_50_groups_are_tried() -> None:
    places = np.repeat(np.arange(60.0) ** 2, 2)  # 60 pairs
    assert len(np.unique(find_groups(np.abs(places[:, None] - places)))) == 50


def test_the_silhouette_is_scikit_learns() -> None:
    table = cdist(POINTS, POINTS)
    pair = np.append([3, 3], LABELS[2:])
    for labels in (LABELS, np.minimum(LABELS, 1), np.append(LABELS[:-1], 3), pair):
        ours = silhouette(table, labels)
        np.testing.assert_allclose(ours, silhouette_score(table, labels, metric="precomputed"))
    assert silhouette(table, np.zeros(19, dtype=int)) == 0


@pytest.mark.parametrize(
    ("row", "column", "value", "message"),
    [
        (0, 1, 5.0, "symmetric"),
        (3, 3, 1.0, "0 on the diagonal"),
        (2, 1, np.nan, "finite"),
        (2, 1, -1.0, "none negative"),
    ],
)
def test_what_are_no_distances_are_refused(row, column, value, message) -> None:
    """SciPy would take the upper half for the whole."""
    distances = cdist(POINTS, POINTS)
    distances[row, column] = value
    with pytest.raises(InputError, match=message):
        find_groups(distances)


def test_rounding_is_let_through() -> None:
    distances = cdist(POINTS, POINTS)
    rounded = distances + 1e-12 * np.triu(np.ones((19, 19)), 1)
    np.testing.assert_array_equal(find_groups(rounded), find_groups(distances))
