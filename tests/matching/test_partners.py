"""Who has no partner: truths about a ball and the same ball with a cap cut off."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sheets import make_sheet
from testshapes.damage import keep
from unbend import Mesh
from unbend._types import BoolArray, IntArray
from unbend.datasets import make_sphere
from unbend.matching._inputs import prepare_shape
from unbend.matching._partners import cycle_consistent, keep_matched
from unbend.matching._shape import Shape

pytestmark = pytest.mark.usefixtures("as_meshed")

BALL = make_sphere(3)
NEAR = 0.3, 0.3


class Bitten(NamedTuple):
    whole: Shape
    part: Shape
    cap: BoolArray  # (n, 1), what the part lacks
    size: float  # how much longer the whole is where the part is: both have unit area
    origin: IntArray  # of the part's vertices, in the whole


def _bitten(least: float, ball: Mesh = BALL) -> Bitten:
    lacking = ball.vertices[:, 2] > least
    bitten = keep(ball, ~lacking)
    whole, part = (prepare_shape(one, 20, partial=True).shape for one in (ball, bitten.mesh))
    lengths = (
        np.linalg.norm(np.subtract(*one.vertices[ends]))
        for one, ends in ((part, [0, -1]), (whole, bitten.origin[[0, -1]]))
    )
    return Bitten(whole, part, lacking[:, None], float(np.divide(*lengths)), bitten.origin)


@pytest.fixture(scope="module", params=[0.0, 0.6, 0.9], ids=["half", "cap", "small cap"])
def bitten(request: pytest.FixtureRequest) -> Bitten:
    return _bitten(request.param)


def _kept(
    one: Bitten, overlap: BoolArray, times: float = 1.0, near: tuple[float, float] = NEAR
) -> BoolArray:
    size = np.full(overlap.shape[1], times * one.size)
    nearest = cKDTree(one.whole.vertices[one.origin]).query(one.whole.vertices)[1]
    point_maps = nearest[:, None].repeat(overlap.shape[1], axis=1)
    return keep_matched(one.whole, one.part, overlap, size, point_maps, near)


def _cap(shape: Shape, direction: tuple[float, float, float], least: float) -> BoolArray:
    rays = shape.vertices / np.linalg.norm(shape.vertices, axis=1, keepdims=True)
    return np.asarray(rays @ direction > least)[:, None]


def test_a_rim_is_as_long_as_its_circle(bitten: Bitten) -> None:
    height = bitten.whole.vertices[~bitten.cap[:, 0], 2].max() * np.sqrt(4 * np.pi)
    circle = 2 * np.pi * np.sqrt(1 - height**2) / np.sqrt(4 * np.pi)
    # A rim along edges goes in zigzags.
    assert 0.95 * circle < bitten.part.boundary_length / bitten.size < 1.35 * circle
    assert bitten.whole.boundary_length == 0


@pytest.mark.kernels
def test_what_the_rim_cuts_off_stays_without_partner(bitten: Bitten) -> None:
    np.testing.assert_array_equal(_kept(bitten, ~bitten.cap), ~bitten.cap)


@pytest.mark.kernels
def test_an_outline_much_longer_than_the_rim_is_none(bitten: Bitten) -> None:
    # A pinhole at the pole cuts off nothing like a hemisphere; nor does a rim a fifth as long.
    pricked = _bitten(0.97)
    assert _kept(pricked, ~_cap(pricked.whole, (0.0, 0.0, 1.0), 0.2)).all()
    assert _kept(bitten, ~bitten.cap, 5.0).all()
    np.testing.assert_array_equal(_kept(bitten, ~bitten.cap, 1.5), ~bitten.cap)


@pytest.mark.kernels
@pytest.mark.parametrize("axis", [0, 1])
def test_the_outline_of_half_a_square_is_as_long_as_its_side(axis: int) -> None:
    square = prepare_shape(make_sheet(12), 20, partial=True).shape
    half = (square.vertices[:, axis] > 0)[:, None]
    for length, kept in ((0.33, True), (0.34, False)):
        square.__dict__["boundary_length"] = length
        overlap = keep_matched(square, square, ~half, np.ones(1), np.arange(144)[:, None], NEAR)
        np.testing.assert_array_equal(overlap, ~half | kept)


@pytest.mark.kernels
def test_each_patch_and_each_map_is_looked_at_by_itself() -> None:
    pricked = _bitten(0.97)
    wide = _cap(pricked.whole, (0.0, 0.0, -1.0), 0.3)
    small = _cap(pricked.whole, (0.77, 0.0, 0.64), 0.97) | pricked.cap
    none = np.zeros_like(wide)
    lacking = ~_kept(pricked, ~np.hstack([none, small, wide, small | wide]))
    np.testing.assert_array_equal(lacking, np.hstack([none, small, none, small]))


@pytest.mark.parametrize("subdivisions", [pytest.param(3, marks=pytest.mark.kernels), 5])
def test_a_ragged_outline_is_as_good_as_a_smooth_one(subdivisions: int) -> None:
    """Partners are uncertain within a tenth of the outline, however fine the mesh is."""
    one = _bitten(0.3, make_sphere(subdivisions))
    height = one.whole.vertices[:, 2] * np.sqrt(4 * np.pi)
    chance = np.random.default_rng(2).random(len(height))
    overlap = ((height < 0.3) ^ ((np.abs(height - 0.3) < 0.1) & (chance < 0.4)))[:, None]
    kept = _kept(one, overlap)[:, 0]
    assert kept[height < 0.1].all()
    assert not kept[height > 0.5].any()


@pytest.mark.kernels
@pytest.mark.parametrize("near", [0.15, 0.3])
def test_only_what_ends_near_the_rim_has_no_partner(bitten: Bitten, near: float) -> None:
    """Of two small caps, one is less far off and one farther, by a mean edge and a rim's zigzag."""
    height = np.arcsin(bitten.whole.vertices[~bitten.cap[:, 0], 2].max() * np.sqrt(4 * np.pi))
    for off, kept in ((near - 0.08, False), (near + 0.08, True)):
        # Angles of the middle, half a cap farther than its nearest end.
        middle = height - 2 * np.arcsin(off / bitten.size * np.sqrt(np.pi)) - 0.3
        cap = _cap(bitten.whole, (np.cos(middle), 0.0, np.sin(middle)), np.cos(0.3))
        assert cap.any()
        assert not (cap & bitten.cap).any()
        np.testing.assert_array_equal(_kept(bitten, ~cap, near=(near, near)), ~cap | kept)


