"""The two-level Green's operator against the factorised one."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st

from tests.linalg.problems import laplacian, square
from unbend.datasets import make_quadruped
from unbend.errors import SolverError
from unbend.linalg import two_level
from unbend.linalg.lanczos import smallest_eigenpairs
from unbend.linalg.pseudoinverse import green_operator
from unbend.linalg.two_level import two_levels
from unbend.mesh import aggregate_vertices
from unbend.spectral import make_surface


@pytest.fixture(scope="module")
def operator():
    return make_surface(make_quadruped(n_vertices=800).mesh).operator


@given(seed=st.integers(0, 10**6), n_coarse=st.integers(5, 200))
def test_any_aggregates_give_the_factorised_answer(operator, seed, n_coarse):
    chance = np.random.default_rng(seed)
    n = len(operator.areas)
    aggregates = np.concatenate([np.arange(n_coarse), chance.integers(0, n_coarse, n - n_coarse)])
    green, _ = two_levels(operator.stiffness, operator.areas, aggregates)
    load = chance.standard_normal((n, 3))
    wanted = green_operator(operator.stiffness, operator.areas)(load)
    assert np.abs(green(load) - wanted).max() < 1e-7 * np.abs(wanted).max()
    assert np.allclose(green(load[:, 0]), wanted[:, 0], atol=1e-7 * np.abs(wanted).max())
    guess = chance.standard_normal((n, 3)) * np.abs(wanted).max()
    assert np.abs(green(load, guess) - wanted).max() < 1e-7 * np.abs(wanted).max()
    assert np.abs(green(load, wanted, 1e-6) - wanted).max() < 1e-12 * np.abs(wanted).max()


def test_a_column_that_is_solved_does_not_end_the_others(operator):
    n = len(operator.areas)
    load = np.random.default_rng(0).standard_normal((n, 3))
    load[:, 1] = 0
    wanted = green_operator(operator.stiffness, operator.areas)(load)
    green, _ = two_levels(operator.stiffness, operator.areas, np.arange(n) // 40)
    assert np.abs(green(load) - wanted).max() < 1e-7 * np.abs(wanted).max()


@pytest.mark.parametrize("side", [32, 96])
def test_a_larger_surface_needs_no_more_steps(side, monkeypatch):
    """That is what the coarse level is for: without it the steps grow with the side."""
    monkeypatch.setattr(two_level, "_MOST_STEPS", 50)
    row, column = np.divmod(np.arange(side**2), side)
    stiffness, areas = laplacian(*square(side))
    green, _ = two_levels(stiffness, areas, row // 4 * (side // 4) + column // 4)
    load = np.random.default_rng(0).standard_normal(side**2)
    load -= areas * load.sum() / areas.sum()
    assert np.linalg.norm(stiffness @ green(load) - load) < 1e-9 * np.linalg.norm(load)


def test_rough_eigenfunctions_are_nearly_those_of_the_lowest_values(operator):
    n = len(operator.areas)
    near = aggregate_vertices(make_quadruped(n_vertices=800).mesh, 250)
    _, rough = two_levels(operator.stiffness, operator.areas, near)
    found = rough(4)
    assert found.shape == (n, 4)
    energies = found.T @ (operator.stiffness @ found)
    masses = found.T @ (operator.areas[:, None] * found)
    lowest = smallest_eigenpairs(operator.stiffness, operator.areas, 5)[0][1:]
    reached = scipy.linalg.eigh(energies, masses, eigvals_only=True)
    assert (reached >= lowest * (1 - 1e-9)).all()
    assert (reached < 2 * lowest).all()


def test_rounding_errors_in_the_sum_of_a_residual_do_no_harm(operator):
    """No solution has them; kept, they would be all that is left to solve for."""
    n = len(operator.areas)
    load = np.random.default_rng(0).standard_normal((n, 2))
    wanted = green_operator(operator.stiffness, operator.areas)(load)
    green, _ = two_levels(operator.stiffness, operator.areas, np.arange(n) // 4)
    far = green(load, wanted + 1e4, 1e-12)
    assert np.abs(far - wanted).max() < 1e-10 * np.abs(wanted).max()


def test_what_does_not_converge_is_refused(operator, monkeypatch):
    monkeypatch.setattr(two_level, "_MOST_STEPS", 2)
    n = len(operator.areas)
    green, _ = two_levels(operator.stiffness, operator.areas, np.arange(n) // 40)
    with pytest.raises(SolverError, match="more coarse vertices"):
        green(np.random.default_rng(0).standard_normal(n))
