"""Rows that repeat, and the largest of entries that rounding tells apart."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from unbend._arrays import count_repeats, first_equal_row, first_largest

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
