"""The Green's operator against a dense pseudoinverse, whatever the areas add up to."""

import numpy as np
import pytest

from tests.linalg.problems import laplacian, scattered
from unbend.linalg.pseudoinverse import green_operator


@pytest.mark.parametrize("unit", [0.1, 1.0, 7.0])
def test_all_but_the_constants_is_inverted(unit):
    stiffness, areas = laplacian(*scattered(80, 1))
    areas = areas * unit
    load = np.random.default_rng(0).standard_normal((80, 3))
    found = green_operator(stiffness, areas)(load)
    np.testing.assert_allclose(areas @ found, 0, atol=1e-10)
    expected = load - areas[:, None] * load.sum(axis=0) / areas.sum()
    np.testing.assert_allclose(stiffness @ found, expected, atol=1e-9)
    np.testing.assert_allclose(green_operator(stiffness, areas)(load[:, 0]), found[:, 0])
