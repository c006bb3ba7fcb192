"""The Green's operator against a dense pseudoinverse, whatever the areas add up to."""

import numpy as np
import pytest

from tests.linalg.problems import laplacian, scattered
from unbend.linalg.pseudoinverse import green_operator, on_zero_means, pinned


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


def test_one_enlarged_entry_makes_it_definite():
    """And leaves every solution of loads that add up to zero, but for a constant."""
    stiffness, _ = laplacian(*scattered(80, 1))
    fixed = pinned(stiffness)
    assert np.linalg.eigvalsh(fixed.toarray()).min() > 0
    load = np.random.default_rng(0).standard_normal(80)
    load -= load.mean()
    found = np.linalg.solve(fixed.toarray(), load)
    np.testing.assert_allclose(stiffness @ found, load, atol=1e-9)


def test_further_arguments_reach_the_solver():
    given = []

    def solve(load, *options, **more):
        given.append((options, more))
        return load

    on_zero_means(solve, np.ones(3))(np.arange(3.0), "guess", tol=0.5)
    assert given == [(("guess",), {"tol": 0.5})]
