"""Points all over shapes: far apart, described by what is around them, paired where they agree."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sheets import make_sheet
from testshapes.damage import cut
from unbend import Mesh
from unbend.datasets import make_biped, make_sphere
from unbend.matching import _constants as constants
from unbend.matching import _points
from unbend.matching._extremities import Guess
from unbend.matching._inputs import prepare_shape
from unbend.matching._points import (
    Points,
    _describe,
    _unlike,
    find_points,
    guess_points,
    point_maps,
    sizes_to_try,
)
from unbend.matching._shape import Shape

RADII = constants.PATCH * 2 ** (np.arange(9) / 4)  # of surroundings


def shape_of(mesh: Mesh, partial: bool = True) -> Shape:
    return prepare_shape(mesh, 40, partial).shape


def test_points_are_far_from_each_other_and_near_to_everything():
    points = find_points(shape_of(make_sphere(3)), 30)
    apart = points.distances[~np.eye(30, dtype=bool)].min()
    assert points.fields.min(axis=1).max() <= apart
    np.testing.assert_allclose(points.distances, points.distances.T)


def test_no_more_points_than_vertices():
    assert find_points(shape_of(make_sphere(0)), 30).distances.shape == (12, 12)


def test_around_a_point_of_a_plane_is_a_flat_disc():
    shape = shape_of(make_sheet(61))
    points = find_points(shape, 40)
    inner = points.whole[:, 4]
    assert inner.any()
    much, high, thick, narrow, wide, facing = points.surroundings[inner, 4].T
    # A disc's standard deviation is half its radius; ways along edges are somewhat too long.
    assert ((much > 0.85) & (much < 1.02)).all()
    assert ((narrow > 0.75) & (wide < 1.1) & (narrow <= wide)).all()
    np.testing.assert_allclose([high, thick, facing - 1], 0, atol=1e-9)


def test_a_sphere_is_round_everywhere_and_low_from_above():
    points = find_points(shape_of(make_sphere(4)), 20)
    assert points.whole.all()
    spread = points.surroundings.max(axis=0) - points.surroundings.min(axis=0)
    assert spread.max() < 0.1
    assert (points.surroundings[:, :, 1] < 0).all()  # all lies below the tangent plane
    inside_out = shape_of(make_sphere(4))
    hollow = replace(inside_out, faces=np.ascontiguousarray(inside_out.faces[:, ::-1]))
    assert (find_points(hollow, 20).surroundings[:, :, 1] > 0).all()


def test_a_point_of_a_fin_which_faces_nowhere_is_described_all_the_same():
    shape = shape_of(make_sheet(21))
    shape.normals[shape.samples[0]] = 0
    assert np.isfinite(find_points(shape, 10).surroundings).all()


def test_surroundings_end_at_rims():
    body = make_sheet(21)
    points = find_points(shape_of(body), 30)
    nearest = points.fields[shape_of(body).on_boundary].min(axis=0)
    assert (points.whole.sum(axis=1) == (nearest[:, None] > RADII).sum(1)).all()
    assert find_points(shape_of(body, partial=False), 30).whole.all()


def test_surroundings_do_not_depend_on_place_and_unit():
    body = make_biped("walking", n_vertices=600).mesh
    rotation = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    rotation *= np.linalg.det(rotation)
    moved = Mesh(3 * body.vertices @ rotation + 1, body.faces)
    one, other = (find_points(shape_of(mesh), 25) for mesh in (body, moved))
    np.testing.assert_allclose(other.surroundings, one.surroundings, atol=1e-6)


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_a_guess_leads_a_part_to_where_it_was_and_back(share):
    body = make_biped("walking", n_vertices=700).mesh
    part = cut(body, body.vertices[:, 2], share)
    sides = [prepare_shape(mesh, 40, True) for mesh in (part.mesh, body)]
    shapes = [side.shape for side in sides]
    origins = [part.origin[sides[0].kept], sides[1].kept]
    larger = np.sqrt(area(part.mesh) / area(body))
    for counts, size in (((40, 60), larger), ((60, 40), 1 / larger)):
        points = [find_points(*one) for one in zip(shapes, counts, strict=True)]
        guesses = guess_points(*points, sizes_to_try(*shapes), 24)
        here, there = (
            body.vertices[origin[found.fields.argmin(axis=0)]] / np.sqrt(area(body))
            for origin, found in zip(origins, points, strict=True)
        )
        off = [np.linalg.norm(here[one.source] - there[one.target], axis=1) for one in guesses]
        best = int(np.argmin([np.median(one) for one in off]))
        assert np.median(off[best]) < 0.15  # about the distance between points
        assert abs(np.log2(guesses[best].size / size)) < 0.4
        # All guesses differ.
        assert len({(*one.source, -1, *one.target) for one in guesses}) == len(guesses)
        shapes, origins = shapes[::-1], origins[::-1]


def area(mesh: Mesh) -> float:
    corners = mesh.vertices[mesh.faces]
    sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return float(np.linalg.norm(np.cross(*sides), axis=1).sum() / 2)


def test_nothing_is_guessed_where_nothing_agrees():
    one, other = (find_points(shape_of(make_sphere(0)), 3) for _ in range(2))
    assert guess_points(one, other, range(1), 24) == []


def test_a_part_is_smaller_than_the_whole():
    whole, part = shape_of(make_sphere(1)), shape_of(make_sheet(4))
    assert list(sizes_to_try(part, whole)) == list(range(-6, 1))
    assert list(sizes_to_try(whole, part)) == list(range(7))
    assert list(sizes_to_try(part, part)) == list(range(-3, 4))


def test_ways_are_those_of_the_fields():
    points = find_points(shape_of(make_biped("walking", n_vertices=600).mesh), 10)
    own = points.fields.argmin(axis=0)
    np.testing.assert_allclose(points.distances, points.fields[own], atol=1e-12)


def test_around_a_point_of_a_sphere_is_a_cap():
    points = find_points(shape_of(make_sphere(4)), 5)
    radius = np.sqrt(1 / (4 * np.pi))  # of a sphere of unit area
    # Ways along edges are longer: what is within a length of them is a smaller cap, and ragged.
    found, radii = points.surroundings.mean(axis=0)[3:], RADII[3:]
    shorter = np.arcsin(found[:, 0] * radii / (2 * radius)) * 2 * radius / radii
    assert ((shorter > 0.9) & (shorter < 1)).all()
    angle = shorter * radii / radius
    # Moments of the cosine over the cap, where all counts by its cosine.
    cosine = np.cos(angle)
    once = 2 / 3 * (1 - cosine**3) / (1 - cosine**2)
    twice = (1 + cosine**2) / 2
    np.testing.assert_allclose(found[:, 1], -2 * radius * (1 - once) / radii, rtol=0.08)
    high, across = radius**2 * (twice - once**2), radius**2 * (1 - twice) / 2
    np.testing.assert_allclose(found[:, 2], 2 * np.sqrt(high) / radii, rtol=0.08)
    for wide in found[:, 3:5].T:
        np.testing.assert_allclose(wide, 2 * np.sqrt(across) / radii, rtol=0.08)
    np.testing.assert_allclose(found[:, 5], once, rtol=0.01)


def test_places_have_the_same_ways_to_points_whatever_the_size():
    chance = np.random.default_rng(0)
    ours, order = chance.uniform(0.1, 1, size=(50, 6)), chance.permutation(50)
    for size in (0.5, 1.0, 1.7):
        forward, backward = point_maps(ours, size * ours[order], size)
        np.testing.assert_array_equal(forward, np.argsort(order))
        np.testing.assert_array_equal(backward, order)


def planted(count: int, step: int, copies: int = 1) -> tuple[Points, Points, np.ndarray]:
    """Points and what they are on a shape that is so many steps larger, in another order.

    The copies beside it, far away, are as far from each other, but look unlike.
    """
    chance = np.random.default_rng(count)
    places = chance.uniform(0, 0.4, size=(count, 3))
    distances = np.linalg.norm(places[:, None] - places, axis=2)
    order = chance.permutation(count)
    looks = chance.uniform(size=(count, 9, 6))
    theirs = chance.uniform(size=(copies * count, 9, 6))
    for i in range(max(0, -step), min(9, 9 - step)):
        theirs[-count:, i + step] = looks[order, i]
    far = np.full((copies, count, copies, count), 9.0)
    far[range(copies), :, range(copies)] = 2 ** (step / 4) * distances[order][:, order]
    n = copies * count
    whole = np.ones((n, 9), dtype=bool)
    return (
        Points(distances, distances, looks, whole[:count]),
        Points(far.reshape(n, n), far.reshape(n, n), theirs, whole),
        order,
    )


@pytest.mark.parametrize("step", [-2, 0, 3])
@pytest.mark.parametrize("copies", [1, 2])
def test_what_is_the_same_at_another_size_is_found_before_what_looks_unlike(step, copies):
    ours, theirs, order = planted(12, step, copies)
    best, *rest = guess_points(ours, theirs, range(-3, 4), 24)
    assert best.size == pytest.approx(2 ** (step / 4))
    np.testing.assert_array_equal(order[best.target - 12 * (copies - 1)], best.source)
    assert len(best.source) >= 6  # of the twelve
    assert len(guess_points(ours, theirs, range(-3, 4), 5)) == 5 < len(rest)


def test_a_guess_has_four_pairs_or_more_the_better_half():
    ours, theirs, _ = planted(7, 0)
    (guess,) = guess_points(ours, theirs, range(1), 24)
    assert len(guess.source) == 4
    assert guess_points(*planted(6, 0)[:2], range(1), 24) == []


@pytest.mark.parametrize("step", [-2, 0, 3])
def test_what_is_the_same_at_another_size_is_not_unlike(step):
    ours, theirs, order = planted(12, step)
    unlike = _unlike(ours, theirs, step)
    np.testing.assert_allclose(unlike[order, np.arange(12)], 0, atol=1e-12)
    assert np.median(unlike) > 1
    brighter = theirs._replace(surroundings=theirs.surroundings + 0.1)
    same = _unlike(ours, brighter, step)[order, np.arange(12)]
    np.testing.assert_allclose(same, 0.6)  # all six differ by so much
    for i in range(9):
        looks = theirs.surroundings.copy()
        looks[:, i] += 0.1
        other = _unlike(ours, theirs._replace(surroundings=looks), step)[order, np.arange(12)]
        common = 9 - abs(step)
        np.testing.assert_allclose(other, 0.6 / common if 0 <= i - step < 9 else 0, atol=1e-12)
    # How much there is within a rim says nothing.
    torn = brighter._replace(whole=np.zeros((12, 9), dtype=bool))
    np.testing.assert_allclose(_unlike(ours, torn, step)[order, np.arange(12)], 0.5)


def test_what_only_one_has_is_not_gathered():
    """Ten of twenty points are on both; the others are elsewhere, and look otherwise."""
    ours, theirs, order = planted(20, 0)
    chance = np.random.default_rng(1)
    elsewhere = chance.uniform(0, 0.4, size=(20, 3))
    other = np.linalg.norm(elsewhere[:, None] - elsewhere, axis=2)
    common = order < 10
    theirs = theirs._replace(
        distances=np.where(common[:, None] & common, theirs.distances, other),
        surroundings=np.where(
            common[:, None, None], theirs.surroundings, chance.uniform(size=(20, 9, 6))
        ),
    )
    best = guess_points(ours, theirs, range(1), 1)[0]
    np.testing.assert_array_equal(order[best.target], best.source)
    assert 5 <= len(best.source) < 8  # the better half of what was gathered
    assert (best.source < 10).all()


def slab(facing: list[float]) -> SimpleNamespace:
    """Flat squares one above the other, each of which faces the lowest one's way by a cosine."""
    line = np.linspace(-0.5, 0.5, 41)
    x, y = (part.ravel() for part in np.meshgrid(line, line))
    vertices = [np.stack([x, y, 0 * x + 0.02 * i], axis=1) for i in range(len(facing))]
    normals = [np.tile([np.sqrt(1 - one**2), 0, one], (len(x), 1)) for one in facing]
    return SimpleNamespace(
        vertices=np.concatenate(vertices),
        normals=np.concatenate(normals),
        areas=np.full(len(facing) * len(x), 1 / len(x)),
        edge=1 / 40,
        on_boundary=np.zeros(len(facing) * len(x), dtype=bool),
    )


