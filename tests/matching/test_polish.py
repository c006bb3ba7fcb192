"""From coarse copies to the shapes: what is told apart there, and by what."""

import itertools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sheets import make_egg, make_sheet
from unbend import Mesh
from unbend.datasets import keep, make_octopus, make_sphere, rest_map
from unbend.matching import _polish
from unbend.matching._inputs import prepare_shape
from unbend.matching._judge import Candidate, fine_energy, judge
from unbend.matching._polish import (
    _as_most_around,
    _fine_energy,
    grown_start,
    refined,
    settled,
    with_partners,
)
from unbend.matching._registration import Registered, mapped_start
from unbend.matching._solve import candidates, make_sides


def candidate(energy: float) -> Candidate:
    return Candidate(None, energy, 1.0, False, np.zeros(0, dtype=bool), 1.0)


@pytest.mark.parametrize(
    ("rough", "fine", "order", "energies"),
    [
        # All that cost at most 1.15 times the least, but no more than five.
        ([0.1, 0.11, 0.12], [0.4, 0.2], [1, 0, 2], [0.05, 0.1, 0.12]),
        ([0.1, 0.114, 0.129], [0.2, 0.4], [0, 2, 1], [0.1, 0.129, 0.2]),
        (
            [0.1, 0.101, 0.102, 0.103, 0.104, 0.105],
            [0.4, 0.6, 0.2, 0.5, 0.8],
            [2, 0, 5, 3, 1, 4],
            [0.05, 0.1, 0.105, 0.125, 0.15, 0.2],
        ),
        ([0.0, 0.0, 0.1], [0.4, 0.2], [0, 1, 2], [0.0, 0.0, 0.1]),
        ([0.1, 0.2], [], [0, 1], [0.1, 0.2]),
    ],
)
def test_what_costs_nearly_the_same_is_told_apart_on_the_shapes(
    monkeypatch: pytest.MonkeyPatch, rough, fine, order, energies
) -> None:
    ranks = [candidate(one) for one in rough]
    known = {id(one): candidate(energy) for one, energy in zip(ranks, fine, strict=False)}
    monkeypatch.setattr(_polish, "refined", lambda sides, one: known[id(one)])
    monkeypatch.setattr(_polish, "_fine_energy", lambda sides, one: one.energy)
    found, told = settled(SimpleNamespace(partial=False), ranks)
    assert [one.energy for one in found] == pytest.approx(energies)
    assert [told.get(one) for one in found] == [known.get(id(ranks[i])) for i in order]


@pytest.mark.parametrize("partial", [True, False])
@pytest.mark.parametrize(
    ("fine", "less"),
    [([0.16, 0.12], True), ([0.111, 0.12], True), ([0.11, 0.12], False), ([0.1, 0.12], False)],
)
def test_parts_that_explain_less_on_the_shapes_than_on_proxies_stay_as_they_were(
    monkeypatch: pytest.MonkeyPatch, partial: bool, fine: list[float], less: bool
) -> None:
    ranks = [candidate(0.11), candidate(0.112)]
    known = {id(one): candidate(energy) for one, energy in zip(ranks, fine, strict=True)}
    monkeypatch.setattr(_polish, "refined", lambda sides, one: known[id(one)])
    monkeypatch.setattr(_polish, "_fine_energy", lambda sides, one: 1 / one.energy)
    found, told = settled(SimpleNamespace(partial=partial), ranks)
    if partial and less:
        assert found == ranks
    else:  # by details the dearer one is the better one
        dearer = int(np.argmax(fine))
        assert [told[one] for one in found] == [known[id(ranks[i])] for i in (dearer, 1 - dearer)]
    assert set(told.values()) == set(known.values())  # nothing is registered twice


