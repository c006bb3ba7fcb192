"""Points all over shapes: far apart, described by what is around them, paired where they agree."""

from dataclasses import replace

import numpy as np
import pytest

from sheets import make_sheet
from unbend import Mesh
from unbend.datasets import cut, make_biped, make_sphere
from unbend.matching._inputs import prepare_shape
from unbend.matching._points import find_points, guess_points, sizes_to_try
from unbend.matching._shape import Shape


def shape_of(mesh: Mesh, partial: bool = True) -> Shape:
    return prepare_shape(mesh, 40, True, partial).shape


def test_points_are_far_from_each_other_and_near_to_everything():
    points = find_points(shape_of(make_sphere(3)), 30)
    apart = points.ways[~np.eye(30, dtype=bool)].min()
    assert points.fields.min(axis=1).max() <= apart
    np.testing.assert_allclose(points.ways, points.ways.T)


def test_no_more_points_than_vertices():
    assert find_points(shape_of(make_sphere(0)), 30).ways.shape == (12, 12)


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
    nearest = points.fields[shape_of(body).on_rim].min(axis=0)
    assert (
        points.whole.sum(axis=1) == (0.07 * 2 ** (np.arange(9) / 4) < nearest[:, None]).sum(1)
    ).all()
    assert find_points(shape_of(body, partial=False), 30).whole.all()


def test_surroundings_do_not_depend_on_place_and_unit():
    body = make_biped("walking", n_vertices=600).mesh
    rotation = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    rotation *= np.linalg.det(rotation)
    moved = Mesh(3 * body.vertices @ rotation + 1, body.faces)
    one, other = (find_points(shape_of(mesh), 25) for mesh in (body, moved))
    np.testing.assert_allclose(other.surroundings, one.surroundings, atol=1e-6)


@pytest.mark.parametrize("share", [0.3, 0.5])
@pytest.mark.parametrize("swapped", [False, True])
def test_a_guess_leads_a_part_to_where_it_was(share, swapped):
    body = make_biped("walking", n_vertices=1000).mesh
    part = cut(body, body.vertices[:, 2], share)
    sides = [prepare_shape(mesh, 40, True, True) for mesh in (part.mesh, body)]
    origins = [part.origin[sides[0].kept], sides[1].kept]
    if swapped:
        sides, origins = sides[::-1], origins[::-1]
    shapes = [side.shape for side in sides]
    points = [find_points(shape, count) for shape, count in zip(shapes, (40, 60), strict=True)]
    guesses = guess_points(*points, sizes_to_try(*shapes), 24)
    here, there = (
        body.vertices[origin[found.fields.argmin(axis=0)]] / np.sqrt(area(body))
        for origin, found in zip(origins, points, strict=True)
    )
    off = [np.linalg.norm(here[one.source] - there[one.target], axis=1) for one in guesses]
    best = int(np.argmin([np.median(one) for one in off]))
    assert np.median(off[best]) < 0.15  # about as far as points are from each other
    true = np.sqrt(area(part.mesh) / area(body)) ** (-1 if swapped else 1)
    assert abs(np.log2(guesses[best].size / true)) < 0.4
    # And each is another one.
    assert len({(*one.source, -1, *one.target) for one in guesses}) == len(guesses)


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
