"""Statistics of shapes: known means and factors come back, however the shapes lie."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dense import relative_error
from unbend import Mesh
from unbend.collection import _statistics, shape_statistics
from unbend.datasets import make_sphere
from unbend.errors import InputError, UnbendWarning


@pytest.fixture(scope="module")
def grown(blob: Mesh):
    """A blob that grows in two independent ways, and how much each of 12 did."""
    chance = np.random.default_rng(0)
    base = blob.vertices - blob.vertices.mean(axis=0)
    ways = np.stack([base * [0, 0, 0.2], base * [0, 0.1, 0] * (base[:, :1] > 0)])
    amounts = np.linalg.qr(np.column_stack([np.ones(12), chance.normal(size=(12, 2))]))[0][:, 1:]
    amounts *= np.sqrt(11)  # mean 0, standard deviation 1, uncorrelated
    return base, ways, amounts, base + np.einsum("sk,kvd->svd", amounts, ways)


def scattered(shapes, sizes=None):
    chance = np.random.default_rng(1)
    turns = Rotation.random(len(shapes), rng=chance).as_matrix()
    sizes = np.ones(len(shapes)) if sizes is None else sizes
    return [
        s * x @ r.T + chance.normal(size=3) for x, r, s in zip(shapes, turns, sizes, strict=True)
    ]


def correlation(one, other):
    return abs(np.corrcoef(one, other)[0, 1])


def test_known_factors_come_back(grown):
    base, ways, amounts, shapes = grown
    found = shape_statistics(scattered(shapes))
    assert correlation(found.scores[:, 0], amounts[:, 0]) > 0.99
    assert correlation(found.scores[:, 1], amounts[:, 1]) > 0.99
    # Fitting turns the shapes a little, so the variances are the ways' but for that.
    expected = (ways**2).sum(axis=2).mean(axis=1)
    np.testing.assert_allclose(found.variances[:2], expected, rtol=0.05)
    assert found.variances[:2].sum() > 0.99 * found.total_variance
    apart = np.linalg.norm(Rotation.align_vectors(found.mean, base)[0].apply(base) - found.mean)
    assert apart < 0.02 * np.linalg.norm(base)


def test_components_are_what_shapes_are_made_of(grown):
    found = shape_statistics(scattered(grown[3]))
    assert found.components.shape[0] == found.scores.shape[1] <= 11
    np.testing.assert_allclose(found.scores.mean(axis=0), 0, atol=1e-6)
    np.testing.assert_allclose(
        found.scores.T @ found.scores / 11, np.eye(len(found.variances)), atol=1e-6
    )
    squares = (found.components**2).sum(axis=2).mean(axis=1)
    np.testing.assert_allclose(squares, found.variances, atol=1e-15)
    total = (found.variability**2).mean()
    assert total == pytest.approx(found.total_variance)
    np.testing.assert_allclose(found.at(1, -3), found.mean - 3 * found.components[1])
    np.testing.assert_array_equal(found.at(0, 0), found.mean)
    outward = np.einsum("kvd,vd->k", found.components, found.mean)
    assert (outward > -1e-9).all()


def test_where_shapes_lie_does_not_matter(grown):
    plain = shape_statistics(grown[3])
    moved = shape_statistics(scattered(grown[3]))
    np.testing.assert_allclose(moved.variances, plain.variances, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(moved.scores[:, :2], plain.scores[:, :2], atol=1e-5)
    small = shape_statistics(grown[3] / 1024)
    np.testing.assert_allclose(small.variances, plain.variances / 1024**2, rtol=1e-9)


def test_sizes_are_taken_out_where_asked_for(grown):
    sizes = np.linspace(1, 3, 12)
    with_sizes = shape_statistics(scattered(grown[3], sizes))
    without = shape_statistics(scattered(grown[3], sizes), scale=True)
    assert correlation(with_sizes.scores[:, 0], sizes) > 0.98
    assert correlation(without.scores[:, 0], grown[2][:, 0]) > 0.98
    assert correlation(with_sizes.sizes, sizes) > 0.98


def test_points_count_by_their_weights(grown):
    shapes = np.array(grown[3])
    twice = np.concatenate([shapes, shapes[:, :100]], axis=1)
    weights = np.ones(shapes.shape[1])
    weights[:100] = 2
    np.testing.assert_allclose(
        shape_statistics(twice).variances,
        shape_statistics(shapes, weights=weights).variances,
        atol=1e-12,
    )


@pytest.mark.parametrize("far", [7.0, 1e200, np.inf, np.nan])
def test_points_of_no_weight_do_not_count(grown, far):
    shapes = np.array(grown[3])
    weights = np.append(np.ones(shapes.shape[1]), 0)
    outlier = np.broadcast_to([far, 0, far], (len(shapes), 1, 3))
    found = shape_statistics(np.concatenate([shapes, outlier], axis=1), weights=weights)
    plain = shape_statistics(shapes)
    for name in ("mean", "variability", "variances", "scores", "sizes"):
        one, other = getattr(found, name), getattr(plain, name)
        np.testing.assert_allclose(one[: len(other)], other, rtol=1e-9, atol=1e-12)
    assert np.isfinite(found.mean[-1]).all() == (far == 7)


def test_the_mean_is_that_of_shapes_scaled_to_the_mean_size():
    """Balls of one size, stretched: the sizes and the mean have a closed form."""
    ball = make_sphere(2).vertices
    stretched = [ball, ball * [1, 1, 5], ball * [5, 1, 1]]
    found = shape_statistics(stretched, scale=True)
    np.testing.assert_allclose(found.sizes, [1, 3, 3], rtol=1e-12)
    # All have the size 7/3 then, and are averaged.
    expected = ball * [3 + 1 + 5, 3 + 1 + 1, 3 + 5 + 1] * 7 / 27
    assert relative_error(found.mean, expected) < 1e-9
    size = np.sqrt((found.mean**2).sum(axis=1).mean())
    assert size == pytest.approx(7 / 27 * np.sqrt((81 + 25 + 81) / 3))
    assert size < 7 / 3


def test_variability_is_the_standard_deviation_of_a_sample():
    """Two boxes, 2 and 4 long: each corner is 1 from its mean, along one axis."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1.0)])
    found = shape_statistics([corners, corners * [1, 1, 2]])
    np.testing.assert_allclose(found.variability, np.sqrt(0.5**2 + 0.5**2))


