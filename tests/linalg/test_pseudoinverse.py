"""The Green's operator against a dense pseudoinverse, whatever the areas add up to."""

import numpy as np
import pytest
import scipy.linalg

from tests.linalg.problems import icosphere, laplacian, scattered, square
from unbend.linalg import pseudoinverse
from unbend.linalg.pseudoinverse import green_and_diagonal, green_operator, pinned


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


def stretched(levels, lengths):
    vertices, faces = icosphere(levels)
    return vertices * lengths, faces


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("unit", [0.1, 1.0, 7.0])
@pytest.mark.parametrize(
    "surface",
    [
        *(scattered(n, n) for n in (4, 9, 30, 80, 300)),
        *(icosphere(levels) for levels in range(4)),
        *(stretched(2, lengths) for lengths in ([1, 1, 30], [1, 1, 0.02])),
        square(12),
    ],
)
def test_diagonals_are_those_of_the_dense_kernels(surface, unit, compiled, monkeypatch):
    """By solves for all columns, and by selected inversion."""
    monkeypatch.setattr(pseudoinverse, "_COMPILED_PAYS", 0 if compiled else 10**9)
    stiffness, areas = laplacian(*surface)
    areas = areas * unit
    values, functions = scipy.linalg.eigh(stiffness.toarray(), np.diag(areas))
    for biharmonic, power in ((False, 1), (True, 2)):
        expected = (functions[:, 1:] ** 2 / values[1:] ** power).sum(axis=1)
        green, found = green_and_diagonal(stiffness, areas, biharmonic=biharmonic)
        np.testing.assert_allclose(found, expected, rtol=1e-9)
    load = np.random.default_rng(0).standard_normal((len(areas), 2))
    expected = green_operator(stiffness, areas)(load)
    np.testing.assert_allclose(green(load), expected, atol=1e-11 * abs(expected).max())
