"""Maps between eigenbases: truths of orthogonal matrices."""

import numpy as np
import pytest
from scipy.linalg import orthogonal_procrustes

from unbend.alignment import Pairs
from unbend.matching._zoomout import grow, orthogonal_maps, spectral_weights


def test_weights_are_of_unit_size_and_of_neither_shape_first() -> None:
    rng = np.random.default_rng(0)
    source, target = np.sort(rng.random((2, 12)) + 0.1)
    weights = spectral_weights(source, target, 8)
    assert (weights**2).sum() == pytest.approx(1)
    np.testing.assert_allclose(weights, spectral_weights(target, source, 8))
    same = spectral_weights(source, source, 8)
    np.testing.assert_allclose(same / same[0], np.sqrt(source[0] / source[:8]))


@pytest.mark.parametrize("determinant", [1, -1])
def test_the_map_behind_pairs_is_found(determinant: int) -> None:
    rng = np.random.default_rng(0)
    source = rng.normal(size=(40, 5))
    truth = np.linalg.qr(rng.normal(size=(5, 5)))[0]
    truth[0] *= determinant * np.sign(np.linalg.det(truth))
    order = rng.permutation(40)
    target = (source @ truth)[order]
    pairs = Pairs(np.argsort(order)[None], order[None], np.zeros(1))
    chance = Pairs(*rng.integers(40, size=(2, 1, 40)), np.zeros(1))
    both = Pairs(*(np.concatenate(one) for one in zip(pairs, chance, strict=True)))
    maps = orthogonal_maps(source, target, both)
    np.testing.assert_allclose(maps[0], truth, atol=1e-9)
    np.testing.assert_allclose(maps[1] @ maps[1].T, np.eye(5), atol=1e-9)


def test_pairs_of_both_directions_count_alike() -> None:
    rng = np.random.default_rng(0)
    source, target = rng.normal(size=(30, 4)), rng.normal(size=(40, 4))
    pairs = Pairs(rng.integers(40, size=(1, 30)), rng.integers(30, size=(1, 40)), np.zeros(1))
    rows = np.concatenate([source, source[pairs.backward[0]]])
    images = np.concatenate([target[pairs.forward[0]], target])
    expected = orthogonal_procrustes(rows, images)[0]
    np.testing.assert_allclose(orthogonal_maps(source, target, pairs)[0], expected, atol=1e-9)


def test_a_map_grows_from_its_beginning() -> None:
    rng = np.random.default_rng(0)
    values = np.linspace(1, 3, 6)
    source = np.linalg.qr(rng.normal(size=(60, 6)))[0]
    signs = rng.choice([-1.0, 1.0], 6)
    target = (source * signs)[rng.permutation(60)]
    found = grow((values, source), (values, target), np.diag(signs[:3]), [3, 4, 6])
    np.testing.assert_allclose(found, np.diag(signs), atol=1e-9)
    np.testing.assert_array_equal(
        grow((values, source), (values, target), np.diag(signs), []), np.diag(signs)
    )
