"""The judge: truths about its energy."""

import functools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sheets import make_sheet, make_torus
from unbend import Mesh
from unbend._types import IntArray
from unbend.datasets import make_biped, make_sphere
from unbend.matching import _constants as constants
from unbend.matching._inputs import prepare_shape
from unbend.matching._plan import COARSE, MEDIUM, best
from unbend.matching._registration import Pose, Registered
from unbend.matching._score import (
    Candidate,
    _unexplained,
    in_one_unit,
    lead_shares,
    missed_landmarks,
    nearly_as_good,
    plausibility,
    ranked,
    rough_costs,
    roundness_bound,
    scored,
    unexplained,
)
from unbend.matching._shape import Proxy, Shape

pytestmark = pytest.mark.usefixtures("as_meshed")


@functools.cache
def _person() -> Shape:
    return prepare_shape(make_biped("walking", n_vertices=1000).mesh, 30)[1]


def _sheet(side: int) -> Shape:
    return prepare_shape(make_sheet(side), 10)[1]


def _identity(shape: Shape) -> Registered:
    every = np.arange(len(shape.vertices))
    pose = Pose(shape.vertices, np.tile(np.eye(3), (len(every), 1, 1)), every >= 0)
    return Registered(every, every, pose, pose)


def _loss(shape: Shape, images: np.ndarray) -> float:
    return shape.areas @ _unexplained(shape, images, np.ones(len(images), dtype=bool))


@pytest.mark.filterwarnings("ignore:mesh. .* unreferenced")
def test_a_round_shape_hardly_shows_its_turn() -> None:
    ball, sheet = make_sphere(3), make_sheet(32)
    x, y, z = ball.vertices.T
    pot = np.stack([x * (1.5 + z), y * (1.5 + z), 3 * z], axis=1)
    handle = pot + np.where((x > 0.8)[:, None], [0.6, 0, 0], 0)
    middle = sheet.vertices.mean(axis=0)
    disc = sheet.faces[np.linalg.norm(sheet.vertices - middle, axis=1)[sheet.faces].max(1) < 0.5]
    bounds = [
        roundness_bound(prepare_shape(Mesh(*one), 10)[1])
        for one in (
            (pot, ball.faces),
            (pot, ball.faces[(z < 0.5)[ball.faces].all(axis=1)]),
            (make_torus(40, 20).vertices, make_torus(40, 20).faces),
            (sheet.vertices, disc),
            (handle, ball.faces),
            (sheet.vertices, sheet.faces),
        )
    ]
    assert max(bounds[:4]) < 0.5
    assert min(bounds[4:]) == roundness_bound(_person()) == 1


@pytest.mark.filterwarnings("ignore:mesh. .*robust Laplacian")
@pytest.mark.parametrize("power", [4, 6, 7, 7.5, 8, 8.2])
def test_a_needle_does_not_show_its_turn(power: float) -> None:
    ball = make_sphere(2)
    needle = Mesh(ball.vertices * [10**power, 1, 1], ball.faces)
    assert roundness_bound(prepare_shape(needle, 10)[1]) < 0.5


def test_turns_and_scales_cost_nothing_and_mirrors_and_collapses_do() -> None:
    shape = _person()
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    assert 0 <= _loss(shape, 3 * shape.vertices @ turn.T + 5) < 1e-9
    assert 0 <= _loss(shape, shape.vertices) < 1e-9
    assert _loss(shape, shape.vertices * [-1, 1, 1]) > 0.2
    assert abs(_loss(shape, 0 * shape.vertices) - 1) < 1e-9


def test_rank_puts_the_gate_before_the_energy() -> None:
    shape = _person()
    identity = _identity(shape)
    right = scored(shape, shape, identity)
    assert right.energy < 1e-9
    assert right.orientation > 0.99
    assert not right.reflected
    assert scored(shape, shape, identity, True).reflected
    inside_out = identity.source._replace(places=shape.vertices * [-1, 1, 1])
    wrong = scored(shape, shape, identity._replace(source=inside_out, target=inside_out))
    assert wrong.orientation < 0
    assert ranked([wrong, right]) == [right]
    assert ranked([wrong]) == [wrong]


