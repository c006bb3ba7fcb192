"""Motions that lay a shape onto another: found whatever was cut off, and what starts from them."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from testshapes.damage import Damaged, cut
from unbend import Mesh
from unbend.alignment import Motions, OrientedSurface, find_motions
from unbend.datasets import make_quadruped
from unbend.matching import _constants as constants
from unbend.matching import _plan
from unbend.matching._inputs import prepare_shape
from unbend.matching._registration import laid_maps, laid_starts
from unbend.matching._shape import Shape, make_proxy

pytestmark = pytest.mark.usefixtures("as_meshed")

TURN = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
SIZES = [2 ** (step / 2) for step in range(-2, 3)]


@functools.cache
def _body() -> Mesh:
    return make_quadruped("standing", n_vertices=900).mesh


def _shape(mesh: Mesh, *, partial: bool = True) -> Shape:
    """A coarse copy, as the matcher lays it."""
    return make_proxy(prepare_shape(mesh, 20, partial).shape, 400).shape


def _oriented(shape: Shape) -> OrientedSurface:
    return shape.as_oriented(shape.vertices, 64)


def _found(source: Shape, target: Shape, count: int) -> Motions:
    return find_motions(_oriented(source), _oriented(target), SIZES, count, constants.LIMB)


def _moved(mesh: Mesh) -> Mesh:
    return Mesh(5 * mesh.vertices @ TURN.T + [3.0, -2, 1], mesh.faces)


def _front(share: float) -> Damaged:
    return cut(_body(), _body().vertices @ [0.0, 0.1, 1.0], share)


def _angle(rotations: np.ndarray) -> np.ndarray:
    """How far rotations are off the one by which the target was turned, in degrees."""
    return np.degrees(Rotation.from_matrix(rotations @ TURN.T).magnitude())


@pytest.fixture(scope="module")
def sides() -> tuple[Shape, Shape]:
    """Less than half of a body, and the whole of it, turned."""
    return _shape(_front(0.55).mesh), _shape(_moved(_body()), partial=False)


def test_inverse_motions_lead_back() -> None:
    rng = np.random.default_rng(0)
    rotations = Rotation.random(4, random_state=1).as_matrix()
    motions = Motions(rotations, rng.standard_normal((4, 3)), rng.uniform(0.5, 2, 4))
    points = rng.standard_normal((5, 3))
    there = motions.moved(points)
    expected = motions.sizes[2] * points @ rotations[2].T + motions.shifts[2]
    np.testing.assert_allclose(there[2], expected)
    for i in range(4):
        back = motions.inverse().taken(np.array([i])).moved(there[i])[0]
        np.testing.assert_allclose(back, points, atol=1e-12)


def test_the_motion_of_a_part_is_found_with_its_size(sides: tuple[Shape, Shape]) -> None:
    source, target = sides
    motions = _found(source, target, 12)
    assert len(motions.sizes) == 12
    assert _angle(motions.rotations[:1])[0] < 25
    # Of unit area both, the part is drawn larger than the same on the whole.
    assert motions.sizes[0] == pytest.approx(SIZES[1])


def test_the_form_is_of_the_distances_alone_with_its_outside_outside() -> None:
    shape = _shape(_body())
    apart = cdist(shape.form, shape.form)
    off = np.abs(apart - shape.distances).mean()
    assert off < np.abs(cdist(shape.vertices, shape.vertices) - shape.distances).mean() / 3
    for other in (replace(shape, vertices=shape.vertices @ TURN), shape.reflected()):
        np.testing.assert_allclose(cdist(other.form, other.form), apart, atol=1e-6)
        assert np.linalg.det(other.form[other.faces]).sum() > 0


def test_two_parts_that_share_little_are_laid_where_they_are_the_same() -> None:
    middle = _body().vertices @ [0.0, 0.1, 1.0]
    front, back = _front(0.3).mesh, cut(_body(), -middle, 0.3).mesh
    motions = _found(_shape(front), _shape(_moved(back)), 8)
    assert _angle(motions.rotations[:4]).min() < 25


def test_motions_lay_given_points_onto_each_other(sides: tuple[Shape, Shape]) -> None:
    source, target = map(_oriented, sides)
    pairs = source.samples[20:23], target.samples[40:43]
    motions = find_motions(source, target, SIZES, 5, constants.LIMB, pairs)
    there = motions.moved(source.points[pairs[0]])
    off = np.linalg.norm(there - target.points[pairs[1]], axis=2)
    np.testing.assert_allclose(off.min(axis=1), 0, atol=1e-12)


def test_of_a_long_shape_no_fine_grid_is_made(sides: tuple[Shape, Shape]) -> None:
    whole = _oriented(sides[1])
    along = np.full(3, 1 / np.sqrt(3))
    long = whole._replace(points=whole.points + 300 * np.outer(whole.points @ along, along))
    motions = find_motions(long, long, [1.0], 5, constants.LIMB)
    assert np.isfinite(motions.shifts).all()


def test_landmarks_add_motions_and_take_none_away(sides: tuple[Shape, Shape]) -> None:
    places = [one.vertices for one in sides]
    _, motions = _plan._motions(sides, places, 6)
    marked = replace(sides[0], landmarks=np.array([3])), replace(sides[1], landmarks=np.array([9]))
    more_maps, more = _plan._motions(marked, places, 6)
    assert len(more_maps) == len(more.sizes) > 6
    for few, many in zip(motions, more, strict=True):
        np.testing.assert_array_equal(many[:6], few)


def test_motions_differ(sides: tuple[Shape, Shape]) -> None:
    motions = _found(*sides, 30)
    places = motions.moved(sides[0].vertices)
    apart = np.linalg.norm(places[:, None] - places, axis=3).mean(axis=2)
    assert apart[~np.eye(len(places), dtype=bool)].min() > 1.5 * constants.PATCH


def test_starts_are_the_shape_moved_and_pairs_of_nearest_points(
    sides: tuple[Shape, Shape],
) -> None:
    source, target = sides
    motions = _found(source, target, 3)
    maps = laid_maps(_oriented(source), _oriented(target), motions)
    start = laid_starts(source, target, maps, motions)[1]
    np.testing.assert_array_equal(start.forward, maps[1][0])
    rotation, shift, size = (one[1] for one in motions)
    np.testing.assert_allclose(start.source.places, size * source.vertices @ rotation.T + shift)
    np.testing.assert_allclose(start.source.rotations, np.tile(rotation, (len(source.areas), 1, 1)))
    np.testing.assert_allclose(start.target.rotations[0], rotation.T)
    assert start.source.size == pytest.approx(1 / start.target.size)
    there = size * start.target.places @ rotation.T + shift
    np.testing.assert_allclose(there, target.vertices, atol=1e-12)
    apart = np.linalg.norm(start.source.places[:, None] - target.vertices, axis=2)
    reached = apart[np.arange(len(apart)), start.forward]
    # Normals count a little, too.
    assert (reached <= apart.min(axis=1) + 2 * constants.NORMAL_WEIGHTS[0]).all()
    # What lands on the part's boundary has no partner there; the whole has none.
    np.testing.assert_array_equal(start.target.overlap, ~source.on_boundary[start.backward])
    assert not start.target.overlap.all()
    assert start.source.overlap.all()