@pytest.mark.kernels
@pytest.mark.parametrize(("angle", "kept"), [(0.3, True), (0.4, False)])
def test_a_patch_too_small_for_a_part_must_end_nearer(angle: float, kept: bool) -> None:
    """Caps of a 50th and a 25th of the area, about as far from the rim."""
    one = _bitten(0.6)
    middle = np.arcsin(0.6) - 0.4 - angle
    cap = _cap(one.whole, (np.cos(middle), 0.0, np.sin(middle)), np.cos(angle))
    overlap = _kept(one, ~cap, near=(0.05, 0.3))
    np.testing.assert_array_equal(overlap, ~cap | kept)


@pytest.mark.kernels
def test_without_a_rim_nothing_is_without_partner_unless_all_is(bitten: Bitten) -> None:
    n = len(bitten.cap)
    every, size = np.arange(n)[:, None], np.ones(1)
    ball = bitten.whole
    assert keep_matched(ball, ball, ~bitten.cap, size, every, NEAR).all()
    none = np.zeros((n, 1), dtype=bool)
    assert not keep_matched(ball, ball, none, size, every, NEAR).any()


def test_nothing_that_was_given_is_changed(bitten: Bitten) -> None:
    overlap = ~_cap(bitten.whole, (0.0, 0.0, -1.0), 0.1)
    before = overlap.copy()
    _kept(bitten, overlap, 10.0)
    np.testing.assert_array_equal(overlap, before)


def test_a_map_and_its_inverse_lead_back_and_others_do_not(bitten: Bitten) -> None:
    n = len(bitten.whole.vertices)
    forward = np.random.default_rng(0).permutation(n)[:, None]
    backward = np.argsort(forward, axis=0)
    assert cycle_consistent(bitten.whole, forward, backward).all()
    away = np.linalg.norm(bitten.whole.vertices - bitten.whole.vertices[5], axis=1)
    for edges, others in ((1.9, []), (2.3, [5])):
        backward[forward[5]] = np.argmin(np.abs(away - edges * bitten.whole.edge))
        off = ~cycle_consistent(bitten.whole, forward, backward)
        assert off.ravel().nonzero()[0].tolist() == others