def test_distinct_maps_lead_to_other_limbs() -> None:
    shape = _person()
    identity = _identity(shape)
    order = np.argsort(shape.vertices[:, 1])
    shifted = np.empty_like(order)
    shifted[order] = np.roll(order, 1)  # each vertex to the next one up: another limb as a rule
    first = scored(shape, shape, identity)
    second = replace(first, registered=identity._replace(forward=shifted))
    assert _distinct(shape, [first, first]) == [first]
    assert _distinct(shape, [first, second]) == [first, second]


def _distinct(shape: Shape, candidates: list[Candidate]) -> list[Candidate]:
    every = np.arange(len(shape.areas))
    return best(_sides(shape, Proxy(shape, every, every)), COARSE, candidates)


def _sides(shape: Shape, target: Proxy) -> Any:
    """Sides of a source and a coarse copy of the target."""
    return SimpleNamespace(target=SimpleNamespace(proxies=[target]), at=lambda level: (shape, None))


def _hairpin(side: int) -> Mesh:
    """Fold a sheet in the middle: its ends are one over the other, 0.05 apart."""
    sheet = make_sheet(side)
    x, y, _ = sheet.vertices.T
    along = np.minimum(x, 1 - x)
    return Mesh(np.stack([along, y, 0.05 * np.tanh(20 * (x - 0.5))], axis=1), sheet.faces)


def test_limbs_that_touch_are_not_taken_for_each_other() -> None:
    shape = prepare_shape(_hairpin(15), 10).shape
    ends = np.array([0, len(shape.areas) - 15])  # two corners, one over the other
    shape = replace(shape, landmarks=ends)
    identity = _identity(shape)
    swap = np.arange(len(shape.areas)).reshape(15, 15)[::-1].ravel()
    swapped = Registered(swap, swap, identity.source, identity.target)
    first = scored(shape, shape, identity)
    second = replace(first, registered=swapped)
    assert np.linalg.norm(shape.vertices - shape.vertices[swap], axis=1).max() < 0.22
    assert _distinct(shape, [first, second]) == [first, second]
    np.testing.assert_array_equal(first.missed, [False, False])
    np.testing.assert_array_equal(scored(shape, shape, swapped).missed, [True, True])


def test_maps_on_finer_vertices_are_compared_through_those_that_stand_for_them() -> None:
    shape = _sheet(9)
    one = scored(shape, shape, _identity(shape))
    other = replace(one, registered=one.registered._replace(forward=one.registered.forward[::-1]))
    corners = np.array([0, 8, 72, 80])
    distances = shape.distances[np.ix_(corners, corners)]
    nearest = shape.distances[corners].argmin(axis=0)
    for parents, expected in ((nearest, [one, other]), (np.zeros(81, dtype=int), [one])):
        coarse = Proxy(SimpleNamespace(distances=distances), corners, parents)
        assert best(_sides(shape, coarse), MEDIUM, [one, other]) == expected


def test_maps_differ_where_more_than_a_limb_s_end_leads_to_another_limb() -> None:
    # More than three hundredths of the area, by more than 0.22 of its root.
    shape = _sheet(41)
    n = len(shape.areas)
    every = np.arange(n)
    ones = scored(shape, shape, _identity(shape))
    for share, far, expected in (
        (0.045, 0.33, True),
        (0.02, 0.33, False),
        (0.9, 0.15, False),
    ):
        at_end = np.argsort(shape.vertices[:, 0], kind="stable")[: round(share * n)]
        moved = shape.vertices + np.array([far, 0, 0])
        elsewhere = every.copy()
        elsewhere[at_end] = cKDTree(shape.vertices).query(moved[at_end])[1]
        other = replace(ones, registered=ones.registered._replace(forward=elsewhere))
        assert (len(_distinct(shape, [ones, other])) == 2) == expected


@pytest.mark.parametrize("stretch", [1.1, 1.5, 2.0, 4.0])
def test_the_energy_of_a_stretch_is_bounded_in_closed_form(stretch: float) -> None:
    # Of a patch's edges a share p lies along the stretch s; its correlation with its image,
    # (1 + (s - 1) p) / sqrt(1 + (s^2 - 1) p), is least at p = 1 / (s + 1).
    ball = prepare_shape(make_sphere(3), 10)[1]
    for shape in (ball, _person()):
        energy = _loss(shape, shape.vertices * [1, stretch, 1])
        most = 1 - 2 * np.sqrt(stretch) / (1 + stretch)
        assert most / 4 < energy < most


