"""The judge: truths about its energy."""

import numpy as np

from unbend.datasets import make_biped
from unbend.matching._inputs import prepare_shape
from unbend.matching._judge import _unexplained, distinct, judge, ranked
from unbend.matching._registration import Pose, Registered
from unbend.matching._shape import Shape


def _person() -> Shape:
    return prepare_shape(make_biped("walking", n_vertices=1000).mesh, 30, True, None)[1]


def _identity(shape: Shape) -> Registered:
    every = np.arange(len(shape.vertices))
    pose = Pose(shape.vertices, np.tile(np.eye(3), (len(every), 1, 1)))
    return Registered(every, every, pose, pose)


def test_turns_and_scales_cost_nothing_and_mirrors_and_collapses_do() -> None:
    shape = _person()
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    assert abs(_unexplained(shape, 3 * shape.vertices @ turn.T + 5)) < 1e-9
    assert _unexplained(shape, shape.vertices * [-1, 1, 1]) > 0.2
    assert abs(_unexplained(shape, 0 * shape.vertices) - 1) < 1e-9


def test_rank_puts_the_gate_before_the_energy() -> None:
    shape = _person()
    identity = _identity(shape)
    right = judge(shape, shape, identity)
    assert right.energy < 1e-9
    assert right.orientation > 0.99
    inside_out = Pose(shape.vertices * [-1, 1, 1], identity.source.rotations)
    wrong = judge(shape, shape, identity._replace(source=inside_out, target=inside_out))
    assert wrong.orientation < 0
    assert ranked([wrong, right]) == [right]
    assert ranked([wrong]) == [wrong]


def test_distinct_maps_lead_to_other_limbs() -> None:
    shape = _person()
    identity = _identity(shape)
    order = np.argsort(shape.vertices[:, 1])
    shifted = np.empty_like(order)
    shifted[order] = np.roll(order, 1)  # each vertex to the next one up: another limb as a rule
    first = judge(shape, shape, identity)
    second = judge(shape, shape, identity._replace(forward=shifted))
    assert distinct([first, first], shape, shape.areas) == [first]
    assert distinct([first, second], shape, shape.areas) == [first, second]