def test_small_eyes_tell_which_arm_is_which() -> None:
    """Arms are alike; what their places differ by is small, and best seen on the shapes."""
    source = make_octopus("floating", n_vertices=2000)
    target = make_octopus("resting", n_vertices=2000, meshing=1)
    truth = target.mesh.vertices[rest_map(source, target)]
    ours, theirs = (prepare_shape(one.mesh, 100, False).shape for one in (source, target))
    sides = make_sides(ours, theirs)
    right, *others = candidates(sides)
    found, fine = settled(sides, [*others[:2], right])
    off = target.mesh.vertices[fine[found[0]].registered.forward] - truth
    assert np.linalg.norm(off, axis=1).mean() < 0.05
    assert found[0].registered is right.registered
    # It is further ahead than on the proxies.
    assert found[1].energy / found[0].energy > others[0].energy / right.energy


@pytest.mark.parametrize("torn", [False, True])
def test_slides_tell_maps_of_whole_shapes_apart_and_small_patches_those_of_parts(
    monkeypatch: pytest.MonkeyPatch, torn: bool
) -> None:
    ball = make_sphere(2)
    box = Mesh(ball.vertices * [1.6, 1.0, 0.7], ball.faces)
    if torn:
        box = keep(box, box.vertices[:, 0] < 0.9).mesh
    bent = Mesh(box.vertices + np.outer(box.vertices[:, 0] ** 2, [0, 0.4, 0]), box.faces)
    both = [prepare_shape(one, 30, False, True).shape for one in (box, bent)]
    sides = make_sides(*both)
    every = np.arange(len(box.vertices))
    half = np.where(box.vertices[:, 0] > 0, np.roll(every, 1), every)
    start = mapped_start(*both, half, half, 1.0)
    judged = []

    def judge_and_keep(*given: Any) -> Candidate:
        judged.append(judge(*given))
        return judged[-1]

    monkeypatch.setattr(_polish, "judge", judge_and_keep)
    found = refined(sides, judge(*both, start))
    assert len(judged) == (1 if torn else 2)  # a part has no functions in common to grow with
    assert found.energy == min(one.energy for one in judged)
    energies = [judge(*both, found.registered, wide=one).energy for one in (torn, not torn)]
    assert found.energy == pytest.approx(energies[1], rel=1e-6)
    assert abs(found.energy - energies[0]) > 1e-4


def test_a_map_grows_as_far_as_both_have_functions() -> None:
    egg = make_egg(2)
    many = prepare_shape(egg, 60, False).shape
    few = replace(many, eigenvalues=many.eigenvalues[:30], basis=many.basis[:, :30])
    every = np.arange(egg.n_vertices)
    near = mapped_start(many, few, every, every, 1.0)
    for sides in ((many, few), (few, many), (many, many)):
        found = grown_start(*sides, np.eye(20), near)
        np.testing.assert_array_equal(found.forward, every)
        np.testing.assert_array_equal(found.backward, every)
        # Poses are as smooth as so many functions are.
        k = min(one.k for one in sides)
        smooth = many.basis[:, :k] @ many.position_coefficients[:k]
        np.testing.assert_allclose(found.source.places, smooth, atol=1e-9)


def test_two_meshes_and_the_mirror_image_of_one_are_laid_onto_each_other() -> None:
    few, many, mirrored = (
        prepare_shape(make_egg(*one), 40, False).shape for one in ((2, 1), (3, 1), (3, -1))
    )
    forward = np.arange(162)
    backward = cKDTree(few.vertices).query(many.vertices)[1]
    plain = make_sides(few, many)
    for sides, reflected in (
        (plain, False),
        (plain.reflected().reflected(), False),
        (make_sides(few, mirrored), True),
        (make_sides(few, mirrored).reflected(), True),
    ):
        start = mapped_start(few, many, forward, backward, 1.0)
        begun = replace(judge(few, many, start), reflected=reflected)
        as_it_is, found = (refined(sides, begun, polish=one) for one in (False, True))
        assert as_it_is.energy == pytest.approx(begun.energy, rel=1e-4)
        np.testing.assert_array_equal(as_it_is.registered.forward, forward)
        off = many.vertices[found.registered.forward] - few.vertices
        assert np.linalg.norm(off, axis=1).mean() < many.edge
        for one in (as_it_is, found):
            assert one.reflected == reflected
            assert one.orientation > 0.95
            assert one.energy < 0.12
            told = fine_energy(few, many, one.registered)
            assert _fine_energy(sides, one) == pytest.approx(told, rel=1e-4)