def described(shape: SimpleNamespace) -> np.ndarray:
    """What is around the middle of the lowest square, by straight distances across."""
    middle = 20 * 41 + 20
    distances = np.linalg.norm((shape.vertices - shape.vertices[middle])[:, :2], axis=1)
    return _describe(shape, middle, distances)[0]


def test_within_a_length_lies_a_disc_of_that_radius():
    much, high, thick, narrow, wide, facing = described(slab([1.0])).T
    for one in (much, narrow, wide):  # a disc's standard deviation is half its radius
        np.testing.assert_allclose(one, 1, atol=0.06)
    np.testing.assert_allclose([high, thick, facing - 1], 0, atol=1e-9)


def test_what_faces_away_is_not_described_and_what_faces_the_same_way_counts_alike():
    alone, both = described(slab([1.0])), described(slab([1.0, -0.9]))
    np.testing.assert_allclose(both[:, 1:], alone[:, 1:], atol=1e-9)
    np.testing.assert_allclose(both[:, 0], np.sqrt(2) * alone[:, 0])
    mixed = described(slab([1.0, 0.4, 0.7]))
    np.testing.assert_allclose(mixed[:, 5], (1 + 0.4**2 + 0.7**2) / (1 + 0.4 + 0.7))
    np.testing.assert_allclose(mixed[:, 1], 2 * (0.4 * 0.02 + 0.7 * 0.04) / (1 + 0.4 + 0.7) / RADII)
    # Less and less, the further it turns away.
    for facing in (0.3, 0.15, 1e-3, 0.0):
        seen = described(slab([1.0, facing]))[:, 1]
        np.testing.assert_allclose(seen, 2 * 0.02 * facing / (1 + facing) / RADII, atol=1e-12)


def test_a_guess_that_shares_half_of_its_pairs_with_a_better_one_is_none(monkeypatch):
    def guess(*pairs: int) -> Guess:
        return Guess(np.array(pairs) // 10, np.array(pairs) % 10, 1.0)

    best, half = guess(0, 11, 22, 33), guess(0, 11, 32, 23)
    other, less = guess(10, 1, 42, 53), guess(0, 12, 23, 34, 45)
    found = [(0.5, less), (0.6, other), (0.8, half), (0.9, best)]
    monkeypatch.setattr(_points, "_consistent", lambda *given: found)
    points = planted(6, 0)[0]
    assert guess_points(points, points, range(1), 24) == [best, other, less]
    assert guess_points(points, points, range(1), 2) == [best, other]
