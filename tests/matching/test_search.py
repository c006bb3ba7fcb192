"""Hypotheses: the map that is known is among those found, whatever signs and order come in."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import orthogonal_procrustes

from unbend import Mesh
from unbend.alignment import Pairs
from unbend.datasets import make_quadruped, make_sphere
from unbend.matching import _constants as constants
from unbend.matching._inputs import prepare_shape
from unbend.matching._search import (
    _distinct,
    _extended,
    orthogonal_maps,
    search,
    spectral_weights,
)
from unbend.matching._shape import Shape

pytestmark = pytest.mark.usefixtures("as_meshed")

K = constants.FUNCTIONS[1]


@pytest.fixture(scope="module")
def shape(blob: Mesh) -> Shape:
    return prepare_shape(blob, 40)[1]


def test_a_generic_shape_is_found_to_be_itself_first(shape: Shape) -> None:
    maps = search(shape, shape)
    assert maps.shape[1:] == (K, K)
    np.testing.assert_allclose(maps @ maps.transpose(0, 2, 1), [np.eye(K)] * len(maps), atol=1e-9)
    np.testing.assert_allclose(maps[0], np.eye(K), atol=1e-6)


def test_signs_of_eigenfunctions_are_found_out(shape: Shape) -> None:
    signs = np.where(np.random.default_rng(0).random(shape.k) < 0.5, -1.0, 1.0)
    reversed_ = replace(shape, basis=shape.basis * signs)
    found = search(shape, reversed_)[0]
    np.testing.assert_allclose(found, np.diag(signs[:K]), atol=1e-6)


def test_the_order_of_vertices_does_not_matter(shape: Shape) -> None:
    order = np.random.default_rng(1).permutation(len(shape.vertices))
    number = np.argsort(order)
    shuffled = Shape(
        shape.vertices[order],
        number[shape.faces],
        shape.areas[order],
        shape.eigenvalues,
        shape.basis[order],
    )
    np.testing.assert_allclose(search(shape, shuffled)[0], np.eye(K), atol=1e-6)


def test_a_symmetric_shape_is_itself_and_its_mirror_image() -> None:
    dog = make_quadruped("standing", n_vertices=600)
    shape = prepare_shape(dog.mesh, 40)[1]
    maps = search(shape, shape)
    mirror = shape.basis[:, :K].T @ (shape.areas[:, None] * shape.basis[dog.mirror, :K])
    for expected in (np.eye(K), mirror):
        apart = np.linalg.norm(maps - expected, axis=(1, 2)) / np.sqrt(K)
        assert apart.min() < 0.1


def test_few_functions_give_maps_of_few(shape: Shape) -> None:
    few = replace(shape, basis=shape.basis[:, :7], eigenvalues=shape.eigenvalues[:7])
    maps = search(few, few)
    assert maps.shape == (2 * constants.BEAM, 7, 7)
    np.testing.assert_allclose(maps[0], np.eye(7), atol=1e-6)
    for sides in ((few, shape), (shape, few)):
        maps = search(*sides)
        assert maps.shape == (2 * constants.BEAM, 7, 7)
        np.testing.assert_allclose(maps[0], np.eye(7), atol=1e-6)


def test_two_meshes_of_one_surface_have_nearly_the_same_functions(shape: Shape, blob: Mesh) -> None:
    few = make_sphere(2).faces  # whose vertices are the first of a finer sphere
    coarse = prepare_shape(Mesh(blob.vertices[:162], few), 40)[1]
    low = slice(0, 6)
    for source, target in ((shape, coarse), (coarse, shape)):
        found = search(source, target)[0][low, low]
        np.testing.assert_allclose(abs(found), np.eye(6), atol=0.3)
        np.testing.assert_allclose(abs(found).diagonal(), 1, atol=0.1)


def test_maps_that_hardly_differ_count_once() -> None:
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    angle = 0.05
    near = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    maps = np.array([near, turn, np.eye(2), -np.eye(2)])
    assert _distinct(maps, np.array([2, 0, 1, 3]), 4) == [2, 1, 3]
    assert _distinct(maps, np.array([0, 1, 2, 3]), 2) == [0, 1]
    # Matrices of k columns, a turn by some angle: less than 0.15 of sqrt(k) apart, and more.
    for size in (2, 4):
        for angle, count in ((0.1, 1), (0.4, 2)):
            c, s = np.cos(angle), np.sin(angle)
            turned = np.kron(np.eye(size // 2), [[c, -s], [s, c]])
            pair = np.array([np.eye(size), turned])
            assert len(_distinct(pair, np.arange(2), 2)) == count


def test_single_precision_does_not_choose_the_order_of_equal_maps() -> None:
    ball = make_sphere(2)  # all of its vertices are samples
    box = Mesh(ball.vertices * [1.6, 1.0, 0.7], ball.faces)  # itself under three half turns
    shape = prepare_shape(box, 40)[1]
    maps = search(shape, shape)[:4]
    np.testing.assert_allclose(abs(maps), [np.eye(K)] * 4, atol=1e-3)
    for seed in range(3):
        noise = 1e-7 * np.random.default_rng(seed).standard_normal(shape.basis.shape)
        again = search(shape, replace(shape, basis=shape.basis + noise))[:4]
        np.testing.assert_allclose(again, maps, atol=1e-3)


def test_maps_go_on_with_every_choice_of_signs() -> None:
    maps = np.array([np.linalg.qr(np.random.default_rng(i).normal(size=(2, 2)))[0] for i in (0, 1)])
    found = _extended(maps, 4)
    assert found.shape == (8, 4, 4)
    np.testing.assert_allclose(
        found @ found.transpose(0, 2, 1), np.broadcast_to(np.eye(4), (8, 4, 4)), atol=1e-12
    )
    np.testing.assert_array_equal(found[:, :2, :2], np.repeat(maps, 4, axis=0))
    assert {tuple(one.diagonal()[2:]) for one in found} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}


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
