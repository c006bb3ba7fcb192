"""From coarse copies to the shapes: what is told apart there, and by what."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sheets import make_egg, make_sheet
from testshapes.damage import keep
from unbend import Mesh
from unbend._types import BoolArray
from unbend.datasets import make_octopus, make_sphere, rest_map
from unbend.matching._inputs import prepare_shape
from unbend.matching._plan import Sides, candidates, make_sides
from unbend.matching._polish import _as_most_around, refined, reranked, with_partners
from unbend.matching._registration import Registered, mapped_start
from unbend.matching._score import Candidate, scored

pytestmark = pytest.mark.usefixtures("as_meshed")


def candidate(energy: float) -> Candidate:
    return Candidate(None, energy, 1.0, False, np.zeros(0, dtype=bool))


def _bumpy_boxes(partial: bool) -> tuple[Sides, Candidate, Candidate]:
    """A box with a bump at a corner and the same bent, the right map, and a half turn of the box.

    Where one may be a part, two opposite sides are cut off both.
    """
    ball = make_sphere(2)
    box = ball.vertices * [1.6, 1.0, 0.7]
    turn = cKDTree(box).query(box * [-1, -1, 1])[1]
    bump = 0.4 * np.exp(-3 * ((ball.vertices - 3**-0.5) ** 2).sum(axis=1))
    points = box * (1 + bump)[:, None]
    bent = points + np.outer(points[:, 0] ** 2, [0, 0.2, 0])
    wanted = np.abs(box[:, 2]) < (0.6 if partial else 1)
    first, second = (keep(Mesh(one, ball.faces), wanted) for one in (points, bent))
    shapes = [prepare_shape(one.mesh, 30, partial).shape for one in (first, second)]
    right, wrong = (
        scored(*shapes, mapped_start(*shapes, way, way, 1.0))
        for way in (np.arange(len(first.origin)), first.image[turn[first.origin]])
    )
    return make_sides(*shapes), right, wrong


@pytest.mark.parametrize("partial", [False, True])
def test_what_costs_nearly_the_same_is_told_apart_on_the_shapes(partial: bool) -> None:
    sides, right, wrong = _bumpy_boxes(partial)
    assert sides.partial == partial
    ranks = [replace(wrong, energy=0.3), replace(right, energy=0.301), replace(wrong, energy=0.9)]
    found, fine = reranked(sides, ranks)
    assert [one.registered for one in found] == [ranks[i].registered for i in (1, 0, 2)]
    assert found[0].energy < found[1].energy == pytest.approx(0.3)
    ratio = fine[found[0]].energy / fine[found[1]].energy
    assert found[0].energy == pytest.approx(0.3 * ratio)  # in the unit of the proxies
    assert found[2] is ranks[2]  # it costs more, and is not looked at
    assert set(fine) == set(found[:2])
    goal = sides.target.shape
    off = [
        np.linalg.norm(goal.vertices[fine[one].registered.forward] - goal.vertices, axis=1).mean()
        for one in found[:2]
    ]
    assert off[0] < 0.5 * goal.edge < 2 * goal.edge < off[1]


@pytest.mark.parametrize("partial", [False, True])
def test_parts_that_explain_less_on_the_shapes_than_on_proxies_stay_as_they_were(
    partial: bool,
) -> None:
    sides, right, wrong = _bumpy_boxes(partial)
    ranks = [replace(wrong, energy=1e-4), replace(right, energy=1.1e-4)]
    found, fine = reranked(sides, ranks)
    expected = ranks if partial else ranks[::-1]
    assert [one.registered for one in found] == [one.registered for one in expected]
    assert (found == ranks) == partial
    assert set(fine) == set(found)  # nothing is registered twice


def test_small_eyes_tell_which_arm_is_which() -> None:
    """Arms are alike; what their places differ by is small, and best seen on the shapes."""
    source = make_octopus("floating", n_vertices=2000)
    target = make_octopus("resting", n_vertices=2000, meshing=1)
    truth = target.mesh.vertices[rest_map(source, target)]
    ours, theirs = (prepare_shape(one.mesh, 100).shape for one in (source, target))
    sides = make_sides(ours, theirs)
    right, *others = candidates(sides)
    found, fine = reranked(sides, [others[0], right])
    off = target.mesh.vertices[fine[found[0]].registered.forward] - truth
    assert np.linalg.norm(off, axis=1).mean() < 0.05
    assert found[0].registered is right.registered
    # It is further ahead than on the proxies.
    assert found[1].energy / found[0].energy > others[0].energy / right.energy


@pytest.mark.parametrize("torn", [False, True])
def test_the_polish_mends_half_a_map(torn: bool) -> None:
    ball = make_sphere(2)
    box = Mesh(ball.vertices * [1.6, 1.0, 0.7], ball.faces)
    if torn:
        box = keep(box, box.vertices[:, 0] < 0.9).mesh
    bent = Mesh(box.vertices + np.outer(box.vertices[:, 0] ** 2, [0, 0.4, 0]), box.faces)
    both = [prepare_shape(one, 30, True).shape for one in (box, bent)]
    every = np.arange(len(box.vertices))
    half = np.where(box.vertices[:, 0] > 0, np.roll(every, 1), every)
    begun = scored(*both, mapped_start(*both, half, half, 1.0))
    found = refined(make_sides(*both), begun)
    off = both[1].vertices[found.registered.forward] - both[1].vertices
    assert np.linalg.norm(off, axis=1).mean() < 0.5 * both[1].edge
    assert found.energy == pytest.approx(scored(*both, found.registered).energy, rel=1e-6)
    assert found.energy < 0.5 * begun.energy


def test_two_meshes_and_the_mirror_image_of_one_are_laid_onto_each_other() -> None:
    few, many, mirrored = (
        prepare_shape(make_egg(*one), 40).shape for one in ((2, 1), (3, 1), (3, -1))
    )
    forward = np.arange(162)
    backward = cKDTree(few.vertices).query(many.vertices)[1]
    turned = make_sides(few, mirrored)
    for sides, reflected in (
        (make_sides(few, many), False),
        (turned, True),
        (turned.reflected(), True),
    ):
        start = mapped_start(few, many, forward, backward, 1.0)
        begun = replace(scored(few, many, start), reflected=reflected)
        as_it_is, found = (refined(sides, begun, polish=one) for one in (False, True))
        assert as_it_is.energy == pytest.approx(begun.energy, rel=1e-4)
        np.testing.assert_array_equal(as_it_is.registered.forward, forward)
        off = many.vertices[found.registered.forward] - few.vertices
        assert np.linalg.norm(off, axis=1).mean() < many.edge
        for one in (as_it_is, found):
            assert one.reflected == reflected
            assert one.orientation > 0.95
            assert one.energy < 0.12
            assert scored(few, many, one.registered).energy == pytest.approx(one.energy, rel=1e-4)


def test_a_vertex_has_a_partner_where_most_around_it_have() -> None:
    sheet = prepare_shape(make_sheet(15), 10, partial=True).shape
    inner = np.abs(sheet.vertices[:, :2]).max(axis=1) < 0.4
    beyond = sheet.vertices[:, 0] + 0.2
    most = beyond > 0
    scattered = np.random.default_rng(0).random(225) < 0.2
    ragged = most ^ (scattered & inner & (np.abs(beyond) > 0.15))
    assert (ragged != most).sum() > 5
    away = np.abs(beyond) > 0.1
    pose = mapped_start(sheet, sheet, *[np.arange(225)] * 2, 1.0).source
    poses = [pose._replace(overlap=one) for one in (ragged, np.ones(225, dtype=bool))]
    begun = replace(candidate(0.1), registered=Registered(np.arange(225), np.arange(225), *poses))
    level = SimpleNamespace(shape=sheet)
    sides = SimpleNamespace(source=level, target=level)
    found = with_partners(begun, sides, 0.2).registered
    np.testing.assert_array_equal(found.source.overlap[away], most[away])
    assert found.target.overlap.all()
    assert found.forward is begun.registered.forward
    assert found.backward is begun.registered.backward
    assert found.source.places is pose.places
    # Three tenths have none; if that is less than is to have none, all have one.
    assert with_partners(begun, sides, 0.4).registered.source.overlap.all()


def _partners(ball: Mesh, lacking: BoolArray, overlap: BoolArray) -> BoolArray:
    """Which vertices of a ball have a partner on the same ball without a part, in the end.

    Every vertex that is not lacking has one there, too.
    """
    bitten = keep(ball, ~lacking)
    whole, part = (prepare_shape(one, 10, partial=True).shape for one in (ball, bitten.mesh))
    back, ahead = bitten.origin, cKDTree(bitten.mesh.vertices).query(ball.vertices)[1]
    poses = mapped_start(whole, part, ahead, back, 1.0)[2:]
    poses = [poses[0]._replace(overlap=overlap), poses[1]._replace(overlap=back >= 0)]
    begun = replace(candidate(0.1), registered=Registered(ahead, back, *poses))
    levels = [SimpleNamespace(shape=shape) for shape in (whole, part)]
    sides = SimpleNamespace(source=levels[0], target=levels[1])
    found = with_partners(begun, sides, 0.0).registered
    assert found.target.overlap.all()
    return found.source.overlap


def test_a_patch_has_none_only_where_the_other_shape_ends() -> None:
    """A ball, and the same without its upper cap: what is missed on the lower one is given back."""
    ball = make_sphere(3)
    height = ball.vertices[:, 2]
    found = _partners(ball, height > 0.6, ~((height > 0.6) | (height < -0.9)))
    middle = np.abs(height - 0.6) > 0.2
    np.testing.assert_array_equal(found[middle], height[middle] <= 0.6)


@pytest.mark.parametrize("subdivisions", [3, 5])
def test_what_ends_near_the_cut_stays_without_partner_on_fine_meshes_too(subdivisions: int) -> None:
    """A 30th of the square root of the area is between one and four edges."""
    ball = make_sphere(subdivisions)
    height = ball.vertices[:, 2]
    found = _partners(ball, height > 0.6, height < 0.5)
    off = np.abs(height - 0.5) > 0.1
    np.testing.assert_array_equal(found[off], height[off] < 0.5)


def test_spots_near_the_cut_are_given_back() -> None:
    """Less than a hundredth of the area, and five edges from where the other shape ends."""
    ball = make_sphere(5)
    angle = np.arcsin(0.6) - 0.3
    spot = ball.vertices @ [np.cos(angle), 0.0, np.sin(angle)] > np.cos(0.12)
    assert spot.any()
    assert _partners(ball, ball.vertices[:, 2] > 0.6, ~spot).all()


def test_half_of_those_around_is_not_most() -> None:
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    every = prepare_shape(Mesh(corners, faces), 2).shape  # each beside every other one
    for n, most in ((4, True), (3, True), (2, False), (1, False)):
        assert _as_most_around(every, np.arange(4) < n).tolist() == [most] * 4
