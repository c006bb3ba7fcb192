"""The matcher on plain arrays: hypotheses on proxies, the judge, the polish of what it chooses."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from unbend._parallel import run_all
from unbend._types import FloatArray, IntArray, Progress
from unbend.alignment import Pairs
from unbend.matching._continuation import continued, patches_to_hold
from unbend.matching._judge import DIGITS, Candidate, distinct, judge, ranked, rough_costs
from unbend.matching._points import find_points, guess_points, point_maps, sizes_to_try
from unbend.matching._proxy import Proxy, make_proxy
from unbend.matching._registration import (
    LOOSE,
    LOOSEST,
    PULLS,
    Registered,
    bearable,
    lift,
    lower,
    mapped_start,
    register,
    rough_start,
)
from unbend.matching._relocation import EVERYWHERE, TRUNK, relocate
from unbend.matching._search import search
from unbend.matching._shape import Shape
from unbend.matching._tips import Guess, find_tips, guess_limbs, limb_maps
from unbend.matching._zoomout import orthogonal_maps

_ROUGH_VERTICES, _PROXY_VERTICES = 400, 1000
STEPS = 8  # at each pull
# So many guesses from tips, in either sense, are looked at, and so many begun with, the best as
# they are. After the first, weakest pull so many are drawn on that lead to different places; so
# many of all candidates are followed on the finer proxies.
_MANY, _TIGHTENED, _FOLLOWED, _SPECTRAL = (400, 64), 16, 8, 3
# A candidate is clear if its cost is at most this and any other's so many times that, after this
# few from tips were tried; then it is followed, and some others to compare it with.
_CLEAR, _AHEAD, _FEW, _CLEARLY_FOLLOWED = 0.2, 1.4, (60, 12), 3
# For parts: points of either shape, guesses which correspond, and candidates of these that are
# followed besides.
_POINTS, _GUESSED, _POINTED = (40, 60), 24, 4
# So many of those are mended by the ways that they agree with; for parts so many, and the best once
# more, by what they explain best, so often.
_RELOCATED = 6
_CONTINUED, _AGAIN = 4, 2
# So many of all start anew from smooth maps of their own: of few functions, and of many, which
# is better where the two metrics agree and worse where not; the judge tells.
_REGROWN, _SMOOTH = 4, (30, 120)


class Levels(NamedTuple):
    """A shape, its proxy, and that one's own, rougher one."""

    shape: Shape
    proxy: Proxy
    rough: Proxy

    def reflected(self) -> Levels:
        """Take the shape as its mirror image."""
        proxies = (one._replace(shape=one.shape.reflected()) for one in self[1:])
        return Levels(self.shape.reflected(), *proxies)


class Sides(NamedTuple):
    """Two shapes to match; `turned` if the target is the mirror image of what was given."""

    source: Levels
    target: Levels
    turned: bool = False

    @property
    def proxies(self) -> tuple[Shape, Shape]:
        """Proxies of source and target."""
        return self.source.proxy.shape, self.target.proxy.shape

    @property
    def rough(self) -> tuple[Shape, Shape]:
        """And the rougher ones."""
        return self.source.rough.shape, self.target.rough.shape

    @property
    def partial(self) -> bool:
        """Whether either may be a part."""
        return self.source.shape.partial or self.target.shape.partial

    def reflected(self) -> Sides:
        """Take the target as its mirror image."""
        return Sides(self.source, self.target.reflected(), not self.turned)


def make_sides(source: Shape, target: Shape) -> Sides:
    """Make the proxies, and factorise what every hypothesis solves with."""
    sides = Sides(*run_all(functools.partial(_make_levels, one) for one in (source, target)))
    for pair in (sides.proxies, sides.rough):
        loosest = LOOSEST if sides.partial else ()
        pulls = bearable(*pair, (*loosest, *LOOSE, *PULLS[1:]))
        run_all(functools.partial(make_ready, one, pulls) for one in pair)
    for one in sides.rough:  # once, before several threads do
        _ = one.patches, one.ways, one.landmark_ways
    return sides