def test_a_map_to_one_vertex_explains_nothing_and_noise_little() -> None:
    shape = _person()
    n = len(shape.vertices)
    assert abs(_loss(shape, shape.vertices[np.zeros(n, dtype=int)]) - 1) < 1e-9
    chance = np.random.default_rng(0).permutation(n)
    assert _loss(shape, shape.vertices[chance]) > 0.6


def test_a_sheet_seen_from_behind_is_inside_out() -> None:
    square = make_sheet(9)
    sheet = Mesh(square.vertices * [1.4, 1, 1], square.faces)
    shape = prepare_shape(sheet, 10)[1]
    identity = _identity(shape)
    assert scored(shape, shape, identity).orientation == pytest.approx(1)
    flipped = np.arange(81).reshape(9, 9)[::-1].ravel()
    pose = identity.source._replace(places=shape.vertices[flipped])
    found = scored(shape, shape, Registered(flipped, flipped, pose, pose))
    assert found.orientation == pytest.approx(-1)
    # A sheet does not know its sides by shape: turned over, it is explained all the same.
    assert found.energy < 1e-9


def _judged(energy: float, orientation: float = 1.0) -> Candidate:
    none = np.zeros(0, dtype=bool)
    return Candidate(_identity(_person()), energy, orientation, False, none)


def test_of_equals_the_first_stays_first() -> None:
    worse, one, two = _judged(0.3), _judged(0.2 + 1e-12), _judged(0.2)
    assert ranked([worse, one, two]) == [one, two, worse]


def test_what_costs_hardly_more_is_nearly_as_good_and_so_is_all_that_is_rounding() -> None:
    first = _judged(0.2)
    assert nearly_as_good(_judged(0.22), first)
    assert not nearly_as_good(_judged(0.25), first)
    assert nearly_as_good(_judged(1e-9), _judged(1e-16))


def _trust(found: list[Candidate], disorder: float = 0.0, partial: bool = False) -> float:
    share = lead_shares(np.array([one.cost for one in found]), partial)[0]
    return float(share * plausibility(found[0].energy, disorder))


def test_maps_of_one_energy_share_the_probability() -> None:
    sure, unsure = _trust([_judged(0.0)]), _trust([_judged(0.9)])
    assert sure > 0.99
    assert unsure < 0.001
    assert _trust([_judged(0.1)] * 4) == pytest.approx(_trust([_judged(0.1)]) / 4)
    ahead = [_trust([_judged(0.1), _judged(0.1 + lead)]) for lead in (0.0, 0.02, 0.1)]
    assert ahead == sorted(ahead)
    assert ahead[-1] > 0.98


def test_areas_that_differ_lower_a_confidence_up_to_where_units_do() -> None:
    lowered = [in_one_unit(0.9, ratio) for ratio in (1, 1.3, 1.7, 2.5, 29)]
    assert lowered == sorted(lowered, reverse=True)
    assert lowered[0] == pytest.approx(0.9)
    assert lowered[-1] == pytest.approx(0.9 / (0.9 + 0.1 * 10))
    for confidence, ratio in ((0.9, 31), (0.9, 0), (0.9, np.inf), (0.0, 3), (1.0, 3)):
        assert in_one_unit(confidence, ratio) == confidence
    assert in_one_unit(0.9, 0.5) == pytest.approx(in_one_unit(0.9, 2))


def test_a_probability_falls_from_one_to_none_with_what_is_unexplained() -> None:
    alone = [_trust([_judged(energy)]) for energy in np.linspace(0, 1, 21)]
    assert alone == sorted(alone, reverse=True)
    assert all(0 <= trust <= 1 for trust in alone)


def test_odds_are_even_at_one_energy_and_as_e_to_one_at_one_lead() -> None:
    assert _trust([_judged(0.36)]) > 0.7 > 0.3 > _trust([_judged(0.46)])
    for cost in (0.1, 0.2):
        for lead, partial in (0.0313, False), (0.0626, True):
            first, other = lead_shares(np.array([cost, (1 + lead) * cost]), partial)
            assert first / other == pytest.approx(np.e)


def test_disorder_of_the_finished_map_counts_as_energy() -> None:
    """A map that explains little is trusted if it is in order; one that explains more is not."""
    alone = [_trust([_judged(0.22)], disorder) for disorder in np.linspace(0, 2, 21)]
    assert alone == sorted(alone, reverse=True)
    assert alone[0] > 0.95 > 0.05 > alone[4]
    assert _trust([_judged(0.2)], 0.1) == pytest.approx(_trust([_judged(0.345)]))


