"""Rows that repeat, and the largest of entries that rounding tells apart."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from unbend._arrays import count_repeats, first_equal_row, first_largest, nearest_rows, snap

VALUES = st.sampled_from([-1.0, -0.0, 0.0, 2.0, np.nan])


@given(st.lists(st.tuples(VALUES, VALUES), max_size=12))
def test_the_first_equal_row_is_found(rows: list[tuple[float, float]]) -> None:
    # A list, not its tuples, so that NaN objects are compared by value.
    expected = [
        next((j for j, other in enumerate(rows) if np.equal(other, row).all()), i)
        for i, row in enumerate(rows)
    ]
    array = np.array(rows, dtype=np.float64).reshape(-1, 2)
    assert first_equal_row(array).tolist() == expected
    assert count_repeats(array) == sum(i != j for i, j in enumerate(expected))


def test_of_what_only_rounding_tells_apart_the_first_is_the_largest() -> None:
    values = np.array([[0.1, -np.inf, 0.0], [0.3, 2.0, 0.0], [0.1 + 0.2, 2.0 + 1e-9, 0.0]])
    assert first_largest(values).tolist() == [1, 1, 0]
    assert first_largest(np.array([1.0, 1.0001])) == 1
    assert first_largest(np.array([1 - 1.5e-6, 1.0])) == 1
    assert first_largest(np.array([1 - 0.5e-6, 1.0])) == 0
    assert first_largest(np.array([-1.0, 0.0])) == 1


def test_rows_that_differ_by_little_differ() -> None:
    assert first_equal_row(np.array([[1e-20], [0.0], [-0.0]])).tolist() == [0, 1, 1]


def test_what_should_be_equal_is_equal_on_the_grid_and_what_is_infinite_stays() -> None:
    values = np.array([0.1 + 0.2, 0.3, 7.0, np.inf, np.nan, -0.3])
    found = snap(values)
    assert found[0] == found[1] == -found[5]
    np.testing.assert_allclose(found, values, rtol=1e-7)
    assert snap(np.array([1.0, 0.6 * 2**-26, 0.4 * 2**-26])).tolist() == [1, 2**-26, 0]
    for unit in (2.0**-40, 2.0**40):
        np.testing.assert_array_equal(snap(values[:3] * unit), found[:3] * unit)
    assert np.isnan(snap(np.array([np.nan]))).all()
    assert snap(np.zeros(3)).tolist() == [0, 0, 0]
    assert snap(np.array([1e-310])) == 0  # too small for a grid


def test_rounding_does_not_choose_between_neighbours() -> None:
    chance = np.random.default_rng(0)
    targets = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    points = np.zeros((50, 3))
    points[:, 2] = np.arange(50)
    for _ in range(10):
        noise = 1e-14 * chance.standard_normal(points.shape)
        assert len(np.unique(nearest_rows(points + noise, targets))) == 1
    assert nearest_rows(targets * 1.1, targets).tolist() == [0, 1, 2, 3]
