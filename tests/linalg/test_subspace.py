"""Subspace iteration against a dense solver, with solves that are as inexact as they may be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from unbend.errors import SolverError
from unbend.linalg.subspace import subspace_iteration


@given(seed=st.integers(0, 10**6), k=st.integers(1, 4), noise=st.floats(0, 1))
def test_the_leading_eigenpairs_are_found(seed, k, noise):
    chance = np.random.default_rng(seed)
    n, b = 60, k + 5
    frame = np.linalg.qr(chance.standard_normal((n, n)))[0]
    values = np.sort(chance.uniform(0.1, 1, n) / np.arange(1, n + 1) ** 2)[::-1]
    root = (frame * np.sqrt(values)) @ frame.T

    def solves(block, guesses, tol):
        images = []
        for _ in range(2):
            block = root @ block
            error = chance.standard_normal(block.shape) / np.sqrt(n)
            block = block + noise * tol * np.linalg.norm(block, axis=0) * error
            images.append(block)
        return images

    start = frame[:, :b] + 0.1 * chance.standard_normal((n, b))
    found, vectors, residual = subspace_iteration(solves, start, k, tol=1e-6)
    assert residual <= 1e-6
    assert np.allclose(found[:k], values[:k], atol=1e-5 * values[0])
    assert np.allclose(vectors.T @ vectors, np.eye(k), atol=1e-10)
    image = root @ root @ vectors
    assert np.linalg.norm(image - vectors * found[:k], axis=0).max() < 1e-5 * values[0]


def test_guesses_come_ever_nearer():
    frame = np.linalg.qr(np.random.default_rng(0).standard_normal((40, 40)))[0]
    values = 2.0 ** -np.arange(40)
    operator = (frame * values) @ frame.T
    errors = []

    def solves(block, guesses, tol):
        image = operator @ block
        if guesses[0] is not None:
            errors.append(np.linalg.norm(guesses[0][:, -2:] - image[:, -2:]) / values[0])
        return [image]

    start = frame[:, :8] + 0.05 * frame[:, 8:16]
    subspace_iteration(solves, start, 2, tol=1e-9)
    assert len(errors) >= 2
    assert (np.diff(np.log(errors)) < 0).all()


def test_what_stands_still_is_refused():
    chance = np.random.default_rng(0)
    with pytest.raises(SolverError, match="stay at a residual of"):
        subspace_iteration(
            lambda block, guesses, tol: [chance.standard_normal(block.shape)],
            chance.standard_normal((30, 4)),
            2,
            tol=1e-6,
        )


@pytest.mark.parametrize("spread", [1e-9, 0.0, np.nan])
def test_vectors_that_fall_together_are_refused(spread):
    """Their inner products are then no Gram matrix, but for rounding."""
    chance = np.random.default_rng(0)
    start = chance.standard_normal((30, 4))

    def solves(block, guesses, tol):
        return [block[:, :1] + spread * chance.standard_normal(block.shape)]

    with pytest.raises(SolverError, match=r"too far apart|NaN"):
        subspace_iteration(solves, start, 2, tol=1e-14)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_one_solve_that_went_wrong_is_told(bad):
    """The images of the other vectors are as they should be."""
    chance = np.random.default_rng(0)

    def solves(block, guesses, tol):
        image = block.copy()
        image[:, -1] = bad
        return [image]

    told = pytest.raises(SolverError, match="the solves returned NaN or infinite values")
    with told, np.errstate(invalid="ignore"):
        subspace_iteration(solves, chance.standard_normal((30, 4)), 2, tol=1e-6)


@pytest.mark.parametrize("column", [0, 2])
def test_a_start_without_direction_is_refused(column):
    start = np.random.default_rng(0).standard_normal((30, 4))
    start[:, column] = 0
    with pytest.raises(SolverError, match="too far apart"):
        subspace_iteration(lambda block, *_: [block], start, 2, tol=1e-6)


@pytest.mark.parametrize("goal", [1e-4, 1e-8])
def test_solves_are_no_more_exact_than_the_vectors_call_for(goal):
    """First by far less than in the end, and never by much more than what is asked for."""
    chance = np.random.default_rng(0)
    frame = np.linalg.qr(chance.standard_normal((40, 40)))[0]
    operator = (frame * 0.7 ** np.arange(40)) @ frame.T
    asked, left = [], []

    def solves(block, guesses, tol):
        image = operator @ block
        asked.append(tol)
        values, rotation = np.linalg.eigh(block.T @ image)
        apart = image @ rotation - block @ rotation * values
        left.append(np.linalg.norm(apart[:, -2:], axis=0).max() / values[-1])
        return [image]

    subspace_iteration(solves, chance.standard_normal((40, 6)), 2, tol=goal)
    assert len(asked) > 4
    assert min(asked) >= goal / 100
    # Each is asked for a share of what the last vectors lacked, and no more than that.
    assert all(0.001 * was < tol < 0.1 * was for was, tol in zip(left[:-1], asked[1:], strict=True))
    assert asked[0] > 1e-4


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_units_change_no_step(unit):
    """A residual counts in units of the largest value."""
    chance = np.random.default_rng(0)
    frame = np.linalg.qr(chance.standard_normal((40, 40)))[0]
    values = 0.8 ** np.arange(40)
    start = chance.standard_normal((40, 6))

    def found(unit):
        operator = (frame * values * unit) @ frame.T
        return subspace_iteration(lambda block, *_: [operator @ block], start, 2, tol=1e-6)

    np.testing.assert_allclose(found(unit)[0], unit * found(1.0)[0])
    np.testing.assert_allclose(found(unit)[0][:2], unit * values[:2], rtol=1e-6)