def test_a_lead_between_maps_of_parts_means_less() -> None:
    found = [_judged(0.1), _judged(0.106)]
    assert _trust(found, partial=True) < 0.75 < 0.85 < _trust(found)


def test_a_map_that_misses_a_landmark_is_behind_one_that_explains_no_more() -> None:
    misses, equal = replace(_judged(0.1), missed=np.array([True])), _judged(0.1)
    assert misses.cost > equal.cost == equal.energy
    assert replace(misses, missed=np.ones(3, dtype=bool)).cost == pytest.approx(
        0.1 + 3 * constants.MISSED
    )
    assert _trust([equal, misses]) > 0.99


def test_both_ways_count_alike_and_the_worse_one_is_the_side_that_is_out() -> None:
    shape = _person()
    every, _, pose, _ = _identity(shape)
    nowhere = pose._replace(places=np.zeros_like(shape.vertices))
    collapsed = Registered(every, np.zeros_like(every), pose, nowhere)
    turned = Registered(collapsed.backward, every, nowhere, pose)
    for one in (collapsed, turned):
        found = scored(shape, shape, one)
        distances = [shape.areas @ shares for shares in unexplained(shape, shape, one)]
        assert min(distances) < 0.1 < 0.5 < max(distances)
        assert found.energy == pytest.approx(sum(distances) / 2)
        assert abs(found.orientation) < 0.02


def test_what_is_mostly_right_side_out_goes_before_what_is_not() -> None:
    half, inside_out = _judged(0.3, orientation=0.4), _judged(0.1, orientation=-0.4)
    assert ranked([inside_out, half]) == [half]
    collapsed = _judged(0.1, orientation=0.0)
    assert ranked([collapsed, half]) == [half]


def test_a_landmark_is_missed_where_either_map_leads_elsewhere() -> None:
    shape = replace(_person(), landmarks=np.array([5, 400, 700]))
    n = len(shape.vertices)
    far = int(np.linalg.norm(shape.vertices - shape.vertices[400], axis=1).argmax())
    right, wrong = np.arange(n), np.arange(n)
    wrong[400] = far
    assert missed_landmarks(shape, shape, right, right).tolist() == [False, False, False]
    assert missed_landmarks(shape, shape, wrong, right).tolist() == [False, True, False]
    assert missed_landmarks(shape, shape, right, wrong).tolist() == [False, True, False]
    away = np.linalg.norm(shape.vertices - shape.vertices[400], axis=1)
    for off, missed in ((0.1, False), (0.2, True)):  # 0.15 is the limit
        wrong[400] = np.abs(away - off).argmin()
        assert missed_landmarks(shape, shape, wrong, right)[1] == missed


def test_a_rough_cost_is_the_mean_of_both_ways() -> None:
    shape = _person()
    n = len(shape.vertices)
    right, chance = np.arange(n), np.random.default_rng(0).permutation(n)
    both = np.stack([right, chance, right], axis=1)
    one, other, none = rough_costs(shape, shape, both, both[:, [1, 0, 0]])
    assert one == pytest.approx(other)
    assert one == pytest.approx(_loss(shape, shape.vertices[chance]) / 2)
    assert none == pytest.approx(0, abs=1e-9)


def _two_sheets() -> tuple[Shape, Shape, IntArray, IntArray]:
    """One square in few faces and in four times as many, each vertex to the nearest; corners."""
    few, many = (_sheet(side) for side in (5, 9))
    forward = cKDTree(many.vertices).query(few.vertices)[1]
    backward = cKDTree(few.vertices).query(many.vertices)[1]
    few = replace(few, landmarks=np.array([0, 4, 20, 24]))
    return few, replace(many, landmarks=forward[few.landmarks]), forward, backward


def test_two_meshes_of_one_surface_explain_each_other() -> None:
    few, many, forward, backward = _two_sheets()
    found = Registered(forward, backward, _identity(few).source, _identity(many).source)
    for one in (
        scored(few, many, found),
        scored(many, few, Registered(backward, forward, found.target, found.source)),
    ):
        assert one.energy < 1e-9
        assert one.orientation == pytest.approx(1)
        assert one.missed.tolist() == [False] * 4
    forward[0] = 80
    missed = scored(few, many, found).missed
    assert missed.tolist() == [True, False, False, False]


