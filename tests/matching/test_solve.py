"""The matcher on plain arrays: what is chosen where a symmetry leaves the choice free."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from unbend import Mesh
from unbend.datasets import keep, make_biped, make_sphere, rest_map
from unbend.matching import _solve
from unbend.matching._inputs import prepare_shape
from unbend.matching._judge import Candidate, distinct, ranked
from unbend.matching._polish import with_partners
from unbend.matching._proxy import make_proxy
from unbend.matching._registration import mapped_start
from unbend.matching._shape import Shape
from unbend.matching._solve import (
    candidates,
    follow_all,
    functional_map,
    is_clear,
    make_sides,
    mended,
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
    ways = [quick[0], thorough[0]]
    assert len(distinct(ways, sides.target.proxy.shape, sides.source.proxy.shape.areas)) == 1
    # Where several are equally good nothing is clear.
    candidates(make_sides(boxes[0], boxes[0]))
    assert tried[-1] == _solve._MANY


def test_a_vertex_has_a_partner_where_most_around_it_have(boxes: list[Shape]) -> None:
    sides = make_sides(boxes[0], boxes[0])
    best = candidates(sides)[0]
    right = boxes[0].vertices[:, 0] > 0.1
    astray = np.abs(boxes[0].vertices[:, 0]) > 0.9 * boxes[0].vertices[:, 0].max()
    few = np.flatnonzero(astray)[[0, -1]]  # one at either end
    ragged = right.copy()
    ragged[few] = ~ragged[few]
    ours = best.registered.source._replace(within=ragged)
    found = replace(best, registered=best.registered._replace(source=ours))
    smooth = with_partners(found, sides, 0.0).registered
    assert (smooth.source.within == right)[few].all()
    assert (smooth.source.within == right).mean() > 0.95
    assert smooth.target.within.all()
    assert with_partners(found, sides, 0.7).registered.source.within.all()


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


@pytest.mark.parametrize("partial", [False, True])
@pytest.mark.parametrize("clear", [False, True])
def test_whatever_finds_the_best_it_comes_first(
    monkeypatch: pytest.MonkeyPatch, partial: bool, clear: bool
) -> None:
    """No stage of the search is in vain, and what is clear is gone on with alone."""
    shape = SimpleNamespace(shape=None)
    sides = SimpleNamespace(partial=partial, source=shape, target=shape, rough=None, proxies=None)
    begun, followed = (
        [one_of(cost) for cost in (0.1 if clear else 0.3, *range(1, 9))] for _ in range(2)
    )
    own, calls, answers = one_of(0.05), [], []

    def stage(name: str) -> Callable:
        def run(sides: object, given: list[Candidate], pulls: object = None) -> list[Candidate]:
            calls.append(name)
            if name != "mended":
                assert len(given) == len(set(given))
                assert len(given) == 1 if clear else 4 <= len(given) <= 8
            found = answers.pop(0)
            return ranked([*given, *found]) if name == "mended" else found

        return run

    monkeypatch.setattr(_solve, "search", lambda *given, **options: [])
    monkeypatch.setattr(_solve, "distinct_on", lambda shapes, ranks: list(ranks))
    monkeypatch.setattr(_solve, "from_maps", lambda *given: begun)
    monkeypatch.setattr(_solve, "from_tips", lambda *given: [])
    monkeypatch.setattr(_solve, "from_points", lambda *given: [])
    monkeypatch.setattr(_solve, "follow_all", lambda *given: list(followed))
    for name in ("mended", "regrown", "drawn_again", "continued_on"):
        monkeypatch.setattr(_solve, name, stage(name))
    stages = [] if clear else ["mended"]
    stages += ["drawn_again"] if partial else ["regrown"]
    stages += ["continued_on"] if partial and not clear else []
    stages += ["drawn_again"]
    for best in range(len(stages)):
        calls.clear()
        answers += [[own] if i == best else [] for i in range(len(stages))]
        told: list[tuple[str, float]] = []
        assert candidates(sides, lambda *how, told=told: told.append(how)) == [own, *followed]
        assert calls == stages
        assert told[-1] == ("search", 1.0)


@pytest.mark.parametrize("partial", [False, True])
def test_ways_mend_all_candidates_and_patches_those_of_parts(
    monkeypatch: pytest.MonkeyPatch, partial: bool
) -> None:
    first, by_ways, by_patches = one_of(0.3), one_of(0.2), one_of(0.1)
    monkeypatch.setattr(_solve, "distinct_on", lambda shapes, ranks: list(ranks))
    monkeypatch.setattr(_solve, "relocated", lambda sides, found: [by_ways])
    monkeypatch.setattr(_solve, "continued_on", lambda sides, found: [by_patches])
    sides = SimpleNamespace(partial=partial, rough=(), proxies=())
    assert mended(sides, [first]) == [by_patches] * partial + [by_ways, first]


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