def candidates(
    sides: Sides, on_step: Progress | None = None, thorough: bool = False
) -> list[Candidate]:
    """Find the distinct ways in which two shapes may correspond, the best first.

    Unless the search is to be thorough, few are tried first: one that is good and far ahead of any
    other is all that is gone on with.
    """
    step = None if on_step is None else lambda share: on_step("search", share / 2)
    maps = search(sides.source.shape, sides.target.shape, on_step=step)
    begun = ranked(from_maps(sides, sides.rough, maps, PULLS[:1]))
    spectral = distinct_on(sides, sides.rough, begun)
    clear = not thorough and is_clear(spectral)
    if clear:
        ways = distinct_on(sides, sides.rough, ranked([*begun, *from_tips(sides, *_FEW)]))
        clear = is_clear(ways)
    if clear:
        found = follow_all(sides, ways[:_CLEARLY_FOLLOWED], spectral[:1])
        clear = is_clear(distinct_on(sides, sides.proxies, found))
    if not clear:
        ways = distinct_on(sides, sides.rough, ranked([*begun, *from_tips(sides, *_MANY)]))
        others = spectral[:_SPECTRAL]
        if sides.partial:
            others += distinct_on(sides, sides.rough, ranked(from_points(sides)))[:_POINTED]
        found = follow_all(sides, ways[:_FOLLOWED], others)
    n_best = 1 if clear else _REGROWN
    best = distinct_on(sides, sides.proxies, found)[:n_best]
    if not clear:
        found = mended(sides, found)
        best += [
            one for one in distinct_on(sides, sides.proxies, found)[:n_best] if one not in best
        ]
    if sides.partial:
        again = drawn_again(sides, best, (*LOOSEST, *LOOSE, *PULLS[1:]))
    else:
        again = regrown(sides, best)
    found = ranked([*found, *again])
    best = distinct_on(sides, sides.proxies, found)[:n_best]
    if sides.partial and not clear:
        found = ranked([*found, *continued_on(sides, best)])
        best = distinct_on(sides, sides.proxies, found)[:n_best]
    found = ranked([*found, *drawn_again(sides, best, PULLS)])
    if on_step is not None:
        on_step("search", 1.0)
    return distinct_on(sides, sides.proxies, found)


def is_clear(ways: list[Candidate]) -> bool:
    """Whether the first of some ranked candidates that differ is good, and far ahead."""
    first, *others = (round(one.cost, DIGITS) for one in ways[:2])
    ahead = all(other > _AHEAD * first for other in others)
    return ahead and first <= _CLEAR and ways[0].orientation > 0


def distinct_on(
    sides: Sides, shapes: tuple[Shape, Shape], ranks: list[Candidate]
) -> list[Candidate]:
    """Leave out of ranked candidates on proxies, or rough ones, those that a better one equals."""
    rough = sides.target.rough
    places = rough.parents if shapes == sides.proxies else np.arange(len(rough.kept))
    return distinct(ranks, shapes[0].areas, rough.shape.ways, places)


def follow_all(sides: Sides, ways: list[Candidate], besides: list[Candidate]) -> list[Candidate]:
    """Go on with candidates on the finer proxies, and rank them.

    Some of the spectra's are among them even if tips lead the same way and seem better: poses of
    one body end up closer to each other from there. Of parts some from points are, too.
    """
    left_out = [one for one in besides if one not in ways]
    rough = sides.source.rough, sides.target.rough
    poses = [lift(one.registered, *rough, *sides.proxies) for one in [*ways, *left_out]]
    return ranked(drawn(sides, sides.proxies, poses, PULLS[1:]))


def drawn(
    sides: Sides,
    shapes: tuple[Shape, Shape],
    starts: Sequence[Registered],
    pulls: tuple[float, ...],
    *,
    resize: bool = True,
) -> list[Candidate]:
    """Register two proxies from every start, side by side, and judge what comes out."""
    found = register(*shapes, starts, pulls, STEPS, resize)
    return run_all(functools.partial(judge, *shapes, one, sides.turned) for one in found)


def from_maps(
    sides: Sides,
    shapes: tuple[Shape, Shape],
    maps: Iterable[FloatArray],
    pulls: tuple[float, ...],
) -> list[Candidate]:
    """Register two proxies from functional maps."""
    starts = run_all(functools.partial(rough_start, *shapes, one) for one in maps)
    return drawn(sides, shapes, starts, pulls)


def from_tips(sides: Sides, n_guesses: int, n_begun: int) -> list[Candidate]:
    """Register the rough proxies from guesses which tips of limbs correspond."""
    mine, other = (find_tips(one) for one in sides.proxies)
    n_landmarks = len(sides.proxies[0].landmarks)
    guesses = guess_limbs(mine, other, n_guesses, n_landmarks, sides.partial)
    kept = sides.source.rough.kept, sides.target.rough.kept
    maps = [
        limb_maps(mine.taken(one.source, kept[0]), other.taken(one.target, kept[1]))
        for one in guesses
    ]
    return from_guesses(sides, guesses, maps, n_begun)


def from_points(sides: Sides) -> list[Candidate]:
    """Register the rough proxies from guesses which points, all over the shapes, correspond."""
    mine, other = (
        find_points(one, count) for one, count in zip(sides.proxies, _POINTS, strict=True)
    )
    guesses = guess_points(mine, other, sizes_to_try(*sides.proxies), _GUESSED)
    ours, theirs = mine.fields[sides.source.rough.kept], other.fields[sides.target.rough.kept]
    maps = [point_maps(ours[:, one.source], theirs[:, one.target], one.size) for one in guesses]
    return from_guesses(sides, guesses, maps, _GUESSED)


