"""Hypotheses mended from what they explain best: truths that hold for a body that did not move."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from unbend import Mesh
from unbend._types import BoolArray, IntArray
from unbend.datasets import make_quadruped, make_sphere, rest_map
from unbend.matching import _constants as constants
from unbend.matching._extrapolation import _best_explained, extrapolate, patches_to_hold
from unbend.matching._inputs import prepare_shape
from unbend.matching._registration import Registered, mapped_start
from unbend.matching._shape import Shape

SOURCE = make_quadruped("standing", n_vertices=500)
TARGET = make_quadruped("standing", n_vertices=500, meshing=1)
THERE, BACK = rest_map(SOURCE, TARGET), rest_map(TARGET, SOURCE)


@pytest.fixture(scope="module")
def shapes() -> tuple[Shape, Shape]:
    first, second = (prepare_shape(body.mesh, 20).shape for body in (SOURCE, TARGET))
    return first, second


@pytest.fixture(scope="module")
def swapped(shapes: tuple[Shape, Shape]) -> Registered:
    """Right but for one foreleg, which lies on the other one."""
    forward = np.where(_leg(), TARGET.mirror[THERE], THERE)
    return mapped_start(*shapes, forward, BACK, 1.0)


def _leg() -> BoolArray:
    named = [i for i, part in enumerate(SOURCE.parts) if "foreleg" in part]
    return np.asarray(SOURCE.labels == named[0])


def _off(found: IntArray, shape: Shape) -> np.ndarray:
    return np.linalg.norm(shape.vertices[found] - shape.vertices[THERE], axis=1)


def _all_continued(shapes: tuple[Shape, Shape], found: Registered) -> list[Registered]:
    return [extrapolate(*shapes, found, held) for held in patches_to_hold(*shapes, found)]


def test_a_leg_that_lies_on_the_other_one_finds_back(
    shapes: tuple[Shape, Shape], swapped: Registered
) -> None:
    assert _off(swapped.forward, shapes[1])[_leg()].mean() > 0.1
    mended = _all_continued(shapes, swapped)
    assert min(_off(one.forward, shapes[1])[_leg()].mean() for one in mended) < 0.03


def test_what_is_right_stays_so(shapes: tuple[Shape, Shape]) -> None:
    for one in _all_continued(shapes, mapped_start(*shapes, THERE, BACK, 1.0)):
        assert _off(one.forward, shapes[1]).mean() < 0.02


def test_either_piece_of_a_twisted_map_is_held() -> None:
    """One end of a box as it is, the other half a turn on: either end may be right."""
    ball = make_sphere(3)
    box = prepare_shape(Mesh(ball.vertices * [2.4, 1.0, 0.7], ball.faces), 20).shape
    every = np.arange(len(box.areas))
    turned = cKDTree(box.vertices).query(box.vertices * [1, -1, -1])[1]
    front = box.vertices[:, 0] > 0
    twisted = np.where(front, every, turned)
    found = mapped_start(box, box, twisted, twisted, 1.0)
    held = patches_to_hold(box, box, found)
    assert len(held) == 3  # both, and each
    for mine, other in held:
        moved = extrapolate(box, box, found, (mine, other))
        np.testing.assert_array_equal(moved.forward[mine], twisted[mine])
        np.testing.assert_array_equal(moved.backward[other], twisted[other])
    leads = [extrapolate(box, box, found, one).forward for one in held[1:]]
    for truth in (every, turned):
        off = [np.linalg.norm(box.vertices[one] - box.vertices[truth], axis=1) for one in leads]
        assert min(one.mean() for one in off) < 0.02


def test_the_rest_turns_with_what_is_held(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of a turned ellipsoid is held; the rest goes where it belongs.

    It stays there if it began turned, and comes ever nearer if it did not.
    """
    ball = make_sphere(2)
    places = ball.vertices * [2.4, 1.0, 0.7]
    angle = np.radians(20)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    box, turned = (
        prepare_shape(Mesh(one, ball.faces), 20).shape for one in (places, places @ turn.T)
    )
    every = np.arange(len(places))
    right = mapped_start(box, turned, every, every, 1.0)
    held = box.vertices[:, 0] > 0, turned.vertices @ turn[:, 0] > 0
    unturned = [
        pose._replace(rotations=np.tile(np.eye(3), (len(every), 1, 1))) for pose in right[2:]
    ]

    def distances(found: Registered) -> np.ndarray:
        """Of both shapes' vertices from where they belong, (2, n)."""
        carried = extrapolate(box, turned, found, held)
        np.testing.assert_array_equal(carried.forward[held[0]], every[held[0]])
        np.testing.assert_array_equal(carried.backward[held[1]], every[held[1]])
        ahead = carried.source.places - turned.vertices
        return np.linalg.norm([ahead, carried.target.places - box.vertices], axis=2)

    np.testing.assert_allclose(distances(right), 0, atol=1e-9)
    carried = extrapolate(box, turned, right, held)
    np.testing.assert_array_equal(carried.forward, every)
    np.testing.assert_array_equal(carried.backward, every)
    began_unturned = Registered(every, every, *unturned)
    apart = np.linalg.norm(turned.vertices - box.vertices, axis=1).mean()
    assert (distances(began_unturned).mean(axis=1) < apart / 2).all()
    monkeypatch.setattr(constants, "STEPS", 100)
    np.testing.assert_allclose(distances(began_unturned), 0, atol=1e-4)


def test_where_nothing_has_a_partner_nothing_is_held(
    shapes: tuple[Shape, Shape], swapped: Registered
) -> None:
    none = swapped.source._replace(overlap=np.zeros(len(shapes[0].areas), dtype=bool))
    assert patches_to_hold(*shapes, swapped._replace(source=none)) == []


def test_the_best_explained_half_of_what_has_a_partner_is_held() -> None:
    areas = np.array([1.0, 0.0, 2.0, 1.0, 2.0, 2.0])
    shares = np.array([0.1, 0.0, 0.5, 0.2, 0.3, 0.4])
    held = _best_explained(areas, shares)  # one, one and two, of eight
    np.testing.assert_array_equal(np.flatnonzero(held), [0, 3, 4])
