"""Rows that repeat."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from unbend.mesh import count_repeats, first_equal_row

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
