"""Who has no partner: truths about a ball and the same ball with a cap cut off."""

from typing import NamedTuple

import numpy as np
import pytest

from unbend._types import BoolArray, FloatArray, IntArray
from unbend.datasets import keep, make_sphere
from unbend.matching._inputs import prepare_shape
from unbend.matching._partners import keep_matched, leads_back
from unbend.matching._shape import Shape

BALL = make_sphere(3)
_SIZE = np.ones(1)


class Bitten(NamedTuple):
    whole: Shape
    part: Shape
    back: IntArray  # (m, 1), of the part's vertices on the whole
    cap: BoolArray  # (n, 1), what the part lacks


def _bitten(least: float) -> Bitten:
    lacking = BALL.vertices[:, 2] > least
    bitten = keep(BALL, ~lacking)
    whole = prepare_shape(BALL, 20, True, partial=True).shape
    part = prepare_shape(bitten.mesh, 20, True, partial=True).shape
    # Both in the whole's unit, so that the size is 1.
    return Bitten(whole, part, np.asarray(bitten.origin)[:, None], lacking[:, None])


@pytest.fixture(scope="module", params=[0.0, 0.6, 0.9], ids=["half", "cap", "small cap"])
def bitten(request: pytest.FixtureRequest) -> Bitten:
    return _bitten(request.param)


def _kept(one: Bitten, within: BoolArray, size: FloatArray = _SIZE) -> BoolArray:
    # How much longer the whole is where the part is: both have unit area for the matcher.
    longer = np.linalg.norm(one.part.vertices[0] - one.part.vertices[-1]) / np.linalg.norm(
        np.subtract(*one.whole.vertices[one.back[[0, -1], 0]])
    )
    return keep_matched(one.whole, one.part, within, one.back, size * longer)


def _patch(shape: Shape, toward: tuple[float, float, float], least: float) -> BoolArray:
    directions = shape.vertices / np.linalg.norm(shape.vertices, axis=1, keepdims=True)
    return np.asarray(directions @ toward > least)[:, None]


@pytest.mark.kernels
def test_what_the_rim_cuts_off_stays_without_partner(bitten: Bitten) -> None:
    np.testing.assert_array_equal(_kept(bitten, ~bitten.cap), ~bitten.cap)


@pytest.mark.kernels
def test_what_is_away_from_the_rim_keeps_its_partner(bitten: Bitten) -> None:
    elsewhere = _patch(bitten.whole, (0.0, 0.0, -1.0), 0.8)
    np.testing.assert_array_equal(_kept(bitten, ~(bitten.cap | elsewhere)), ~bitten.cap)
    assert _kept(bitten, ~elsewhere).all()


@pytest.mark.kernels
def test_each_map_is_looked_at_by_itself(bitten: Bitten) -> None:
    elsewhere = _patch(bitten.whole, (0.0, 0.0, -1.0), 0.8)
    none = np.zeros_like(elsewhere)
    within = ~np.hstack([none, bitten.cap, elsewhere, bitten.cap | elsewhere])
    several = bitten._replace(back=np.repeat(bitten.back, 4, axis=1))
    kept = ~_kept(several, within, np.ones(4))
    np.testing.assert_array_equal(kept, np.hstack([none, bitten.cap, none, bitten.cap]))


@pytest.mark.kernels
def test_an_outline_much_longer_than_the_rim_is_none() -> None:
    # A pinhole at the pole cuts off no hemisphere, and one in pose a third as long does not either.
    small = _bitten(0.97)
    assert _kept(small, ~_patch(small.whole, (0.0, 0.0, 1.0), 0.2)).all()
    half = _bitten(0.0)
    assert _kept(half, ~half.cap, np.array([3.0])).all()
    np.testing.assert_array_equal(_kept(half, ~half.cap, np.array([1.5])), ~half.cap)


def test_nothing_that_was_given_is_changed(bitten: Bitten) -> None:
    within = ~_patch(bitten.whole, (0.0, 0.0, -1.0), 0.8)
    before = within.copy()
    _kept(bitten, within)
    np.testing.assert_array_equal(within, before)


def test_a_map_and_its_inverse_lead_back_and_others_do_not(bitten: Bitten) -> None:
    n = len(bitten.whole.vertices)
    forward = np.random.default_rng(0).permutation(n)[:, None]
    backward = np.argsort(forward, axis=0)
    assert leads_back(bitten.whole, forward, backward).all()
    far = np.argmax(np.linalg.norm(bitten.whole.vertices - bitten.whole.vertices[5], axis=1))
    backward[forward[5]] = far
    assert (~leads_back(bitten.whole, forward, backward)).ravel().nonzero()[0].tolist() == [5]
