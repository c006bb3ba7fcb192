"""Parts that only one of two closed bodies has."""

import numpy as np
import pytest

from testshapes.changed import is_usual, make_changed
from unbend import match
from unbend.datasets import Shape
from unbend.matching._inputs import prepare_shapes
from unbend.matching._plan import MEDIUM, candidates, make_sides
from unbend.matching._polish import without_extras


@pytest.fixture(scope="module")
def riders() -> tuple[Shape, Shape]:
    """A horse with a rider, and one without, in other poses."""
    chance = np.random.default_rng(7)
    ridden, free = (make_changed(chance, "quadruped", one, 1200) for one in ("rider", ""))
    return ridden, free


def test_a_rider_has_no_partner_on_a_horse_without_one(riders: tuple[Shape, Shape]) -> None:
    ridden, free = riders
    found = match(ridden.mesh, free.mesh)
    usual, partner = is_usual(ridden), found.source_to_target >= 0
    assert (partner == usual).mean() > 0.95
    assert found.overlap_source == pytest.approx(usual.mean(), abs=0.1)
    assert found.overlap_target > 0.95
    off = (
        ridden.reference[usual & partner] - free.reference[found.source_to_target[usual & partner]]
    )
    assert np.linalg.norm(off, axis=1).mean() < 0.03


def test_maps_are_ranked_by_what_they_explain_without_such_parts(
    riders: tuple[Shape, Shape],
) -> None:
    one, other = prepare_shapes([shape.mesh for shape in riders], 30, (True, True))
    sides = make_sides(one.shape, other.shape)
    right, *wrong = candidates(sides)
    # The horse with the rider lacks nothing.
    assert without_extras(sides, [right, *wrong], (True, False))[0] is right
    best, last = (
        without_extras(sides, ranks, (True, True))[0]
        for ranks in ([right, *wrong], [*wrong[:3], right])
    )
    assert last.energy == best.energy < right.energy
    assert 0.6 < best.registered.source.overlap @ sides.at(MEDIUM)[0].areas < 0.95
