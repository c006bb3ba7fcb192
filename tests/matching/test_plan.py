"""The plan of a match: what comes out of it, with all of its steps and without any one of them."""

import functools
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from animals import person
from testshapes.damage import Damaged, keep
from unbend import Mesh
from unbend._types import IntArray
from unbend.datasets import Shape as Body
from unbend.datasets import make_quadruped, make_sphere, rest_map
from unbend.matching import _constants as constants
from unbend.matching import _plan
from unbend.matching._extremities import find_extremities
from unbend.matching._inputs import prepare_shape
from unbend.matching._plan import (
    COARSE,
    MEDIUM,
    PLAN,
    Sides,
    Stage,
    Step,
    best,
    candidates,
    differences,
    distinct,
    from_extremities,
    from_forms,
    from_motions,
    kept_extremities,
    lifted,
    make_sides,
)
from unbend.matching._polish import refined
from unbend.matching._registration import Pose, Registered, mapped_start
from unbend.matching._score import Candidate, scored
from unbend.matching._shape import Shape, make_proxy

pytestmark = pytest.mark.usefixtures("as_meshed")

_source = functools.partial(person, "standing", n_vertices=600)
_target = functools.partial(person, "walking", n_vertices=500, meshing=1)


@functools.cache
def _truth() -> IntArray:
    return rest_map(_source(), _target())


@functools.cache
def _without_arm() -> Damaged:
    return keep(_source().mesh, _source().labels != _source().parts.index("left_arm"))


def test_the_page_on_how_matching_works_shows_the_plan() -> None:
    page = Path(__file__).parents[2] / "docs" / "how-matching-works.md"
    shown = re.findall(r"^\| (coarse|medium) \| `(\w+)` \|", page.read_text("utf-8"), re.MULTILINE)
    levels = {COARSE: "coarse", MEDIUM: "medium"}
    assert shown == [(levels[step.level], step.stage.__name__) for step in PLAN]


def _shape(mesh: Mesh, *, partial: bool = False) -> Shape:
    return prepare_shape(mesh, 60, partial).shape


def _error(point_map: IntArray, target: Body, truth: IntArray) -> float:
    """Mean distance to where vertices belong, in sqrt(area); -1 has no partner."""
    goal = _shape(target.mesh).vertices
    some = point_map >= 0
    return float(np.linalg.norm(goal[point_map[some]] - goal[truth[some]], axis=1).mean())


def test_candidates_differ_by_the_distance_between_where_they_lead(
    parts: Sides, of_parts: Candidate
) -> None:
    first = of_parts
    pose, n = first.registered.source, len(first.registered.forward)
    first = replace(first, registered=first.registered._replace(source=_with_overlap(pose, n, 3)))
    other = replace(
        first,
        registered=first.registered._replace(
            forward=np.roll(first.registered.forward, 1), source=_with_overlap(pose, n, 5)
        ),
    )
    none, apart = differences(parts, [first, other])
    assert not none.any()
    target = parts.target.proxies[COARSE]
    images = target.parents[first.registered.forward]
    every = np.delete(np.arange(n), [3, 5])
    np.testing.assert_array_equal(
        apart[every], target.shape.distances[np.roll(images, 1), images][every]
    )
    assert apart[3] == 0  # the first leaves it without partner
    assert apart[5] == constants.LIMB  # the other does


def test_candidates_that_are_right_together_are_given_once(box: Sides) -> None:
    found = candidates(box)  # a box is led to itself in two ways at least, equally well
    apart = differences(box, found).mean(axis=1)
    others = np.flatnonzero(apart > constants.LIMB)
    ranks = [found[0], found[0], found[others[0]], found[0]]
    assert distinct(box, ranks, 4) == [0, 2]
    assert distinct(box, ranks, 1) == [0]


def _with_overlap(pose: Pose, n: int, without: int) -> Pose:
    return pose._replace(overlap=np.arange(n) != without)


def _candidate(cost: float, orientation: float = 1.0) -> Candidate:
    return Candidate(None, cost, orientation, False, np.zeros(0, dtype=bool))


@pytest.fixture(scope="module")
def bodies() -> Sides:
    """Two poses of one body, of fewer vertices than the finer proxies may have."""
    return make_sides(_shape(_source().mesh), _shape(_target().mesh))


@pytest.fixture(scope="module")
def told() -> list[tuple[str, float]]:
    """Progress that the search for candidates reports."""
    return []


@pytest.fixture(scope="module")
def found(bodies: Sides, told: list[tuple[str, float]]) -> list[Candidate]:
    return candidates(bodies, lambda *step: told.append(step))


@pytest.fixture(scope="module")
def parts() -> Sides:
    """The same, the source without an arm."""
    return make_sides(_shape(_without_arm().mesh, partial=True), _shape(_target().mesh))


