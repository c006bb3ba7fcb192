"""Alignment: truths about rigid motions in any dimension."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from unbend.alignment import align, icp, nearest_rotation, procrustes
from unbend.alignment._alignment import _axis_choices, _closest_points, _principal_axes
from unbend.errors import InputError, UnbendWarning


def _cloud(n: int, d: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.exponential(size=(n, d)) * np.arange(d + 1, 1, -1)


def _orthogonal(d: int, seed: int, determinant: int) -> np.ndarray:
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(d, d)))[0]
    rotation[0] *= determinant * np.sign(np.linalg.det(rotation))
    return rotation


@given(d=st.integers(1, 6), seed=st.integers(0, 1000), determinant=st.sampled_from([1, -1]))
def test_procrustes_recovers_a_motion(d: int, seed: int, determinant: int) -> None:
    points = _cloud(40, d, seed)
    truth = _orthogonal(d, seed, determinant)
    rotation, translation = procrustes(points, points @ truth.T + 3)
    np.testing.assert_allclose(rotation, truth, atol=1e-9)
    np.testing.assert_allclose(translation, np.full(d, 3.0), atol=1e-8)


def test_procrustes_without_reflections_keeps_the_determinant() -> None:
    points = _cloud(40, 3)
    rotation, _ = procrustes(points, points * [-1, 1, 1], reflect=False)
    assert np.linalg.det(rotation) == pytest.approx(1)


@pytest.mark.parametrize("far", [100, 1e200, 1e305, np.inf, np.nan])
@pytest.mark.parametrize("sides", [[0], [1], [0, 1]])
def test_procrustes_ignores_pairs_of_no_weight(far: float, sides: list[int]) -> None:
    points, truth = _cloud(20, 3), _orthogonal(3, 0, 1)
    pairs = [points.copy(), points @ truth.T + 3]
    for side in sides:
        pairs[side][0] = far
    rotation, translation = procrustes(*pairs, weights=[0] + [1] * 19)
    np.testing.assert_allclose(rotation, truth, atol=1e-9)
    np.testing.assert_allclose(translation, 3, atol=1e-8)
    pairs[sides[0]][1] = np.nan
    with pytest.raises(InputError, match="point 1 is not finite"):
        procrustes(*pairs, weights=[0] + [1] * 19)


@pytest.mark.parametrize("d", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("determinant", [1, -1])
def test_align_recovers_a_motion_of_shuffled_points(d: int, determinant: int) -> None:
    points = _cloud(300, d)
    order = np.random.default_rng(1).permutation(300)
    truth = _orthogonal(d, 2, determinant)
    found = align(points, points[order] @ truth.T - 2)
    np.testing.assert_allclose(found.rotation, truth, atol=1e-9)
    assert found.residual < 1e-9
    assert (order[found.source_to_target] == np.arange(300)).all()
    assert (found.target_to_source == order).all()
    np.testing.assert_allclose(found.apply(points), points @ truth.T - 2, atol=1e-9)


def test_align_obeys_reflect() -> None:
    points = _cloud(200, 3)
    mirror = points * [-1, 1, 1]
    assert align(points, mirror).residual < 1e-9
    found = align(points, mirror, reflect=False)
    assert np.linalg.det(found.rotation) == pytest.approx(1)
    assert found.residual > 0.1


def test_align_different_numbers_of_points_and_history() -> None:
    rng = np.random.default_rng(0)
    angles = rng.uniform(0, 2 * np.pi, 500)
    curve = np.stack([3 * np.cos(angles), np.sin(angles) + 0.3 * np.cos(angles) ** 2], axis=1)
    found = align(curve[:200], curve[200:] @ _orthogonal(2, 0, 1).T + [5, 6])
    assert found.residual < 0.1
    assert found.residuals[-1] == found.residual <= found.residuals[0]
    assert found.source_to_target.shape == (200,)
    assert found.target_to_source.shape == (300,)


@pytest.mark.parametrize("reflect", [True, False])
def test_rounding_does_not_choose_between_motions_that_a_symmetry_makes_equal(reflect) -> None:
    half = _cloud(60, 3)
    points = np.concatenate([half * (1, i, j) for i in (1, -1) for j in (1, -1)])
    rotations = []
    for seed in range(5):
        noise = 1e-14 * np.random.default_rng(seed).standard_normal(points.shape)
        rotations.append(align(points, points @ _orthogonal(3, 1, 1).T + noise, reflect=reflect))
        np.testing.assert_allclose(rotations[-1].rotation, rotations[0].rotation, atol=1e-6)
    assert rotations[0].residual < 1e-9


def test_align_in_many_dimensions_limits_its_starts() -> None:
    points = _cloud(60, 12)
    assert align(points, points + 1, max_iterations=3).residual < 1e-9


@pytest.mark.parametrize(
    ("source", "target", "message"),
    [
        (np.zeros((3, 2)), np.zeros((3, 3)), "one dimension"),
        (np.zeros((0, 3)), np.zeros((3, 3)), "source points"),
        (np.zeros((3, 3)), np.full((3, 3), np.nan), "target point 0 is not finite"),
        (np.diag([1, 1, np.inf]), np.zeros((3, 3)), "source point 2 is not finite"),
        (np.diag([1, 1, 1e301]), np.eye(3), "source points have coordinates of 1e.301; give them"),
        (np.eye(3), np.diag([1, -1e305, 1]), "target points have coordinates of 1e.305; give them"),
        (np.eye(3) * 1e20, np.eye(3), "the source is .* times as large as the target"),
        (np.diag([1e200, 0, 0]), np.eye(3), "the source is .* times as large as the target"),
    ],
)
def test_align_says_what_is_wrong(source: np.ndarray, target: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        align(source, target)


def test_procrustes_says_what_is_wrong() -> None:
    with pytest.raises(InputError, match="one shape"):
        procrustes(np.zeros((3, 2)), np.zeros((4, 2)))
    for weights in ([1, -1, 1], [0, 0, 0], [1, np.inf, 1], [1, np.nan, 1], [1, 1]):
        with pytest.raises(InputError, match="weights must be 3 finite non-negative numbers"):
            procrustes(np.eye(3), np.eye(3), weights=weights)


@pytest.mark.parametrize("d", [2, 3, 5])
def test_the_nearest_rotation_has_the_largest_trace(d: int) -> None:
    chance = np.random.default_rng(d)
    matrices = chance.normal(size=(6, d, d))
    rotations = nearest_rotation(matrices)
    np.testing.assert_allclose(np.linalg.det(rotations), 1)
    turned = np.linalg.qr(chance.normal(size=(200, d, d)))[0]
    turned[..., 0] *= np.linalg.det(turned)[:, None]
    for matrix, rotation in zip(matrices, rotations, strict=True):
        assert (rotation * matrix).sum() >= (turned * matrix).sum(axis=(1, 2)).max()
    for other in (turned[:6], -turned[:6]):  # what is orthogonal stays as it is
        np.testing.assert_allclose(nearest_rotation(other, reflect=True), other, atol=1e-12)


@pytest.mark.parametrize("unit", [1e-160, 1e-70, 1e70, 1e200])
def test_units_do_not_matter(unit: float) -> None:
    """Squares of the coordinates, or single precision, would not hold them."""
    points = _cloud(60, 3)
    turned = points @ _orthogonal(3, 1, 1).T
    rotation, _ = procrustes(points * unit, turned * unit)
    np.testing.assert_allclose(rotation, _orthogonal(3, 1, 1), atol=1e-9)
    found = align(points * unit, turned * unit)
    np.testing.assert_allclose(found.rotation, _orthogonal(3, 1, 1), atol=1e-9)
    assert found.residual < 1e-12 * unit


@pytest.mark.parametrize("limit", [1, 3])
def test_a_search_that_is_ended_early_says_so(limit: int) -> None:
    left, right = (np.random.default_rng(seed).normal(size=(300, 3)) for seed in (0, 1))
    with pytest.warns(UnbendWarning, match=f"in the last of {limit} iterations; allow more"):
        align(left, right, max_iterations=limit)


def test_points_in_one_place_are_brought_there_at_once() -> None:
    for source, target in (([[1, 2, 3]], [[4, 5, 6]]), (np.ones((4, 3)), np.zeros((3, 3)))):
        found = align(source, target, max_iterations=1)
        np.testing.assert_array_equal(
            found.apply(source), np.broadcast_to(target[0], (len(source), 3))
        )
        assert found.residual == 0


def _whole_numbers() -> np.ndarray:
    """64 points whose sums and mean are exact; their middle, 0, is one of them."""
    rows = np.random.default_rng(0).integers(-999, 1000, size=(62, 3))
    return np.vstack([rows, -rows.sum(axis=0), np.zeros(3)]).astype(float)


QUARTER = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


def test_far_from_the_origin_nothing_is_lost() -> None:
    points = _whole_numbers()
    for far in (0, 2.0**46):
        rotation, translation = procrustes(points + far, points @ QUARTER.T - far)
        np.testing.assert_allclose(rotation, QUARTER, atol=1e-12)
        middle = rotation @ np.full(3, far) + translation
        np.testing.assert_allclose(middle, -far, atol=1e-12 * far + 1e-9)


@pytest.mark.parametrize("exponent", [-600, 600])
def test_units_do_not_matter_where_a_point_is_the_middle(exponent: int) -> None:
    points = _whole_numbers() * 2.0**exponent
    np.testing.assert_allclose(procrustes(points, points @ QUARTER.T)[0], QUARTER, atol=1e-12)
    found = align(points, points @ QUARTER.T)
    np.testing.assert_allclose(found.rotation, QUARTER, atol=1e-9)
    assert found.residual < 1e-9 * 2.0**exponent


def test_the_residual_counts_both_directions_alike() -> None:
    source, target = _cloud(30, 3), _cloud(80, 3, 1)
    ways = np.linalg.norm(source[:, None] - target, axis=2)
    forward, backward, residual = _closest_points(source, target)
    np.testing.assert_array_equal(forward, ways.argmin(axis=1))
    np.testing.assert_array_equal(backward, ways.argmin(axis=0))
    squared = (ways.min(axis=1) ** 2).mean() / 2 + (ways.min(axis=0) ** 2).mean() / 2
    assert residual == pytest.approx(np.sqrt(squared))


@pytest.mark.parametrize("limit", [0, 1, 3])
def test_no_more_iterations_than_allowed(limit: int) -> None:
    found = align(_cloud(60, 3), _cloud(70, 3, 1), max_iterations=limit, tolerance=0)
    assert len(found.residuals) <= limit + 1
    assert found.residual == found.residuals[-1]
    assert (np.diff(found.residuals) <= 0).all()


@pytest.mark.parametrize(
    "options",
    [
        {"max_iterations": -1},
        {"max_iterations": 1.5},
        {"tolerance": np.nan},
        {"tolerance": 1},
        {"tolerance": 1.5},
    ],
)
def test_options_out_of_range(options: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r"a whole number of at least 0|at least 0 and below 1"):
        align(_cloud(60, 3), _cloud(70, 3, 1), **options)


def test_principal_axes_are_orthonormal_and_follow_the_points() -> None:
    for seed in range(8):
        points = _cloud(50, 3, seed)
        axes = _principal_axes(points)
        np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
        turn = _orthogonal(3, seed, -1)
        np.testing.assert_allclose(_principal_axes(points @ turn.T), turn @ axes, atol=1e-9)


def test_principal_axes_are_the_longest_first_and_point_to_the_heavier_side() -> None:
    for seed in range(20):
        points = np.random.default_rng(seed).normal(size=(50, 3)) * [1, 3, 2]
        points -= points.mean(axis=0)
        along = points @ _principal_axes(points)
        assert (np.diff((along**2).sum(axis=0)) < 0).all()
        assert ((along**3).sum(axis=0) > 0).all()


@pytest.mark.parametrize("d", [2, 3, 9])
def test_each_choice_of_signs_is_a_motion_of_its_own(d: int) -> None:
    source, target = _cloud(50, d), _cloud(60, d, 1)
    both, turns = (np.array(_axis_choices(source, target, reflect)) for reflect in (True, False))
    for choices, count in ((both, 2 ** min(d, 8)), (turns, 2 ** (min(d, 8) - 1))):
        assert choices.shape == (count, d, d)
        products = choices @ choices.transpose(0, 2, 1)
        np.testing.assert_allclose(products, np.broadcast_to(np.eye(d), products.shape), atol=1e-9)
        assert len(np.unique(choices.reshape(count, -1).round(6), axis=0)) == count
    np.testing.assert_allclose(np.linalg.det(turns), 1)


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_what_is_sampled_more_densely_elsewhere_is_aligned(seed: int) -> None:
    """The denser side decides where axes point to, and so which choice of signs is right."""
    points = np.random.default_rng(seed).normal(size=(60, 3)) * [4, 2, 1]
    truth = _orthogonal(3, 2, -1)
    for heights in points.T:
        upper = heights > np.median(heights)
        source = np.vstack([points, points[upper], points[upper]])
        target = np.vstack([points, points[~upper], points[~upper]])
        found = align(source, target @ truth.T)
        assert found.residual < 1e-9
        np.testing.assert_allclose(found.rotation, truth, atol=1e-9)


def test_what_is_found_is_said_in_units_of_the_points() -> None:
    source, target = 1000 * _cloud(60, 3), 1000 * _cloud(70, 3, 1) + 5000
    found = align(source, target)
    forward, backward, residual = _closest_points(found.apply(source), target)
    np.testing.assert_array_equal(found.source_to_target, forward)
    np.testing.assert_array_equal(found.target_to_source, backward)
    assert found.residual == pytest.approx(residual, rel=1e-9)


@pytest.mark.parametrize("tolerance", [0.0, 1e-3, 0.05])
def test_iterations_go_on_while_the_residual_falls_by_the_share_asked_for(tolerance) -> None:
    source, target = _cloud(60, 3), _cloud(70, 3, 1)
    starts = [np.eye(3), _orthogonal(3, 0, 1), _orthogonal(3, 1, -1)]
    for residuals in (
        align(source, target, tolerance=tolerance).residuals,
        *(icp(source, target, start, tolerance=tolerance)[2] for start in starts),
    ):
        falls = 1 - residuals[1:] / residuals[:-1]
        assert (falls[:-1] > tolerance).all()
        assert falls[-1] <= tolerance + 1e-12
        assert len(falls) < 100


def test_at_the_end_both_directions_pull_alike() -> None:
    """The derivative of the residual by the translation: the mean pull of either side, summed."""
    source, target = _cloud(30, 3), _cloud(80, 3, 1)
    rotation, translation, residuals = icp(source, target, np.eye(3), tolerance=0.0)
    moved = source @ rotation.T + translation
    forward, backward, residual = _closest_points(moved, target)
    pull = (target[forward] - moved).mean(axis=0) + (target - moved[backward]).mean(axis=0)
    np.testing.assert_allclose(pull, 0, atol=1e-9)
    assert residual == pytest.approx(residuals[-1])


def test__closest_points_reflect_unless_they_must_not() -> None:
    points = _cloud(40, 3) * [0.01, 1, 1]  # so thin that the mirrored are nearest to their own
    mirrored = points * [-1, 1, 1]
    rotation, _, residuals = icp(points, mirrored, np.eye(3))
    np.testing.assert_allclose(rotation, np.diag([-1, 1, 1]), atol=1e-9)
    assert residuals[-1] < 1e-9
    rotation, _, residuals = icp(points, mirrored, np.eye(3), reflect=False)
    assert np.linalg.det(rotation) == pytest.approx(1)
    assert residuals[-1] > 1e-3
