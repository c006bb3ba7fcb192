"""Registration: what it must not depend on, and truths that it must reach."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from unbend import Mesh
from unbend.alignment import Pairs
from unbend.datasets import make_biped, make_sphere
from unbend.matching import _constants as constants
from unbend.matching._inputs import prepare_shape
from unbend.matching._registration import (
    Pose,
    Registered,
    _Moving,
    lift,
    mapped_start,
    register,
    rough_start,
)
from unbend.matching._score import scored
from unbend.matching._search import orthogonal_maps
from unbend.matching._shape import Shape, make_proxy

pytestmark = pytest.mark.usefixtures("as_meshed")


def _shape(mesh: Mesh) -> Shape:
    return prepare_shape(mesh, 60)[1]


def _same_numbers(source: Shape, target: Shape, k: int) -> np.ndarray:
    """The functional map under which every vertex has its own number."""
    every = np.arange(len(source.vertices))[None]
    pairs = Pairs(every, every, np.zeros(1))
    return orthogonal_maps(source.basis[:, :k], target.basis[:, :k], pairs)[0]


def _registered(source: Shape, target: Shape, functional_map: np.ndarray) -> Registered:
    (found,) = register(
        source, target, [rough_start(source, target, functional_map)], constants.DATA_WEIGHTS[4:], 8
    )
    return found


def _turn(seed: int) -> np.ndarray:
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return turn * np.linalg.det(turn)


def _mean_error(point_map: np.ndarray, goal: Shape) -> float:
    """Mean distance, in sqrt(area), from where vertices of the same number are."""
    return float(np.linalg.norm(goal.vertices[point_map] - goal.vertices, axis=1).mean())


def _agree(one: np.ndarray, other: np.ndarray, goal: Shape) -> bool:
    """Whether two maps are the same but for what rounding decides: a vertex, or its neighbour."""
    apart = np.linalg.norm(goal.vertices[one] - goal.vertices[other], axis=1)
    return bool((one == other).mean() > 0.9 and apart.mean() < 0.004)


def _shuffled(shape: Shape, order: np.ndarray) -> Shape:
    """The same shape, its vertices in another order."""
    return Shape(
        shape.vertices[order],
        np.argsort(order)[shape.faces],
        shape.areas[order],
        shape.eigenvalues,
        shape.basis[order],
        shape.partial,
    )


@pytest.fixture(scope="module")
def standing() -> Shape:
    return _shape(make_biped("standing", n_vertices=700).mesh)


@pytest.fixture(scope="module")
def walking() -> Shape:
    return _shape(make_biped("walking", n_vertices=700).mesh)


@pytest.fixture(scope="module")
def found(standing: Shape, walking: Shape) -> Registered:
    return _registered(standing, walking, _same_numbers(standing, walking, 12))


def test_the_identity_stays_the_identity(standing: Shape) -> None:
    every = np.arange(700)
    turns = np.tile(np.eye(3), (700, 1, 1))
    pose = Pose(standing.vertices, turns, every >= 0)
    (found,) = register(
        standing, standing, [Registered(every, every, pose, pose)], constants.DATA_WEIGHTS[4:], 8
    )
    np.testing.assert_array_equal(found.forward, every)
    np.testing.assert_array_equal(found.backward, every)
    for end in (found.source, found.target):
        np.testing.assert_allclose(end.places, standing.vertices, atol=1e-9)
        np.testing.assert_allclose(end.rotations, turns, atol=1e-9)
    np.testing.assert_array_equal(pose.rotations, turns)  # what was given is not changed


def test_a_pose_is_reached_from_a_rough_start(
    standing: Shape, walking: Shape, found: Registered
) -> None:
    source, target = standing, walking
    start = rough_start(source, target, _same_numbers(source, target, 12))
    for point_map, pose, own, goal in (
        (found.forward, found.source, source, target),
        (found.backward, found.target, target, source),
    ):
        assert _mean_error(point_map, goal) < 0.005
        assert np.linalg.norm(pose.places - goal.vertices, axis=1).mean() < 0.005
        turned = np.linalg.norm(pose.places - own.vertices, axis=1).mean()
        assert turned > 0.02  # the poses do differ
        np.testing.assert_allclose(np.linalg.det(pose.rotations), 1)
    assert _mean_error(found.forward, target) < _mean_error(start.forward, target)
    assert scored(source, target, found).energy < 0.05


def test_a_shape_that_only_has_to_move_arrives_in_one_step(standing: Shape) -> None:
    every = np.arange(700)
    turns = np.tile(np.eye(3), (700, 1, 1))
    goal = replace(standing, vertices=standing.vertices + np.array([0.3, -0.2, 0.1]))
    still = Pose(standing.vertices, turns, every >= 0)

    def after_a_step(shape: Shape, *start: Any) -> _Moving:
        begun = Registered(*start)
        moving = _Moving(standing, [begun], constants.NORMAL_WEIGHTS[0])
        moving.step(300.0, _Moving(shape, [begun.back()], constants.NORMAL_WEIGHTS[0]))
        return moving

    moving = after_a_step(goal, every, every, still, still)
    np.testing.assert_allclose(moving.places[:, 0], goal.vertices, atol=1e-8)
    np.testing.assert_allclose(moving.rotations[:, 0], turns, atol=1e-6)
    # The next closest points are sought ahead, farther in the same direction.
    shares = (moving.ahead[:, 0] - goal.vertices) / (goal.vertices - standing.vertices)
    np.testing.assert_allclose(shares, shares[0, 0], atol=1e-6)
    assert 0.3 < shares[0, 0] < 1
    # If the goal's own vertices do not pull, it goes half the way.
    lost = still._replace(overlap=every < 0)
    half = after_a_step(goal, every, every, still, lost)
    between = (standing.vertices + goal.vertices) / 2
    np.testing.assert_allclose(half.places[:, 0], between, atol=1e-8)
    # Without partners nothing pulls, and it stays where it is.
    alone = after_a_step(goal, every, every, lost, lost)
    np.testing.assert_allclose(alone.places[:, 0], standing.vertices, atol=1e-8)


@pytest.mark.parametrize("partial", [False, True])
def test_poses_side_by_side_do_not_mind_each_other(
    standing: Shape, walking: Shape, partial: bool
) -> None:
    ours, theirs = (replace(one, partial=partial) for one in (standing, walking))
    starts = [rough_start(ours, theirs, _same_numbers(standing, walking, k)) for k in (12, 30, 20)]
    together = register(ours, theirs, starts, constants.DATA_WEIGHTS[4:], 8)
    for start, found in zip(starts, together, strict=True):
        (alone,) = register(ours, theirs, [start], constants.DATA_WEIGHTS[4:], 8)
        assert _agree(found.forward, alone.forward, walking)
        assert _agree(found.backward, alone.backward, standing)
        np.testing.assert_allclose(found.source.places, alone.source.places, atol=0.01)
        assert found.source.size == pytest.approx(alone.source.size, abs=1e-3)
    assert register(ours, theirs, [], constants.DATA_WEIGHTS[4:], 8) == []


@pytest.mark.parametrize("flat", [1.0, 0.6])  # a round rod knows no turn about itself
def test_a_rod_that_is_bent_is_the_same_rod(flat: float) -> None:
    ball = make_sphere(3)
    x, y, z = (ball.vertices * [3, 0.6, 0.6 * flat]).T
    angle, radius = x / 3, 3.0  # two radians in all, along the middle without stretch
    bent = np.stack([(radius + y) * np.sin(angle), (radius + y) * np.cos(angle), z], axis=1)
    rod, target = (_shape(Mesh(one, ball.faces)) for one in (np.stack([x, y, z], axis=1), bent))
    found = _registered(rod, target, _same_numbers(rod, target, 6))
    assert _mean_error(found.forward, target) < 0.002
    assert _mean_error(found.backward, rod) < 0.002
    assert np.linalg.norm(found.source.places - target.vertices, axis=1).mean() < 0.005
    # Turns of neighbourhoods are those of the arc: at the ends, one radian either way.
    ends = [int(x.argmax()), int(x.argmin())]
    cosines = np.einsum("nii->n", found.source.rotations[ends]) / 2 - 0.5
    spread = np.einsum("ii", found.source.rotations[ends[0]].T @ found.source.rotations[ends[1]])
    assert np.arccos(spread / 2 - 0.5) == pytest.approx(2.0, abs=0.25)
    np.testing.assert_allclose(np.arccos(cosines), 1.0, atol=0.25)


def test_motions_of_a_shape_do_not_matter(
    standing: Shape, walking: Shape, found: Registered
) -> None:
    turn = _turn(0)
    moved = replace(walking, vertices=walking.vertices @ turn.T)
    again = _registered(standing, moved, _same_numbers(standing, walking, 12))
    assert _agree(again.forward, found.forward, walking)
    assert _agree(again.backward, found.backward, standing)
    apart = np.linalg.norm(again.source.places - found.source.places @ turn.T, axis=1)
    assert apart.mean() < 0.004
    one, two = scored(standing, walking, found), scored(standing, moved, again)
    assert two.energy == pytest.approx(one.energy, abs=0.005)
    assert two.orientation == pytest.approx(one.orientation, abs=0.01)


def test_neither_shape_is_the_first(standing: Shape, walking: Shape, found: Registered) -> None:
    again = _registered(walking, standing, _same_numbers(walking, standing, 12))
    assert _agree(again.backward, found.forward, walking)
    assert _agree(again.forward, found.backward, standing)


def test_a_rough_start_of_all_functions_is_the_identity(blob: Mesh) -> None:
    shape = _shape(blob)
    start = rough_start(shape, shape, np.eye(shape.k))
    every = np.arange(blob.n_vertices)
    np.testing.assert_array_equal(start.forward, every)
    np.testing.assert_array_equal(start.backward, every)
    turns = np.tile(np.eye(3), (len(every), 1, 1))
    np.testing.assert_allclose(start.source.rotations, turns, atol=1e-6)
    assert [one.overlap.dtype for one in start[2:]] == [bool, bool]
    assert start.source.overlap.all()
    smooth = shape.basis @ shape.position_coefficients
    np.testing.assert_allclose(start.source.places, smooth, atol=1e-9)
    assert np.linalg.norm(smooth - shape.vertices, axis=1).max() < 0.05


def test_what_is_lifted_stays_as_it_is_where_it_was_known(standing: Shape, walking: Shape) -> None:
    coarse = make_proxy(standing, 300), make_proxy(walking, 200)
    ours, theirs = (one.shape for one in coarse)
    start = _registered(ours, theirs, _same_numbers(standing, walking, 12)[:12, :12])
    half = np.arange(300) % 2 == 0
    start = start._replace(source=start.source._replace(overlap=half, size=1.2))
    fine = lift(start, *coarse, standing, walking)
    assert fine.source.size == 1.2
    np.testing.assert_array_equal(fine.source.overlap, half[coarse[0].parents])
    mine, other = coarse
    np.testing.assert_array_equal(fine.forward[mine.kept], other.kept[start.forward])
    np.testing.assert_array_equal(fine.backward[other.kept], mine.kept[start.backward])
    for proxy, lifted, begun in zip(coarse, fine[2:], start[2:], strict=True):
        for one, known in zip(lifted[:3], begun[:3], strict=True):
            np.testing.assert_allclose(one[proxy.kept], known)


@pytest.mark.parametrize("parts", [(False, False), (True, False), (False, True)])
def test_maps_begin_with_poses_that_are_turned_and_larger_if_either_is_a_part(
    standing: Shape, parts: tuple[bool, bool]
) -> None:
    order, turn = np.random.default_rng(0).permutation(700), _turn(3)
    source = replace(standing, partial=parts[0])
    shuffled = _shuffled(standing, order)
    target = replace(shuffled, vertices=shuffled.vertices @ turn.T, partial=parts[1])
    found = mapped_start(source, target, np.argsort(order), order, 1.3)
    np.testing.assert_array_equal(found.forward, np.argsort(order))
    np.testing.assert_array_equal(found.backward, order)
    assert found.source.size == (1.3 if any(parts) else 1.0)
    assert found.target.size == pytest.approx(1 / found.source.size)
    for pose, shape, motion in ((found.source, source, turn), (found.target, target, turn.T)):
        assert pose.overlap.dtype == bool
        assert pose.overlap.all()
        np.testing.assert_allclose(pose.rotations, np.tile(motion, (700, 1, 1)), atol=1e-6)
        smooth = shape.averaged(shape.areas[:, None] * shape.vertices, 2 * constants.PATCH)
        np.testing.assert_allclose(pose.places, smooth @ motion.T, atol=1e-9)


@pytest.mark.parametrize(("share", "median"), [(0.4, 2.0), (0.6, 1.5)])
def test_how_much_longer_things_are_is_the_median_of_what_has_partners(
    standing: Shape, share: float, median: float
) -> None:
    """A share of the area, from below, grows by one and a half. The rest grows by two."""
    order = np.argsort(standing.vertices[:, 1])
    lower = np.zeros(700, dtype=bool)
    lower[order[np.cumsum(standing.areas[order]) < share]] = True
    turns = np.tile(_turn(1), (700, 1, 1))
    grown = standing.vertices * np.where(lower, 1.5, 2)[:, None] @ _turn(1).T
    every = np.arange(700)
    poses = [Pose(grown, turns, overlap) for overlap in (~lower, lower, lower | ~lower)]
    starts = [Registered(every, every, one, one) for one in poses]
    moving = _Moving(standing, starts, constants.NORMAL_WEIGHTS[0])  # side by side
    moving.covariances = standing.averaged(standing.covariances(moving.places))
    assert moving.stretch() == pytest.approx([2, 1.5, median], rel=0.03)


def test_all_of_a_part_has_a_partner_on_what_is_whole(standing: Shape, walking: Shape) -> None:
    """And what is whole has one where that leads back."""
    part = replace(standing, partial=True)
    part.__dict__.update(
        boundary_length=np.inf, boundary_distances=np.zeros(700)
    )  # it may lack anything
    every = np.arange(700)
    shuffled = np.random.default_rng(0).permutation(700)
    start = mapped_start(part, walking, every, shuffled, 1.0)
    (found,) = register(part, walking, [start], constants.DATA_WEIGHTS[4:5], 1)
    assert found.source.overlap.all()
    returned = walking.vertices[found.forward[found.backward]]
    off = np.linalg.norm(walking.vertices - returned, axis=1) / walking.edge
    assert (off > 3).any()
    assert not found.target.overlap[off > 3].any()
    assert found.target.overlap[off < 1].all()


@pytest.mark.parametrize("parts", [(False, False), (True, False), (False, True)])
def test_how_much_larger_a_part_is_found_unless_asked_not_to(
    standing: Shape, parts: tuple[bool, bool]
) -> None:
    every, still = np.arange(200), np.tile(np.eye(3), (200, 1, 1))
    coarse = make_proxy(standing, 200).shape
    ours = replace(coarse, partial=parts[0])
    theirs = replace(coarse, vertices=1.3 * coarse.vertices, partial=parts[1])
    start = Registered(
        every,
        every,
        Pose(theirs.vertices, still, every >= 0),
        Pose(ours.vertices, still, every >= 0),
    )
    for options, resized in (({}, True), ({"resize": True}, True), ({"resize": False}, False)):
        (found,) = register(ours, theirs, [start], constants.DATA_WEIGHTS[4:5], 8, **options)
        size = 1.3 if any(parts) and resized else 1
        assert found.source.size == pytest.approx(size, rel=0.02)
        assert found.target.size == pytest.approx(1 / size, rel=0.02)
