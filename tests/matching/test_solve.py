"""The matcher on plain arrays: what is chosen where a symmetry leaves the choice free."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from unbend import Mesh
from unbend.datasets import keep, make_biped, make_sphere, rest_map
from unbend.matching import _solve
from unbend.matching._inputs import prepare_shape
from unbend.matching._judge import Candidate, distinct, ranked
from unbend.matching._proxy import make_proxy
from unbend.matching._registration import LOOSE, LOOSEST, PULLS, mapped_start
from unbend.matching._relocation import EVERYWHERE, TRUNK
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
    given = _recorded(monkeypatch, from_guesses=lambda sides, guesses, maps, n: maps)
    maps = _solve.from_tips(sides, 60, 12) if of_tips else _solve.from_points(sides)
    assert given[0][1] is sides
    assert len(given[0][2]) == len(maps)
    assert given[0][4] == (12 if of_tips else _solve._GUESSED)
    ours, theirs = sides.source.rough, sides.target.rough
    truth = rest_map(source, target)[part.origin][sides.source.proxy.kept[ours.kept]]
    right = sides.target.shape.vertices[truth]
    off = [np.linalg.norm(theirs.shape.vertices[one] - right, axis=1).mean() for one, _ in maps]
    assert min(off) < 0.1


def _faked(partial: bool = False) -> SimpleNamespace:
    """Two shapes by name alone."""
    source, target = (
        SimpleNamespace(
            shape=f"the {name}",
            proxy=SimpleNamespace(kept=np.arange(2)),
            rough=SimpleNamespace(shape=f"the rough {name}", kept=np.arange(2)),
        )
        for name in ("source", "target")
    )
    return SimpleNamespace(
        partial=partial,
        turned=False,
        source=source,
        target=target,
        rough=(source.rough.shape, target.rough.shape),
        proxies=("proxy", "other proxy"),
    )


def _recorded(monkeypatch: pytest.MonkeyPatch, **answers: Any) -> list[tuple[Any, ...]]:
    """Stages that give these answers, by what they are given; return what each was given."""
    calls: list[tuple[Any, ...]] = []

    def stage(name: str, answer: Any) -> Callable:
        def run(*given: Any, **options: Any) -> Any:
            calls.append((name, *given, *options.values()))
            return answer(*given, **options) if callable(answer) else answer

        return run

    for name, answer in answers.items():
        monkeypatch.setattr(_solve, name, stage(name, answer))
    return calls


@pytest.mark.parametrize("partial", [False, True])
@pytest.mark.parametrize("thorough", [False, True])
@pytest.mark.parametrize("clear", [False, True])
def test_the_best_of_every_kind_are_followed(
    monkeypatch: pytest.MonkeyPatch, partial: bool, thorough: bool, clear: bool
) -> None:
    sides = _faked(partial)
    spectral, tips, points = (
        [one_of(cost + 0.01 * i) for i in range(30, 0, -1)] for cost in (0.4, 0.6, 0.5)
    )
    best = one_of(0.1)
    spectral += [best] if clear else []
    ended, mending = one_of(0.1 if clear else 0.3), one_of(0.2)
    calls = _recorded(
        monkeypatch,
        search=["a map"],
        from_maps=spectral,
        from_tips=tips,
        from_points=points,
        follow_all=[ended],
        mended=lambda sides, found: ranked([*found, mending]),
        regrown=[],
        drawn_again=[],
        continued_on=[],
        distinct_on=lambda shapes, ranks: list(ranks),
    )
    told: list[Any] = []
    quick = clear and not thorough
    both = [ended] if quick else ranked([ended, mending])
    assert candidates(sides, lambda *how: told.append(how), thorough) == both
    by_name = {name: [call[1:] for call in calls if call[0] == name] for name, *_ in calls}
    ((source, target, step),) = by_name["search"]
    assert (source, target) == ("the source", "the target")
    step(0.5)  # the search is the first half of it
    assert told == [("search", 1.0), ("search", 0.25)]
    assert by_name["from_maps"] == [(sides, sides.rough, ["a map"], PULLS[:1])]
    sizes = _solve._FEW if quick else _solve._MANY
    assert by_name["from_tips"] == [(sides, *sizes)]
    assert ("from_points" in by_name) == (partial and not quick)
    ((_, ways, besides),) = by_name["follow_all"]
    assert len(ways) == (_solve._CLEARLY_FOLLOWED if quick else _solve._FOLLOWED)
    assert ways == ranked([*spectral, *tips])[: len(ways)]
    if quick:
        assert besides == [best]
    else:
        expected = ranked(spectral)[: _solve._SPECTRAL]
        assert besides == expected + ranked(points)[: _solve._POINTED * partial]
    # Those that were best and those that mending makes best are gone on with.
    assert ("mended" in by_name) == (not quick)
    _, again, *pulls = by_name["drawn_again" if partial else "regrown"][0]
    assert again == ([ended] if quick else [ended, mending])
    if partial:  # first the loosest, for what is near its end to slide as a whole
        assert list(*pulls) == sorted(*pulls)
        assert (pulls[0][0], pulls[0][-1]) == (LOOSEST[0], PULLS[-1])
    assert by_name["drawn_again"][-1] == (sides, both, PULLS)


def test_what_seemed_clear_and_is_not_on_finer_proxies_is_searched_for_among_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sides = _faked()
    first, right = one_of(0.1), one_of(0.05)
    calls = _recorded(
        monkeypatch,
        search=[],
        from_maps=[first],
        from_tips=lambda sides, *sizes: [right] if sizes == _solve._MANY else [],
        follow_all=lambda sides, ways, besides: [one_of(0.3)] if right not in ways else [right],
        mended=lambda sides, found: found,
        regrown=[],
        drawn_again=[],
        distinct_on=lambda shapes, ranks: list(ranks),
    )
    assert candidates(sides) == [right]
    assert [call[2:] for call in calls if call[0] == "from_tips"] == [_solve._FEW, _solve._MANY]


def test_of_guesses_the_cheapest_maps_are_begun_with_and_the_best_of_these_tightened(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sides = _faked()
    n = 3 * _solve._TIGHTENED
    chance = np.random.default_rng(0)
    costs = chance.integers(3, size=n) + 1e-9 * chance.normal(size=n)  # equal but for rounding
    guesses = [SimpleNamespace(size=1 + i / n) for i in range(n)]
    maps = [(np.full(4, i), np.full(5, i)) for i in range(n)]
    begun: dict[str, Candidate] = {}

    def start(source: str, target: str, forward: Any, backward: Any, size: float) -> str:
        assert (source, target) == sides.rough
        assert (forward.shape, backward.shape) == ((4,), (5,))
        i = int(forward[0])
        assert (backward == i).all()
        assert size == guesses[i].size
        return f"start {i}"

    def draw(sides: Any, shapes: Any, starts: Any, pulls: Any, *, resize: bool) -> Any:
        if starts[0] in begun:
            return ["tightened", *starts]
        for i, one in enumerate(starts):
            begun[one] = replace(one_of(1 - i / n), registered=one)
        return list(begun.values())

    calls = _recorded(
        monkeypatch,
        rough_costs=costs,
        mapped_start=start,
        drawn=draw,
        distinct_on=lambda shapes, ranks: list(ranks),
    )
    n_begun = 2 * _solve._TIGHTENED
    found = _solve.from_guesses(sides, guesses, maps, n_begun)
    first = sorted(range(n), key=lambda i: round(costs[i]))  # of equal ones those that came first
    order = [f"start {i}" for i in first[:n_begun]]
    assert list(begun) == order
    assert found == ["tightened", *order[: -_solve._TIGHTENED - 1 : -1]]
    assert [call[0] for call in calls] == [
        "rough_costs", *["mapped_start"] * n_begun, "drawn", "distinct_on", "drawn",
    ]  # fmt: skip
    drawn = [call[2:] for call in calls if call[0] == "drawn"]
    assert [(shapes, pulls, resize) for shapes, _, pulls, resize in drawn] == [
        (sides.rough, LOOSE[:1], False),
        (sides.rough, LOOSE[1:], False),
    ]
    ours, theirs, forward, backward = calls[0][1:]
    assert (ours, theirs) == sides.rough
    np.testing.assert_array_equal(forward, np.tile(np.arange(n), (4, 1)))
    np.testing.assert_array_equal(backward, np.tile(np.arange(n), (5, 1)))
    assert _solve.from_guesses(sides, [], [], n_begun) == []


def test_every_candidate_is_relocated_by_all_ways_and_by_those_of_the_trunk(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sides = _faked()
    ways = [replace(one_of(0.1), registered=name) for name in ("one", "other")]
    calls = _recorded(
        monkeypatch,
        lower=lambda one, ours, theirs: SimpleNamespace(
            name=one, source=SimpleNamespace(size=1.5), target=SimpleNamespace(size=2.5)
        ),
        relocate=lambda ours, theirs, one, asked: ((one.name, asked), "back"),
        mapped_start=lambda ours, theirs, forward, backward, size: (forward, backward, size),
        drawn=lambda sides, shapes, starts, pulls, resize: starts,
        follow_all=lambda sides, ways, besides: [*ways, *besides],
    )
    found = _solve.relocated(sides, ways)
    assert found == [
        ((name, asked), "back", 1.5) for name in ("one", "other") for asked in (EVERYWHERE, TRUNK)
    ]
    for name, *given in calls:
        if name in ("lower", "relocate", "mapped_start"):
            pair = given[1:3] if name == "lower" else given[:2]
            rough = sides.source.rough, sides.target.rough
            assert tuple(pair) == (rough if name == "lower" else sides.rough)
        if name == "drawn":
            assert given[1:] == [sides.rough, found, LOOSE, False]


def test_what_is_continued_is_continued_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """From what comes out, the best of it; all that came out is followed, the best of it."""
    sides = _faked()
    n = _solve._FOLLOWED

    def held(ours: Any, theirs: Any, one: str) -> list[str]:
        assert (ours, theirs) == sides.rough
        return ["head", "tail"]

    def draw(sides: Any, shapes: Any, starts: Any, pulls: Any) -> list[Candidate]:
        assert (shapes, pulls) == (sides.rough, LOOSE)
        return [
            replace(one_of(0.9 ** one.count("+") - i / 100), registered=one)
            for i, one in enumerate(starts)
        ]

    calls = _recorded(
        monkeypatch,
        lower=lambda one, ours, theirs: (one, ours, theirs) and one,
        patches_to_hold=held,
        continued=lambda ours, theirs, one, patches: f"{one}+{patches}",
        drawn=draw,
        follow_all=lambda sides, ways, besides: [*ways, *besides],
        distinct_on=lambda shapes, ranks: list(ranks),
    )
    given = [replace(one_of(0.1), registered=f"pose {i}") for i in range(n)]
    found = _solve.continued_on(sides, given)
    rough = sides.source.rough, sides.target.rough
    assert [call[1:] for call in calls if call[0] == "lower"] == [
        (one.registered, *rough) for one in given
    ]
    once = [f"pose {i}+{part}" for i in range(n) for part in ("head", "tail")]
    rounds = [call[3] for call in calls if call[0] == "drawn"]
    assert len(rounds) == _solve._AGAIN
    assert rounds[0] == once
    again = once[: -n - 1 : -1]  # the cheapest
    assert rounds[1] == [f"{one}+{part}" for one in again for part in ("head", "tail")]
    assert [one.registered for one in found] == rounds[-1][: -n - 1 : -1]
    assert calls[-1][0] == "follow_all"


def test_poses_are_drawn_on_and_maps_grown_on_the_finer_proxies(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sides = _faked()
    ways = [replace(one_of(0.1), registered=name) for name in ("one", "other")]
    calls = _recorded(
        monkeypatch,
        functional_map=lambda sides, one, size: (one.registered, size),
        rough_start=lambda ours, theirs, one: ("start", ours, theirs, one),
        register=lambda ours, theirs, starts, pulls, steps, resize: starts,
        judge=lambda ours, theirs, one, turned: (one, turned),
    )
    assert _solve.drawn_again(sides, ways, PULLS[1:]) == [("one", False), ("other", False)]
    proxies = sides.proxies
    assert calls[0] == ("register", *proxies, ["one", "other"], PULLS[1:], _solve.STEPS, True)
    assert calls[1][1:3] == proxies
    sides.turned = True
    few, many = _solve._SMOOTH
    assert few < many
    grown = [(name, size) for name in ("one", "other") for size in (few, many)]
    found = _solve.regrown(sides, ways)
    assert found == [(("start", *proxies, one), True) for one in grown]
    assert [call[4] for call in calls if call[0] == "register"] == [PULLS[1:], PULLS]


def test_a_pair_is_partial_if_either_shape_is(boxes: list[Shape]) -> None:
    whole, part = (
        Levels(replace(boxes[0], partial=one), None, None)  # type: ignore[arg-type]
        for one in (False, True)
    )
    assert not Sides(whole, whole).partial
    assert Sides(whole, part).partial
    assert Sides(part, whole).partial


def test_the_best_are_mended(monkeypatch: pytest.MonkeyPatch) -> None:
    n = max(_solve._RELOCATED, _solve._CONTINUED)
    found = [one_of(i / 100) for i in range(2 * n)]
    better = one_of(-1.0)
    shape = SimpleNamespace(ways=())
    sides = SimpleNamespace(partial=True, rough=(shape, shape), proxies=None)
    calls = _recorded(
        monkeypatch,
        relocated=[better],
        continued_on=[],
        distinct_on=lambda shapes, ranks: list(ranks),
    )
    assert mended(sides, found) == [better, *found]
    given = {name: call[-1] for name, *call in calls}
    assert given["relocated"] == found[: _solve._RELOCATED]
    assert given["continued_on"] == [better, *found][: _solve._CONTINUED]


def test_what_leads_to_the_same_place_is_left_out_whatever_the_vertices(
    boxes: list[Shape],
) -> None:
    ball = make_sphere(2)
    ours = prepare_shape(Mesh(ball.vertices * [1.6, 1.0, 0.7], ball.faces), 20, True).shape
    theirs = boxes[0]
    trees = cKDTree(theirs.vertices), cKDTree(ours.vertices)
    ways = []
    for signs in ([1, 1, 1], [1, 1, 1], [-1, -1, 1]):
        there, back = (
            tree.query(one.vertices * signs)[1]
            for tree, one in zip(trees, (ours, theirs), strict=True)
        )
        start = mapped_start(ours, theirs, there, back, 1.0)
        ways.append(replace(one_of(0.1), registered=start))
    assert distinct_on((ours, theirs), ways) == ways[::2]


def test_functions_of_shuffled_vertices_are_the_same(boxes: list[Shape]) -> None:
    shape, order = boxes[0], np.random.default_rng(0).permutation(642)
    shuffled = replace(shape, areas=shape.areas[order], basis=shape.basis[order])
    sides = SimpleNamespace(proxies=(shape, shuffled))
    way = replace(one_of(0.0), registered=(np.argsort(order), order))
    np.testing.assert_allclose(functional_map(sides, way, 20), np.eye(20), atol=1e-9)
