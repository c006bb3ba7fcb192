"""From coarse copies to the shapes: what is told apart there, and by what."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from unbend import Mesh
from unbend.datasets import keep, make_octopus, make_sphere, rest_map
from unbend.matching import _polish
from unbend.matching._inputs import prepare_shape
from unbend.matching._judge import Candidate, judge
from unbend.matching._polish import grown_start, refined, settled
from unbend.matching._registration import mapped_start
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
        ([0.1, 0.11], [0.0, 0.2], [0, 1], [0.0, 2e4]),
        ([0.1, 0.2], [], [0, 1], [0.1, 0.2]),
    ],
)
@pytest.mark.parametrize(("partial", "finer"), [(True, False), (False, True), (False, False)])
def test_what_costs_nearly_the_same_is_told_apart_on_the_shapes(
    monkeypatch: pytest.MonkeyPatch, rough, fine, order, energies, partial, finer
) -> None:
    ranks = [candidate(one) for one in rough]
    known = {id(one): candidate(energy) for one, energy in zip(ranks, fine, strict=False)}
    monkeypatch.setattr(_polish, "refined", lambda sides, one: known[id(one)])
    monkeypatch.setattr(_polish, "_by_details", lambda sides, one: one.energy)
    found, told = settled(SimpleNamespace(partial=partial, finer=finer), ranks)
    if partial or finer:
        assert [one.energy for one in found] == pytest.approx(energies)
        assert [told.get(one) for one in found] == [known.get(id(ranks[i])) for i in order]
    else:  # whole shapes that are their own proxies show no more
        assert (found, told) == (ranks, {})


def test_small_eyes_tell_which_arm_is_which() -> None:
    """Arms are alike; what their places differ by is small, and best seen on the shapes."""
    source = make_octopus("floating", n_vertices=2000)
    target = make_octopus("resting", n_vertices=2000, meshing=1)
    truth = target.mesh.vertices[rest_map(source, target)]
    ours, theirs = (prepare_shape(one.mesh, 100, False).shape for one in (source, target))
    sides = make_sides(ours, theirs)
    assert sides.finer
    right, *others = candidates(sides)
    found, fine = settled(sides, [*others[:2], right])
    off = target.mesh.vertices[fine[found[0]].registered.forward] - truth
    assert np.linalg.norm(off, axis=1).mean() < 0.05
    assert found[0].registered is right.registered
    # It is further ahead than on the proxies.
    assert found[1].energy / found[0].energy > others[0].energy / right.energy


@pytest.mark.parametrize("torn", [False, True])
def test_slides_tell_maps_of_whole_shapes_apart_and_small_patches_those_of_parts(
    torn: bool,
) -> None:
    ball = make_sphere(2)
    box = Mesh(ball.vertices * [1.6, 1.0, 0.7], ball.faces)
    if torn:
        box = keep(box, box.vertices[:, 0] < 0.9).mesh
    shape = prepare_shape(box, 30, False, True).shape
    sides = make_sides(shape, shape)
    every = np.arange(len(shape.areas))
    half = np.where(shape.vertices[:, 0] > 0, np.roll(every, 1), every)
    start = mapped_start(shape, shape, half, half, 1.0)
    found = refined(sides, judge(shape, shape, start))
    energies = [judge(shape, shape, found.registered, wide=one).energy for one in (torn, not torn)]
    assert found.energy == pytest.approx(energies[1], rel=1e-6)
    assert found.energy != pytest.approx(energies[0], rel=1e-4)


def test_a_map_grows_as_far_as_both_have_functions() -> None:
    ball = make_sphere(2)
    x, y, z = ball.vertices.T
    egg = np.stack([x * (1.3 + 0.4 * y + 0.2 * z), y, 0.7 * z + 0.2 * y**2], axis=1)
    many = prepare_shape(Mesh(egg, ball.faces), 60, False).shape
    few = replace(many, eigenvalues=many.eigenvalues[:30], basis=many.basis[:, :30])
    every = np.arange(len(egg))
    near = mapped_start(many, few, every, every, 1.0)
    for sides in ((many, few), (few, many), (many, many)):
        found = grown_start(*sides, np.eye(20), near)
        np.testing.assert_array_equal(found.forward, every)
        np.testing.assert_array_equal(found.backward, every)
        # Poses are as smooth as so many functions are.
        k = min(one.k for one in sides)
        smooth = many.basis[:, :k] @ many.position_coefficients[:k]
        np.testing.assert_allclose(found.source.places, smooth, atol=1e-9)