def test_a_rough_cost_counts_the_landmarks_that_are_missed() -> None:
    few, many, forward, backward = _two_sheets()
    none = np.zeros(0, dtype=np.int64)
    forward, backward = (np.stack([one, one, one], axis=1) for one in (forward, backward))
    forward[[0, 24], 1] = forward[[24, 0], 1]
    backward[8, 2] = 20
    costs = rough_costs(few, many, forward, backward)
    without = (replace(one, landmarks=none) for one in (few, many))
    added = costs - rough_costs(*without, forward, backward)
    np.testing.assert_allclose(added, np.array([0, 2, 1]) * constants.MISSED, atol=1e-12)


def test_a_bend_costs_as_much_either_way() -> None:
    sheet = _sheet(31)
    x, y, _ = sheet.vertices.T
    rolled = np.stack([np.sin(x), y, np.cos(x)], axis=1)  # nothing is stretched
    pose = _identity(sheet).source._replace(places=rolled)
    every = np.arange(len(x))
    bent = replace(sheet, vertices=rolled)
    back = Pose(sheet.vertices, pose.rotations, pose.overlap)
    found = scored(sheet, bent, Registered(every, every, pose, back))
    assert 0 < found.energy < 0.1
    assert found.energy == pytest.approx(_loss(sheet, rolled), rel=0.1)


def test_the_less_has_a_partner_the_more_does_what_is_left_out_cost() -> None:
    """Where what has a partner is explained, it alone costs something, of both shapes alike."""
    shape = _person()
    identity = _identity(shape)
    height = shape.vertices[:, 1]
    shares, energies = [], []
    for q in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        lacking = identity.source._replace(overlap=height >= np.quantile(height, q))
        found, *halves = (
            scored(shape, shape, Registered(*identity[:2], *poses)).energy
            for poses in (
                (lacking, lacking),
                (lacking, identity.target),
                (identity.source, lacking),
            )
        )
        assert halves == pytest.approx([found / 2, found / 2], abs=1e-9)
        shares.append(shape.areas @ lacking.overlap)
        energies.append(found)
    np.testing.assert_allclose(energies[:-1], -constants.WITHOUT * np.log(shares[:-1]), atol=1e-9)
    assert energies[1] == pytest.approx(constants.WITHOUT * (1 - shares[1]), rel=0.15)
    assert shares[-1] < constants.SMALLEST_PART  # less is not told apart
    least = -constants.WITHOUT * np.log(constants.SMALLEST_PART)
    assert energies[-2] < energies[-1] == pytest.approx(least)


def test_what_is_left_out_does_not_turn_a_surface() -> None:
    shape = _person()
    identity = _identity(shape)
    left_out = identity.source._replace(overlap=np.arange(len(shape.vertices)) % 2 == 0)
    found = scored(shape, shape, identity._replace(source=left_out, target=left_out))
    assert found.orientation == pytest.approx(scored(shape, shape, identity).orientation, abs=0.01)


def test_maps_that_differ_where_one_of_them_has_none_are_not_distinct() -> None:
    shape = _person()
    identity = _identity(shape)
    n = len(shape.vertices)
    overlap = np.arange(n) % 2 == 0
    elsewhere = np.where(overlap, np.arange(n), np.random.default_rng(0).permutation(n))
    partial = Registered(
        elsewhere, np.arange(n), identity.source._replace(overlap=overlap), identity.target
    )
    one, other = (replace(_judged(0.1), registered=found) for found in (identity, partial))
    assert _distinct(shape, [one, other]) == [one]
    every = replace(other, registered=partial._replace(source=identity.source))
    assert _distinct(shape, [one, every]) == [one, every]


def test_a_lead_tells_less_where_other_maps_leave_next_to_nothing_unexplained() -> None:
    costs = np.array([0.1, 0.11])
    featured, smooth = (lead_shares(f * costs, False)[0] for f in (1.0, 0.4))
    assert featured > 0.9
    assert 0.5 < smooth < 0.8


def test_what_coarse_meshes_of_a_copy_cost_decides_nothing() -> None:
    of_copies = [lead_shares(np.array([0.0, other]), False)[0] for other in (0.002, 0.02, 0.1)]
    assert of_copies[0] < 0.51
    assert of_copies[1] < 0.8
    assert of_copies[2] > 0.99
