"""Tips of limbs: found where they are, and told apart by the ways between them."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from unbend import Mesh
from unbend.datasets import Shape as Body
from unbend.datasets import make_biped, make_octopus, make_sphere
from unbend.matching._extremities import (
    Extremities,
    _assignments,
    _costs,
    _of_lengths,
    _of_logarithms,
    find_extremities,
    guess_limbs,
    limb_maps,
)
from unbend.matching._inputs import prepare_shape
from unbend.matching._shape import Shape

pytestmark = pytest.mark.usefixtures("as_meshed")


def test_a_person_has_five_tips() -> None:
    body = make_biped("walking", n_vertices=600)
    extremities = find_extremities(prepare_shape(body.mesh, 60)[1])
    named = [body.parts[label] for label in body.labels[extremities.vertices]]
    assert sorted(named) == ["head", "left_arm", "left_leg", "right_arm", "right_leg"]
    np.testing.assert_allclose(extremities.distances, extremities.distances.T)
    assert (extremities.distances[~np.eye(5, dtype=bool)] > 0.3).all()
    np.testing.assert_allclose(
        extremities.distances, extremities.fields[extremities.vertices], atol=1e-12
    )


def test_a_star_has_a_tip_on_every_ray() -> None:
    ball = make_sphere(4)
    angles = 2 * np.pi * np.arange(5) / 5
    rays = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    reach = 1 + 2 * np.exp(-12 * (1 - ball.vertices @ rays.T)).sum(axis=1)
    star = prepare_shape(Mesh(ball.vertices * reach[:, None], ball.faces), 40)[1]
    extremities = find_extremities(star)
    ends = star.vertices[extremities.vertices]
    ends /= np.linalg.norm(ends, axis=1, keepdims=True)
    order = (rays @ ends.T).argmax(axis=1)  # the tip of each ray
    assert sorted(order) == list(range(len(ends)))
    assert (rays * ends[order]).sum(axis=1).min() > 0.99
    # All ways between rays side by side are about equal, and so are the longer ones.
    distances = extremities.distances[np.ix_(order, order)]
    beside, beyond = (np.diag(np.roll(distances, -step, axis=1)) for step in (1, 2))
    for alike in (beside, beyond):
        assert alike.max() < 1.1 * alike.min()
    assert beyond.min() > beside.max()


def _spiky(rays: np.ndarray) -> Shape:
    """A ball with spikes that way."""
    ball = make_sphere(3)
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    reach = 1 + 1.5 * np.exp(-40 * (1 - ball.vertices @ rays.T)).sum(axis=1)
    return prepare_shape(Mesh(ball.vertices * reach[:, None], ball.faces), 60).shape


def test_every_most_remote_place_is_a_tip_the_most_remote_first() -> None:
    shape = _spiky(np.random.default_rng(4).normal(size=(9, 3)))
    extremities = find_extremities(shape)
    remote = ((shape.basis / shape.eigenvalues) ** 2).sum(axis=1)
    assert (np.diff(remote[extremities.vertices]) < 0).all()
    apart = extremities.distances[np.triu_indices(len(extremities.vertices), 1)]
    assert 0.22 < apart.min() < 0.4
    highest = np.ones(len(remote), dtype=bool)
    i, j = shape.edge_weights.nonzero()
    highest[i[remote[i] < remote[j]]] = False
    np.testing.assert_array_equal(np.sort(extremities.vertices), np.flatnonzero(highest))


def test_there_are_at_most_ten_tips() -> None:
    assert len(find_extremities(_spiky(make_sphere(0).vertices)).vertices) == 10


def test_limbs_of_other_lengths_change_little() -> None:
    # A tree whose five limbs grow, each by a factor of its own, and whose unit is another.
    rng = np.random.default_rng(0)
    body = np.array([0, 0.1, 0.1, 0.7, 0.7])
    trunk = np.abs(body[:, None] - body)
    limbs = np.array([0.3, 0.7, 0.72, 0.9, 0.93])

    def distances(lengths: np.ndarray) -> np.ndarray:
        return (trunk + lengths[:, None] + lengths) * (1 - np.eye(5))

    order = rng.permutation(5)
    grown = 3.0 * distances(limbs * [1.5, 0.8, 0.8, 1.2, 1.2])[np.ix_(order, order)]

    def extremities(lengths: np.ndarray) -> Extremities:
        return Extremities(np.arange(5), lengths, np.empty((0, 5)))

    found = guess_limbs(extremities(distances(limbs)), extremities(grown), 60)
    right = [k for k, one in enumerate(found) if (order[one.target] == one.source).all()]
    assert right[0] < 20
    exact = guess_limbs(extremities(distances(limbs)), extremities(2 * distances(limbs)), 60)[0]
    assert (exact.source == exact.target).all()
    assert len(exact.source) == 5
    assert exact.size == pytest.approx(2)
    # The other way round, things are half as long.
    assert guess_limbs(
        extremities(2 * distances(limbs)), extremities(distances(limbs)[:4, :4]), 60
    )[0].size == pytest.approx(0.5)


@pytest.mark.parametrize("deviation", [_of_logarithms, _of_lengths])
def test_no_assignment_deviates_less_than_the_first(deviation) -> None:
    rng = np.random.default_rng(2)
    ours, theirs = (distances + distances.T for distances in rng.random((2, 6, 6)) + 1)
    rows = np.array(list(itertools.product(range(-1, 6), repeat=5)))
    once = [np.unique(row[row >= 0]).size == (row >= 0).sum() >= 3 for row in rows]
    costs = _costs(ours[:5, :5], theirs, rows[once], deviation)
    empty = np.empty((0, 6))
    guesses = guess_limbs(
        Extremities(np.arange(5), ours[:5, :5], empty[:, :5]),
        Extremities(np.arange(6), theirs, empty),
        1,
    )
    rows = np.full((len(guesses), 5), -1)
    for row, one in zip(rows, guesses, strict=True):
        row[one.source] = one.target
    found = _costs(ours[:5, :5], theirs, rows, deviation)
    np.testing.assert_allclose(found.min(), costs.min())


def test_a_point_keeps_its_share_of_a_limb() -> None:
    # Trees of five limbs on a trunk, and points all along; those of the second are as long as they
    # like, and all of it is larger by a half.
    heights = np.array([0, 0, 0.4, 1, 1])
    share, limb = np.meshgrid(np.linspace(0, 1, 11), np.arange(5))
    share, limb = share.ravel(), limb.ravel()

    def tree(lengths: np.ndarray, size: float) -> Extremities:
        apart = np.abs(heights[limb][:, None] - heights) + 0.1
        elsewhere = (1 - share[:, None]) * lengths[limb][:, None] + apart + lengths
        own = limb[:, None] == np.arange(5)
        fields = size * np.where(own, share[:, None] * lengths, elsewhere)
        extremities = np.flatnonzero(share == 0)
        return Extremities(extremities, fields[extremities], fields)

    one = tree(np.array([0.5, 0.7, 0.3, 0.6, 0.9]), 1.0)
    other = tree(np.array([1.2, 0.3, 0.9, 0.4, 0.5]), 1.5)
    for point_map in limb_maps(one, other):
        np.testing.assert_array_equal(limb[point_map], limb)
        assert np.abs(share[point_map] - share).max() <= 0.11


def _tree(limbs: list[float], heights: np.ndarray, stations: np.ndarray) -> Extremities:
    """Limbs on a trunk at some heights, eleven points along each, then some of the trunk."""
    lengths, n = np.array(limbs), len(limbs)
    begin, share = np.repeat(heights, 11), np.tile(np.linspace(0, 1, 11), n)
    limb = np.repeat(np.arange(n), 11)
    down = np.concatenate([(1 - share) * lengths[limb], 0 * stations])
    fields = down[:, None] + np.abs(np.concatenate([begin, stations])[:, None] - heights) + lengths
    own = np.arange(len(limb)), limb
    fields[own] = share * lengths[limb]
    extremities = 11 * np.arange(n)
    return Extremities(extremities, fields[extremities], fields)


def test_a_point_keeps_its_share_of_a_trunk() -> None:
    heights, stations = np.array([0, 0, 0.4, 1, 1]), np.linspace(0.05, 0.95, 10)
    one = _tree([0.5, 0.7, 0.3, 0.6, 0.9], heights, stations)
    other = _tree([1.2, 0.3, 0.9, 0.4, 0.5], 1.5 * heights, 1.5 * stations)
    trunk = np.arange(55, 65)
    for point_map in (*limb_maps(one, other), *limb_maps(other, one)):
        np.testing.assert_array_equal(point_map[trunk], trunk)


def test_a_tip_without_a_limb_is_no_harm() -> None:
    heights, stations = np.array([0, 0, 0.5, 1, 1]), np.linspace(0.0625, 0.9375, 8)
    one = _tree([0.5, 0.75, 0.0, 0.625, 0.875], heights, stations)
    for point_map in limb_maps(one, one):
        np.testing.assert_allclose(one.fields[point_map], one.fields, atol=0.1)


def test_the_order_of_tips_does_not_matter() -> None:
    stations = np.sort(np.random.default_rng(0).random(100))
    heights = np.array([0, 0, 0.3, 1, 1])
    one = _tree([0.5, 0.7, 0.3, 0.6, 0.9], heights, stations)
    # A trunk whose ends grew by other factors.
    bent = np.interp(np.concatenate([heights, stations]), [0, 0.3, 1], [0, 0.9, 1.2])
    other = _tree([0.4, 0.5, 0.5, 0.5, 1.0], bent[:5], bent[5:])
    expected = limb_maps(one, other)
    goals = other.fields, one.fields
    for order in ([4, 2, 0, 1, 3], [0, 3, 1, 4, 2], [2, 0, 4, 3, 1]):
        every = np.arange(len(one.fields))
        again = limb_maps(
            *(extremities.taken(np.array(order), every) for extremities in (one, other))
        )
        for maps, same, fields in zip(again, expected, goals, strict=True):
            assert np.abs(fields[maps] - fields[same]).mean() < 0.005  # ties go either way


@pytest.fixture(scope="module")
def octopuses() -> list[tuple[Body, Shape]]:
    bodies = [make_octopus(pose, n_vertices=600) for pose in ("swimming", "curled")]
    return [(body, prepare_shape(body.mesh, 60).shape) for body in bodies]


def test_eight_alike_limbs_are_all_guessed(octopuses: list[tuple[Body, Shape]]) -> None:
    extremities = [find_extremities(shape) for _, shape in octopuses]
    labels = [
        body.labels[one.vertices] for (body, _), one in zip(octopuses, extremities, strict=True)
    ]
    for ends in labels:
        assert len(ends) == len(set(ends)) == 9  # an octopus has eight arms and a mantle
    guesses = guess_limbs(*extremities, 200)
    right = [(labels[0][one.source] == labels[1][one.target]).sum() for one in guesses]
    assert max(right) == 9


def test_landmarks_come_first_and_a_tip_there_does_not_come_again(
    octopuses: list[tuple[Body, Shape]],
) -> None:
    shape = octopuses[0][1]
    ends = find_extremities(shape).vertices
    for landmark in ends[[0, 4, 8]]:
        found = find_extremities(replace(shape, landmarks=np.array([landmark]))).vertices
        assert found[0] == landmark
        assert sorted(found) == sorted(ends)
    found = find_extremities(replace(shape, landmarks=ends[::-1]))
    np.testing.assert_array_equal(found.vertices[: found.n_given], ends[:1:-1])  # seven of nine


def test_either_shape_may_lack_most_tips() -> None:
    distances = np.random.default_rng(0).random((6, 6)) + 1
    distances = (distances + distances.T) * (1 - np.eye(6))
    extremities = Extremities(np.arange(6), distances, np.empty((0, 6)))
    assert min(len(one.source) for one in guess_limbs(extremities, extremities, 5000)) == 3
    pairs = [(*one.source, -1, *one.target) for one in guess_limbs(extremities, extremities, 60)]
    assert len(set(pairs)) == len(pairs)


def test_a_guess_of_several_kinds_has_its_best_rank() -> None:
    """All distances equal but noise: both kinds make all guesses, in orders of their own."""
    rng = np.random.default_rng(1)
    ours, theirs = (
        Extremities(np.arange(4), one + one.T, np.empty((0, 4)))
        for one in 1 + 0.1 * rng.random((2, 4, 4)) * (1 - np.eye(4))
    )
    distances = ours.distances, theirs.distances
    kinds = [
        [(*mine, *other) for mine, other, _ in _assignments(*distances, 500, set(), deviation)]
        for deviation in (_of_logarithms, _of_lengths)
    ]
    found = guess_limbs(ours, theirs, 500)
    assert kinds[0] != kinds[1]
    assert {(*one.source, *one.target): one.rank for one in found} == {
        guess: min(some.index(guess) for some in kinds) for guess in kinds[0]
    }
    assert [one.rank for one in found] == sorted(one.rank for one in found)


def test_landmarks_hold_all_together_then_each_alone_then_none() -> None:
    distances = np.array([0.3, 0.7, 0.72, 0.9, 0.93])
    distances = (distances[:, None] + distances) * (1 - np.eye(5))
    cycle = [1, 2, 0, 3, 4]
    extremities = Extremities(np.arange(5), distances, np.empty((0, 5)))
    cycled = extremities._replace(distances=distances[np.ix_(cycle, cycle)])
    held = [
        set(one.source[one.source == one.target]) & {0, 1}
        for one in guess_limbs(extremities._replace(n_given=2), cycled, 1)
    ]
    assert held[0] == {0, 1}
    assert held[-1] == set()
    assert {0} in held
    assert {1} in held


def _random_tips(n: int, seed: int) -> Extremities:
    distances = np.random.default_rng(seed).random((n, n)) + 1
    return Extremities(np.arange(n), (distances + distances.T) * (1 - np.eye(n)), np.empty((0, n)))


def test_as_many_are_guessed_as_asked_for_or_as_there_are() -> None:
    one, other = _random_tips(4, 0), _random_tips(4, 1)
    for count, most in ((1, 2), (10, 20), (120, 120), (1000, 120)):
        pairs = {
            tuple(zip(guess.source.tolist(), guess.target.tolist(), strict=True))
            for guess in guess_limbs(one, other, count)
        }
        assert min(count, 120) <= len(pairs) <= most
    # All four, or all but one of either: 4! and 4 * 4 * 3!.
    assert len(pairs) == 24 + 96
    assert len(guess_limbs(_random_tips(3, 0), _random_tips(3, 1), 10)) == 6
    assert guess_limbs(_random_tips(2, 0), other, 10) == []
    assert guess_limbs(one, _random_tips(2, 0), 10) == []


def test_a_guess_is_as_much_longer_as_the_middle_one_of_all_ways() -> None:
    one, other = _random_tips(5, 2), _random_tips(6, 3)
    for sides in ((one, other), (other, one)):
        for guess in guess_limbs(*sides, 20):
            mine, theirs = (
                extremities.distances[np.ix_(taken, taken)]
                for extremities, taken in zip(sides, guess[:2], strict=True)
            )
            ratios = (theirs / np.where(mine, mine, 1))[mine > 0]  # each way twice
            middle = np.exp(np.median(np.log(ratios)))
            assert guess.size == pytest.approx(middle)


def test_of_equally_good_guesses_the_first_in_order_comes_first() -> None:
    distances = 1 - np.eye(5)
    alike = Extremities(np.arange(5), distances, np.empty((0, 5)))
    assert guess_limbs(alike, alike, 1)[0].target.tolist() == [0, 1, 2, 3, 4]


def test_lengths_deviate_as_they_do_at_the_size_that_suits_them_best() -> None:
    rng = np.random.default_rng(3)
    rows = rng.random((8, 10)) + np.linspace(0.2, 3, 8)[:, None] * np.arange(10)
    distances, lengths = rows[:4], rows[4:]
    many, one = (part / np.sqrt((part**2).mean(axis=1))[:, None] for part in (distances, lengths))
    sizes = np.geomspace(0.01, 100, 20000)
    apart = sizes[:, None, None] * many - one
    least = np.sqrt((apart**2).mean(axis=2)).min(axis=0)
    np.testing.assert_allclose(_of_lengths(5, lengths, distances), least, rtol=1e-4)


def test_ways_place_a_body_on_itself(blob) -> None:
    shape = prepare_shape(make_biped("running", n_vertices=600).mesh, 60)[1]
    ends = find_extremities(shape)
    for point_map in limb_maps(ends, ends):  # the front may stand for the back
        np.testing.assert_allclose(ends.fields[point_map], ends.fields, atol=2e-3)
    # Ways to a tip are shortest ways: 0 there, no longer than straight on to a neighbour.
    np.testing.assert_allclose(ends.fields[ends.vertices].diagonal(), 0)
    i, j = shape.edge_weights.nonzero()
    lengths = np.linalg.norm(shape.vertices[i] - shape.vertices[j], axis=1)
    assert (np.abs(ends.fields[i] - ends.fields[j]) <= lengths[:, None] + 1e-12).all()
    smooth = find_extremities(prepare_shape(blob, 60)[1])
    assert len(guess_limbs(smooth, smooth, 60)) == 0 or len(smooth.vertices) >= 3
