"""The matcher on plain arrays: what is chosen where a symmetry leaves the choice free."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from unbend import Mesh
from unbend.datasets import keep, make_biped, make_sphere, rest_map
from unbend.matching import _solve
from unbend.matching._inputs import prepare_shape
from unbend.matching._judge import Candidate
from unbend.matching._proxy import make_proxy
from unbend.matching._registration import mapped_start
from unbend.matching._shape import Shape
from unbend.matching._solve import (
    Levels,
    Sides,
    candidates,
    distinct_on,
    follow_all,
    functional_map,
    is_clear,
    make_sides,
)
from unbend.matching._tips import find_tips


@pytest.fixture(scope="module")
def boxes() -> list[Shape]:
    """A rounded box, which half turns and mirrors leave the same, and as others would round it."""
    ball = make_sphere(3)
    box = ball.vertices * [1.6, 1.0, 0.7]
    found = []
    for seed in range(4):
        noise = 1e-15 * np.random.default_rng(seed).standard_normal(box.shape)
        found.append(prepare_shape(Mesh(box + noise, ball.faces), 40, False)[1])
    return found


def test_rounding_does_not_choose_what_is_looked_at(boxes: list[Shape]) -> None:
    first, *others = boxes
    coarse = make_proxy(first, 200)
    for shape in others:
        np.testing.assert_array_equal(shape.samples, first.samples)
        np.testing.assert_array_equal(find_tips(shape).vertices, find_tips(first).vertices)
        np.testing.assert_array_equal(make_proxy(shape, 200).kept, coarse.kept)


def test_rounding_does_not_choose_among_maps_that_a_symmetry_makes_equal(
    boxes: list[Shape],
) -> None:
    every = np.arange(len(boxes[0].vertices))
    for shape in boxes[::3]:
        sides = make_sides(shape, shape)
        found = candidates(sides)
        assert max(one.energy for one in found[:4]) < 1e-6  # itself and three half turns
        np.testing.assert_array_equal(found[0].registered.forward, every)


def test_the_mirror_image_of_the_target_gives_the_mirrored_maps(boxes: list[Shape]) -> None:
    sides = make_sides(boxes[0], boxes[0])
    turned = candidates(sides.reflected())
    for one in turned[:4]:
        assert one.reflected
        assert one.energy < 1e-6
        assert one.orientation > 0.99  # of the mirror image, so the map turns inside out
        images = boxes[0].vertices[one.registered.forward]
        signs = np.sign((images * boxes[0].vertices).sum(axis=0))
        np.testing.assert_allclose(images, boxes[0].vertices * signs, atol=1e-9)
        assert signs.prod() == -1


def test_what_is_clear_is_what_a_thorough_search_finds(boxes: list[Shape], monkeypatch) -> None:
    one, other = (
        prepare_shape(make_biped(pose, n_vertices=800, meshing=i).mesh, 100, True)[1]
        for i, pose in enumerate(("standing", "walking"))
    )
    sides = make_sides(one, other)
    tried = []
    from_tips = _solve.from_tips
    monkeypatch.setattr(
        _solve, "from_tips", lambda sides, *sizes: tried.append(sizes) or from_tips(sides, *sizes)
    )
    quick = candidates(sides)
    assert tried == [_solve._FEW]
    thorough = candidates(sides, thorough=True)
    assert tried == [_solve._FEW, _solve._MANY]
    assert len(quick) < len(thorough)
    assert len(distinct_on(sides, sides.proxies, [quick[0], thorough[0]])) == 1
    # Where several are equally good nothing is clear.
    candidates(make_sides(boxes[0], boxes[0]))
    assert tried[-1] == _solve._MANY


def one_of(cost: float, orientation: float = 1.0) -> Candidate:
    return Candidate(None, cost, orientation, False, np.zeros(0, dtype=bool), 1.0)


@pytest.mark.parametrize(
    ("costs", "clear"),
    [([0.1], True), ([0.3], False), ([0.1, 0.13], False), ([0.1, 0.15], True), ([0.1, 0.3], True)],
)
def test_clear_is_what_is_good_and_far_ahead(costs: list[float], clear: bool) -> None:
    ways = [one_of(cost, orientation) for cost, orientation in zip(costs, (1, -1), strict=False)]
    assert is_clear(ways) == clear
    assert not is_clear([one_of(0.1, -0.5)])  # inside out


def test_the_mirror_image_of_the_target_is_taken_at_every_level(boxes: list[Shape]) -> None:
    sides = make_sides(boxes[0], boxes[0])
    turned = sides.reflected()
    assert turned.turned
    assert not turned.reflected().turned
    assert turned.source is sides.source
    before, after = sides.target, turned.target
    shapes = [(before.shape, after.shape)]
    for one, other in zip(before[1:], after[1:], strict=True):
        np.testing.assert_array_equal(other.kept, one.kept)
        shapes.append((one.shape, other.shape))
    assert [len(one.areas) for one, _ in shapes] == [642, 642, 400]
    for one, other in shapes:
        np.testing.assert_array_equal(other.vertices, one.vertices * [-1, 1, 1])


def test_a_functional_map_has_no_more_functions_than_the_shapes(boxes: list[Shape]) -> None:
    few = replace(boxes[0], eigenvalues=boxes[0].eigenvalues[:12], basis=boxes[0].basis[:, :12])
    sides = make_sides(boxes[0], few)
    every = np.arange(642)
    same = replace(one_of(0.0), registered=mapped_start(boxes[0], few, every, every, 1.0))
    for asked, size in ((6, 6), (120, 12)):
        found = functional_map(sides, same, asked)
        np.testing.assert_allclose(found, np.eye(size), atol=1e-9)


def test_nobody_is_followed_twice(boxes: list[Shape], monkeypatch: pytest.MonkeyPatch) -> None:
    sides = make_sides(boxes[0], boxes[0])
    every = np.arange(400)
    turned = cKDTree(sides.rough[0].vertices).query(sides.rough[0].vertices * [-1, -1, 1])[1]
    one, other = (
        replace(one_of(0.1), registered=mapped_start(*sides.rough, way, way, 1.0))
        for way in (every, turned)
    )
    found = follow_all(sides, [one], [one, other])
    assert len(found) == 2
    for sign in (1, -1):
        signed = boxes[0].vertices * [sign, sign, 1]
        off = [np.abs(boxes[0].vertices[way.registered.forward] - signed).max() for way in found]
        assert min(off) < 1e-6


@pytest.mark.parametrize("of_tips", [False, True])
def test_among_guesses_is_the_truth(monkeypatch: pytest.MonkeyPatch, of_tips: bool) -> None:
    """Of tips, where one arm is missing, and of points all over an upper half."""
    source = make_biped("standing", n_vertices=800)
    target = make_biped("walking", n_vertices=700, meshing=1)
    height, arm = source.mesh.vertices[:, 1], source.parts.index("left_arm")
    wanted = source.labels != arm if of_tips else height > np.quantile(height, 0.4)
    part = keep(source.mesh, wanted)
    sides = make_sides(
        prepare_shape(part.mesh, 40, True, True).shape, prepare_shape(target.mesh, 40, True).shape
    )
    monkeypatch.setattr(_solve, "from_guesses", lambda sides, guesses, maps, n: maps)
    maps = _solve.from_tips(sides, 60, 12) if of_tips else _solve.from_points(sides)
    ours, theirs = sides.source.rough, sides.target.rough
    truth = rest_map(source, target)[part.origin][sides.source.proxy.kept[ours.kept]]
    right = sides.target.shape.vertices[truth]
    off = [np.linalg.norm(theirs.shape.vertices[one] - right, axis=1).mean() for one, _ in maps]
    assert min(off) < 0.1


def test_a_pair_is_partial_if_either_shape_is(boxes: list[Shape]) -> None:
    whole, part = (
        Levels(replace(boxes[0], partial=one), None, None)  # type: ignore[arg-type]
        for one in (False, True)
    )
    assert not Sides(whole, whole).partial
    assert Sides(whole, part).partial
    assert Sides(part, whole).partial


def test_what_leads_to_the_same_place_is_left_out_whatever_the_vertices(
    boxes: list[Shape],
) -> None:
    ball = make_sphere(2)
    ours = prepare_shape(Mesh(ball.vertices * [1.6, 1.0, 0.7], ball.faces), 20, True).shape
    sides = make_sides(ours, boxes[0])
    for shapes in (sides.proxies, sides.rough):
        mine, other = shapes
        trees = cKDTree(other.vertices), cKDTree(mine.vertices)
        ways = []
        for signs in ([1, 1, 1], [1, 1, 1], [-1, -1, 1]):
            there, back = (
                tree.query(one.vertices * signs)[1] for tree, one in zip(trees, shapes, strict=True)
            )
            start = mapped_start(mine, other, there, back, 1.0)
            ways.append(replace(one_of(0.1), registered=start))
        assert distinct_on(sides, shapes, ways) == ways[::2]


def test_functions_of_shuffled_vertices_are_the_same(boxes: list[Shape]) -> None:
    shape, order = boxes[0], np.random.default_rng(0).permutation(642)
    shuffled = replace(shape, areas=shape.areas[order], basis=shape.basis[order])
    sides = SimpleNamespace(proxies=(shape, shuffled))
    way = replace(one_of(0.0), registered=(np.argsort(order), order))
    np.testing.assert_allclose(functional_map(sides, way, 20), np.eye(20), atol=1e-9)