@pytest.fixture(scope="module")
def of_parts(parts: Sides) -> Candidate:
    """The best candidate for them."""
    return candidates(parts)[0]


@pytest.mark.parametrize("stage", [from_motions, from_forms])
def test_what_lays_parts_proposes_the_right_map(stage: Stage, parts: Sides) -> None:
    coarse, target = (side.proxies[COARSE] for side in (parts.source, parts.target))
    truth = target.parents[_truth()[_without_arm().origin[coarse.kept]]]
    first = stage(parts, [])[0]
    off = target.shape.distances[first.registered.forward, truth]
    assert first.registered.source.overlap.mean() > 0.9
    assert off.mean() < 0.06


@pytest.fixture(scope="module")
def boxes() -> list[Shape]:
    """A rounded box, which half turns and mirrors leave the same, and as others would round it."""
    ball = make_sphere(2)
    box = ball.vertices * [1.6, 1.0, 0.7]
    found = []
    for seed in range(4):
        noise = 1e-15 * np.random.default_rng(seed).standard_normal(box.shape)
        found.append(prepare_shape(Mesh(box + noise, ball.faces), 40).shape)
    return found


@pytest.fixture(scope="module")
def box(boxes: list[Shape]) -> Sides:
    return make_sides(boxes[0], boxes[0])


def _box_turned(box: Sides, level: int, signs: list[int]) -> Registered:
    """Registration of proxies of a box that changes the signs of coordinates."""
    shapes = box.at(level)
    way = cKDTree(shapes[1].vertices).query(shapes[0].vertices * signs)[1]
    return mapped_start(*shapes, way, way, 1.0)


def test_the_first_candidate_is_the_known_map_and_the_others_cost_more(
    bodies: Sides, found: list[Candidate]
) -> None:
    assert _error(found[0].registered.forward, _target(), _truth()) < 0.05
    assert _error(found[0].registered.backward, _source(), rest_map(_target(), _source())) < 0.05
    assert found[0].orientation > 0.9
    costs = [one.cost for one in found]
    assert costs == sorted(costs)
    # A person back to front is nearly the same person. Refinement does not mend that map.
    right, rival = (refined(bodies, one).registered.forward for one in found[:2])
    assert _error(right, _target(), _truth()) < 0.05
    assert _error(rival, _target(), _truth()) > 0.1


def test_the_search_reports_its_progress(
    found: list[Candidate], told: list[tuple[str, float]]
) -> None:
    assert {stage for stage, _ in told} == {"search"}
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert shares[0] > 0
    assert shares[-1] == 1


def test_a_part_is_found_on_the_whole(parts: Sides, of_parts: Candidate) -> None:
    first = of_parts.registered
    assert _error(first.forward, _target(), _truth()[_without_arm().origin]) < 0.05
    arm = _target().labels == _target().parts.index("left_arm")
    end = arm & (first.target.overlap == 0)
    areas = parts.target.shape.areas
    assert areas[end].sum() > 0.7 * areas[arm].sum()
    assert parts.source.shape.areas @ first.source.overlap > 0.95


def test_landmarks_choose_among_what_a_symmetry_makes_equal(box: Sides) -> None:
    """Two vertices are said to be led to where a half turn leads them."""
    points = box.source.shape.vertices
    every = np.arange(len(points))
    turn = cKDTree(points).query(points * [-1, 1, -1])[1]
    ends = points[:, 0].argsort()[[0, -1]]
    ours, theirs = (replace(box.source.shape, landmarks=way[ends]) for way in (every, turn))
    first, *others = candidates(make_sides(ours, theirs))
    assert not first.missed.any()
    assert all(one.cost > first.cost or not one.missed.any() for one in others)
    assert np.abs(points[first.registered.forward[ends]] - points[turn[ends]]).max() < 0.1


def test_rounding_does_not_choose_what_is_looked_at(boxes: list[Shape]) -> None:
    first, *others = boxes
    coarse = make_proxy(first, 200)
    for shape in others:
        np.testing.assert_array_equal(shape.samples, first.samples)
        np.testing.assert_array_equal(
            find_extremities(shape).vertices, find_extremities(first).vertices
        )
        np.testing.assert_array_equal(make_proxy(shape, 200).kept, coarse.kept)


def test_rounding_does_not_choose_among_maps_that_a_symmetry_makes_equal(
    boxes: list[Shape],
) -> None:
    every = np.arange(len(boxes[0].vertices))
    for shape in boxes[::3]:
        found = candidates(make_sides(shape, shape))
        assert max(one.energy for one in found[:4]) < 1e-6  # itself and three half turns
        np.testing.assert_array_equal(found[0].registered.forward, every)