def from_guesses(
    sides: Sides, guesses: list[Guess], maps: list[tuple[IntArray, IntArray]], n_begun: int
) -> list[Candidate]:
    """Register the rough proxies from the best of guesses' maps, and tighten the best of these."""
    if not guesses:
        return []
    forward, backward = (np.stack(ways, axis=1) for ways in zip(*maps, strict=True))
    costs = rough_costs(*sides.rough, forward, backward).round(DIGITS)
    starts = [
        mapped_start(*sides.rough, forward[:, i], backward[:, i], guesses[i].size)
        for i in np.argsort(costs, kind="stable")[:n_begun]
    ]
    begun = ranked(drawn(sides, sides.rough, starts, LOOSE[:1], resize=False))
    best = distinct_on(sides, sides.rough, begun)[:_TIGHTENED]
    poses = [one.registered for one in best]
    return drawn(sides, sides.rough, poses, LOOSE[1:], resize=False)


def mended(sides: Sides, found: list[Candidate]) -> list[Candidate]:
    """Add to ranked candidates what the best become by the ways, and by the patches, that agree."""
    leading = distinct_on(sides, sides.proxies, found)
    found = ranked([*found, *relocated(sides, leading[:_RELOCATED])])
    if sides.partial:
        leading = distinct_on(sides, sides.proxies, found)
        found = ranked([*found, *continued_on(sides, leading[:_CONTINUED])])
    return found


def relocated(sides: Sides, candidates: Iterable[Candidate]) -> list[Candidate]:
    """Register from where candidates' vertices belong by the ways to those far away."""
    rough = sides.source.rough, sides.target.rough

    def start(candidate: Candidate, asked: float) -> Registered:
        found = lower(candidate.registered, *rough)
        maps = relocate(*sides.rough, found, asked)
        return mapped_start(*sides.rough, *maps, found.source.size)

    every = ((one, asked) for one in candidates for asked in (EVERYWHERE, TRUNK))
    starts = run_all([functools.partial(start, *one) for one in every])
    return follow_all(sides, drawn(sides, sides.rough, starts, LOOSE, resize=False), [])


def continued_on(sides: Sides, candidates: Iterable[Candidate]) -> list[Candidate]:
    """Register from what candidates explain best, continued, and from what comes out again."""
    ours, theirs = sides.rough
    found: list[Candidate] = []
    poses = [lower(one.registered, sides.source.rough, sides.target.rough) for one in candidates]
    for _ in range(_AGAIN):
        held = [(one, patches) for one in poses for patches in patches_to_hold(ours, theirs, one)]
        starts = run_all(
            functools.partial(continued, ours, theirs, one, patches) for one, patches in held
        )
        begun = distinct_on(sides, sides.rough, ranked(drawn(sides, sides.rough, starts, LOOSE)))
        poses = [one.registered for one in begun[:_FOLLOWED]]
        found += begun
    return follow_all(sides, distinct_on(sides, sides.rough, ranked(found))[:_FOLLOWED], [])


def drawn_again(
    sides: Sides, candidates: Iterable[Candidate], pulls: tuple[float, ...]
) -> list[Candidate]:
    """Draw candidates' poses together once more; weaker pulls first let them relax."""
    return drawn(sides, sides.proxies, [one.registered for one in candidates], pulls)


def regrown(sides: Sides, candidates: Iterable[Candidate]) -> list[Candidate]:
    """Register anew from functional maps, of two sizes, of candidates' own point maps."""
    maps = [functional_map(sides, one, size) for one in candidates for size in _SMOOTH]
    return from_maps(sides, sides.proxies, maps, PULLS)


def functional_map(sides: Sides, candidate: Candidate, size: int) -> FloatArray:
    """Orthogonal map of so many functions, (size, size), that fits a candidate's point maps."""
    ours, theirs = sides.proxies
    forward, backward = candidate.registered[:2]
    size = min(size, ours.k, theirs.k)
    pairs = Pairs(forward[None], backward[None], np.zeros(1))
    return np.asarray(orthogonal_maps(ours.basis[:, :size], theirs.basis[:, :size], pairs)[0])


def _make_levels(shape: Shape) -> Levels:
    _ = shape.samples, shape.signature  # what the search asks for, of both shapes at once
    proxy = make_proxy(shape, _PROXY_VERTICES)
    return Levels(shape, proxy, make_proxy(proxy.shape, _ROUGH_VERTICES))


def make_ready(shape: Shape, pulls: tuple[float, ...], wide: bool = False) -> None:
    """Make what several threads would make several times."""
    _ = shape.averaging, shape.normals, shape.position_coefficients, shape.fans
    _ = shape.patches if wide else shape.details
    _ = [shape.pulled(pull) for pull in pulls]
