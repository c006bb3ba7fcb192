"""Parts that only one of two closed bodies has."""

import numpy as np
import pytest

from testshapes.changed import is_usual, make_changed
from unbend import match
from unbend.datasets import Shape


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


def test_everything_has_a_partner_where_nothing_may_be_lacking(
    riders: tuple[Shape, Shape],
) -> None:
    ridden, free = riders  # the horse with the rider lacks nothing
    found = match(ridden.mesh, free.mesh, partial="source")
    assert (found.source_to_target >= 0).all()