def test_equal_shapes_do_not_vary(blob):
    found = shape_statistics(scattered([blob.vertices] * 3))
    assert found.variances.shape == (0,)
    assert found.scores.shape == (3, 0)
    assert found.variability.max() < 1e-9


@pytest.mark.parametrize(
    ("shapes", "options", "message"),
    [
        (np.zeros((3, 4)), {}, r"not \(3, 4\)"),
        (np.full((2, 4, 3), np.nan), {}, "shape 0: point 0 is not finite"),
        (np.zeros((1, 4, 3)), {}, "at least 2"),
        (np.zeros((2, 4, 3)), {}, "single point"),
        (np.ones((2, 4, 3)), {"n_components": 0}, "n_components"),
        (np.ones((2, 4, 3)), {"weights": [1, 1]}, "weights must be 4"),
        (np.ones((2, 4, 3)), {"weights": [1, 1, 1, np.inf]}, "weights must be 4 finite"),
    ],
)
def test_what_is_no_set_of_shapes_is_refused(shapes, options, message):
    with pytest.raises(InputError, match=message):
        shape_statistics(shapes, **options)


def test_a_component_that_is_not_there_is_refused(grown):
    with pytest.raises(InputError, match="no component 99"):
        shape_statistics(grown[3]).at(99, 1)


def test_shapes_that_settle_on_no_mean_are_warned_of(grown, monkeypatch):
    monkeypatch.setattr(_statistics, "_ROUNDS", 1)
    with pytest.warns(UnbendWarning, match="still moves by .* of its size after 1 rounds"):
        shape_statistics(grown[3])


@pytest.mark.parametrize("unit", [1e-160, 1e200])
def test_sizes_beyond_double_precision_are_refused(grown, unit):
    with pytest.raises(InputError, match=r"a single point|has a size of|be finite"):
        shape_statistics(grown[3] * unit)