def test_maps_grow_by_quarters(monkeypatch: pytest.MonkeyPatch) -> None:
    few, many = (prepare_shape(make_egg(level), 80, False).shape for level in (2, 3))
    near = mapped_start(few, many, np.arange(162), np.zeros(642, dtype=int), 1.0)
    grown: list[int] = []

    def grow(source: Any, target: Any, functional_map: np.ndarray, sizes: list[int]) -> np.ndarray:
        for shape, (values, basis) in ((few, source), (many, target)):
            assert values is shape.eigenvalues
            np.testing.assert_array_equal(basis, shape.basis[shape.samples[: len(basis)]])
        grown.extend([len(functional_map), *sizes])
        return np.eye(sizes[-1])

    monkeypatch.setattr(_polish, "grow", grow)
    found = grown_start(few, many, np.eye(20), near)
    assert grown[0] == 20
    assert grown[-1] == 79
    assert all(one < other < 1.3 * one for one, other in itertools.pairwise(grown))
    assert found.forward.shape == (162,)
    assert found.source.places.shape == (162, 3)


def test_a_vertex_has_a_partner_where_most_around_it_have() -> None:
    sheet = prepare_shape(make_sheet(15), 10, False, partial=True).shape
    inner = np.abs(sheet.vertices[:, :2]).max(axis=1) < 0.4
    beyond = sheet.vertices[:, 0] + 0.2
    most = beyond > 0
    scattered = np.random.default_rng(0).random(225) < 0.2
    ragged = most ^ (scattered & inner & (np.abs(beyond) > 0.15))
    assert (ragged != most).sum() > 5
    away = np.abs(beyond) > 0.1
    pose = mapped_start(sheet, sheet, *[np.arange(225)] * 2, 1.0).source
    poses = [pose._replace(within=one) for one in (ragged, np.ones(225, dtype=bool))]
    begun = replace(candidate(0.1), registered=Registered(np.arange(225), np.arange(225), *poses))
    level = SimpleNamespace(shape=sheet)
    sides = SimpleNamespace(source=level, target=level)
    found = with_partners(begun, sides, 0.2).registered
    np.testing.assert_array_equal(found.source.within[away], most[away])
    assert found.target.within.all()
    assert found.forward is begun.registered.forward
    assert found.backward is begun.registered.backward
    assert found.source.places is pose.places
    # Three tenths have none; if that is less than is to have none, all have one.
    assert with_partners(begun, sides, 0.4).registered.source.within.all()


def test_a_patch_has_none_only_where_the_other_shape_ends() -> None:
    """A ball, and the same without its upper cap: what is missed on the lower one is given back."""
    ball = make_sphere(3)
    upper, lower = ball.vertices[:, 2] > 0.6, ball.vertices[:, 2] < -0.9
    bitten = keep(ball, ~upper)
    whole, part = (prepare_shape(one, 10, False, partial=True).shape for one in (ball, bitten.mesh))
    back, ahead = bitten.origin, cKDTree(bitten.mesh.vertices).query(ball.vertices)[1]
    poses = mapped_start(whole, part, ahead, back, 1.0)[2:]
    poses = [poses[0]._replace(within=~(upper | lower)), poses[1]._replace(within=back >= 0)]
    begun = replace(candidate(0.1), registered=Registered(ahead, back, *poses))
    levels = [SimpleNamespace(shape=shape) for shape in (whole, part)]
    found = with_partners(begun, SimpleNamespace(source=levels[0], target=levels[1]), 0.0)
    middle = np.abs(ball.vertices[:, 2] - 0.6) > 0.2
    np.testing.assert_array_equal(found.registered.source.within[middle], ~upper[middle])
    assert found.registered.target.within.all()


def test_half_of_those_around_is_not_most() -> None:
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    every = prepare_shape(Mesh(corners, faces), 2, False).shape  # each beside every other one
    for n, most in ((4, True), (3, True), (2, False), (1, False)):
        assert _as_most_around(every, np.arange(4) < n).tolist() == [most] * 4