def test_the_mirror_image_of_the_target_gives_the_mirrored_maps(box: Sides) -> None:
    points = box.source.shape.vertices
    for one in candidates(box.reflected())[:4]:
        assert one.reflected
        assert one.energy < 1e-6
        assert one.orientation > 0.99  # of the mirror image, so the map turns inside out
        images = points[one.registered.forward]
        signs = np.sign((images * points).sum(axis=0))
        np.testing.assert_allclose(images, points * signs, atol=1e-9)
        assert signs.prod() == -1


@pytest.mark.parametrize("level", [COARSE, MEDIUM])
def test_the_best_lead_to_different_places_the_cheapest_first(box: Sides, level: int) -> None:
    signs = [[1, 1, 1], [1, 1, 1], [-1, -1, 1], [-1, 1, -1]]
    dear, cheap, other, third = (
        replace(_candidate(cost), registered=_box_turned(box, level, one))
        for cost, one in zip((0.3, 0.1, 0.2, 0.15), signs, strict=True)
    )
    assert best(box, level, [dear, other, third, cheap]) == [cheap, third, other]
    assert best(box, level, []) == []


def _true(bodies: Sides) -> Candidate:
    """Where vertices belong, as coarse copies have it."""
    ours, theirs = (one.proxies[COARSE] for one in (bodies.source, bodies.target))
    ahead = theirs.parents[_truth()[ours.kept]]
    back = ours.parents[rest_map(_target(), _source())[theirs.kept]]
    coarse = bodies.at(COARSE)
    return scored(*coarse, mapped_start(*coarse, ahead, back, 1.0))


def test_a_right_map_stays_right_on_its_way_to_finer_copies(bodies: Sides) -> None:
    (found,) = lifted(bodies, [_true(bodies)])
    assert _error(found.registered.forward, _target(), _truth()) < 0.05


def test_what_is_lifted_stays_what_it_is(box: Sides) -> None:
    signs = [[1, 1, 1], [-1, -1, 1]]
    begun = [replace(_candidate(0.1), registered=_box_turned(box, COARSE, one)) for one in signs]
    points = box.source.shape.vertices
    for one, found in zip(signs, lifted(box, begun), strict=True):
        np.testing.assert_allclose(points[found.registered.forward], points * one, atol=1e-6)


def test_of_two_that_lead_to_the_same_place_the_better_one_on_finer_copies_stays(
    bodies: Sides, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which one costs less on coarse copies does not say which one will."""
    right = _true(bodies)
    pose = right.registered.source
    wide = right.registered._replace(source=pose._replace(places=1.3 * pose.places))
    spread = replace(right, registered=wide)
    goal = min(one.cost for one in lifted(bodies, [spread, right]))
    for costs in (0.1, 0.11), (0.11, 0.1):
        begun = [
            replace(one, energy=cost) for one, cost in zip((spread, right), costs, strict=True)
        ]
        plan = [Step(COARSE, functools.partial(_given, [one]), 1) for one in begun]
        monkeypatch.setattr(_plan, "PLAN", plan)
        (one,) = candidates(bodies)
        assert one.cost == pytest.approx(goal)


def _given(found: list[Candidate], *_: object) -> list[Candidate]:
    return found


def test_extremities_propose_the_truth_of_an_upper_part_and_a_whole(bodies: Sides) -> None:
    height = _source().mesh.vertices[:, 1]
    upper = keep(_source().mesh, height > np.quantile(height, 0.4))
    sides = make_sides(_shape(upper.mesh, partial=True), bodies.target.shape)
    ours, theirs = (one.proxies[COARSE] for one in sides[:2])
    goal = sides.target.shape.vertices
    right = goal[_truth()[upper.origin][ours.kept]]
    off = [
        np.linalg.norm(goal[theirs.kept[one.registered.forward]] - right, axis=1).mean()
        for one in from_extremities(sides, [_candidate(0.9)])
    ]
    assert min(off) < 0.1


def test_a_pair_is_partial_if_either_shape_is(bodies: Sides, parts: Sides) -> None:
    assert not bodies.partial
    assert parts.partial
    assert parts._replace(source=parts.target, target=parts.source).partial


def test_extremities_that_stay_where_they_are_are_counted() -> None:
    one = prepare_shape(make_quadruped(n_vertices=600).mesh, 30, partial=True)
    sides = make_sides(one.shape, one.shape).reflected()
    best = candidates(sides)[0]
    kept, among = kept_extremities(sides, best)
    assert kept <= 2 < among - 2
    every = np.arange(len(best.registered.forward))
    same = replace(best, registered=best.registered._replace(forward=every))
    assert kept_extremities(sides, same) == (among, among)
