"""The matcher on plain arrays: hypotheses on proxies, the judge, the polish of what it chooses."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from unbend._parallel import one_blas_thread, run_all
from unbend._types import FloatArray, Progress
from unbend.alignment import Pairs
from unbend.matching._judge import Candidate, distinct, judge, ranked
from unbend.matching._proxy import Proxy, make_proxy
from unbend.matching._registration import (
    LOOSE,
    PULLS,
    Registered,
    lift,
    limb_start,
    register,
    rough_start,
    smooth_start,
)
from unbend.matching._search import search
from unbend.matching._shape import Shape
from unbend.matching._tips import find_tips, guess_limbs
from unbend.matching._zoomout import grow, orthogonal_maps

_ROUGH_VERTICES, _PROXY_VERTICES = 400, 1000
_STEPS = 8
# After the first, weakest pull so many candidates are drawn on that lead to different places, and
# so many of those are followed on the finer proxies.
_TIGHTENED, _FOLLOWED = 24, 8
# So many of those start anew from smooth maps of their own: of few functions, and of many, which
# is better where the two metrics agree and worse where not; the judge tells.
_REGROWN, _SMOOTH = 4, (30, 120)
# Growth on the full meshes multiplies the number of functions by this, over so many samples.
_GROWTH, _GROWN_OVER = 1.25, 1500


# Poses and maps, and the functional map that they come of, if of one.
Start = tuple[Registered, FloatArray | None]


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

    def reflected(self) -> Sides:
        """Take the target as its mirror image."""
        return Sides(self.source, self.target.reflected(), not self.turned)


@one_blas_thread()  # the threads are ours
def make_sides(source: Shape, target: Shape) -> Sides:
    """Make the proxies, and factorise what every hypothesis solves with."""
    return Sides(*run_all(functools.partial(_make_levels, one) for one in (source, target)))


@one_blas_thread()
def candidates(sides: Sides, on_step: Progress | None = None) -> list[Candidate]:
    """Find the distinct ways in which two shapes may correspond, the best first."""
    step = None if on_step is None else lambda share: on_step("search", share / 2)
    maps = search(sides.source.shape, sides.target.shape, on_step=step)
    starts: list[Callable[[], Start]] = [functools.partial(from_map, sides, one) for one in maps]
    starts += from_tips(sides)
    found = tried(sides, starts)
    ours, theirs = sides.source.proxy.shape, sides.target.proxy.shape
    best = distinct(found, theirs, ours.areas)[:_REGROWN]
    if ours.partial or theirs.partial:
        tasks = [functools.partial(loosened, sides, one) for one in best]
    else:
        tasks = [functools.partial(regrown, sides, one, size) for one in best for size in _SMOOTH]
    found = ranked([*found, *run_all(tasks)])
    if on_step is not None:
        on_step("search", 1.0)
    return distinct(found, theirs, ours.areas)


def from_map(sides: Sides, functional_map: FloatArray) -> Start:
    """Begin with a functional map."""
    rough = rough_start(sides.source.rough.shape, sides.target.rough.shape, functional_map)
    return rough, functional_map


def from_tips(sides: Sides) -> Iterator[Callable[[], Start]]:
    """Begin with guesses which tips of limbs correspond."""
    ours, theirs = sides.source.proxy.shape, sides.target.proxy.shape
    mine, other = find_tips(ours), find_tips(theirs)
    rough = sides.source.rough, sides.target.rough
    for one in guess_limbs(mine, other, len(ours.landmarks)):
        ways = (
            mine.fields[rough[0].kept][:, one.source],
            other.fields[rough[1].kept][:, one.target],
        )
        yield functools.partial(from_ways, sides, *ways, one.size)


def from_ways(sides: Sides, ours: FloatArray, theirs: FloatArray, size: float) -> Start:
    """Begin with the ways to the tips of limbs."""
    return limb_start(sides.source.rough.shape, sides.target.rough.shape, ours, theirs, size), None


def tried(sides: Sides, starts: Sequence[Callable[[], Start]]) -> list[Candidate]:
    """Register hypotheses on the proxies and rank them; most stop on the rough ones."""
    ours, theirs = sides.source.rough.shape, sides.target.rough.shape
    finer = sides.source.proxy.shape, sides.target.proxy.shape

    def begin(start: Callable[[], Start]) -> Candidate:
        found, functional_map = start()
        found = register(ours, theirs, found, LOOSE[:1], _STEPS, resize=functional_map is not None)
        return judge(ours, theirs, found, sides.turned, functional_map)

    def tighten(one: Candidate) -> Candidate:
        found = register(
            ours, theirs, one.registered, LOOSE[1:], _STEPS, resize=one.hypothesis is not None
        )
        return judge(ours, theirs, found, sides.turned, one.hypothesis)

    def go_on(one: Candidate) -> Candidate:
        found = lift(one.registered, sides.source.rough, sides.target.rough, *finer)
        found = register(*finer, found, PULLS[1:], _STEPS)
        return judge(*finer, found, sides.turned, one.hypothesis)

    begun = ranked(run_all(functools.partial(begin, one) for one in starts))
    begun = distinct(begun, theirs, ours.areas)[:_TIGHTENED]
    begun = ranked(run_all(functools.partial(tighten, one) for one in begun))
    followed = distinct(begun, theirs, ours.areas)[:_FOLLOWED]
    return ranked(run_all(functools.partial(go_on, one) for one in followed))


def loosened(sides: Sides, candidate: Candidate) -> Candidate:
    """Let a candidate's poses relax, and draw them together again."""
    ours, theirs = sides.source.proxy.shape, sides.target.proxy.shape
    found = register(ours, theirs, candidate.registered, LOOSE + PULLS[1:], _STEPS)
    return judge(ours, theirs, found, sides.turned, candidate.hypothesis)


def regrown(sides: Sides, candidate: Candidate, size: int) -> Candidate:
    """Register anew from the functional map, of a size, of a candidate's own point maps."""
    ours, theirs = sides.source.proxy.shape, sides.target.proxy.shape
    forward, backward = candidate.registered[:2]
    size = min(size, ours.k, theirs.k)
    pairs = Pairs(forward[None], backward[None], np.zeros(1))
    functional_map = orthogonal_maps(ours.basis[:, :size], theirs.basis[:, :size], pairs)[0]
    start = rough_start(ours, theirs, functional_map)
    found = register(ours, theirs, start, PULLS, _STEPS)
    return judge(ours, theirs, found, sides.turned, candidate.hypothesis)


@one_blas_thread()
def refined(sides: Sides, candidate: Candidate, *, polish: bool = True) -> Candidate:
    """Bring a candidate from the proxies to the shapes themselves.

    They are registered from the proxies' poses and, once more, from those of its hypothesis grown
    through all eigenfunctions, which slides less where the two metrics agree. The judge tells.
    """
    if candidate.reflected != sides.turned:
        sides = sides.reflected()
    ours, theirs = sides.source.shape, sides.target.shape
    lifted = lift(candidate.registered, sides.source.proxy, sides.target.proxy, ours, theirs)
    if not polish:
        return judge(ours, theirs, lifted, candidate.reflected)
    run_all(functools.partial(_make_ready, one) for one in (ours, theirs))

    def from_proxies() -> Candidate:
        found = register(ours, theirs, lifted, PULLS[1:], _STEPS // 2)
        return judge(ours, theirs, found, candidate.reflected)

    def grown(hypothesis: FloatArray) -> Candidate:
        start = grown_start(ours, theirs, hypothesis, lifted)
        found = register(ours, theirs, start, PULLS, _STEPS)
        return judge(ours, theirs, found, candidate.reflected)

    tasks: list[Callable[[], Candidate]] = [from_proxies]
    if candidate.hypothesis is not None:
        tasks.append(functools.partial(grown, candidate.hypothesis))
    return ranked(run_all(tasks))[0]


def matched_whole(candidate: Candidate, sides: Sides, torn: float) -> Candidate:
    """Give every vertex its partner, unless more than a share of either area is to have none."""
    found = candidate.registered
    poses = []
    for pose, level in zip(found[2:], sides[:2], strict=True):
        none = float(level.shape.areas @ ~pose.within)
        poses.append(pose if none > torn else pose._replace(within=np.ones_like(pose.within)))
    return replace(candidate, registered=Registered(*found[:2], *poses))


def grown_start(
    source: Shape, target: Shape, hypothesis: FloatArray, near: Registered
) -> Registered:
    """Poses and maps of a hypothesis grown through all functions, maps sought from near ones."""
    sizes, most = [len(hypothesis)], min(source.k, target.k)
    while sizes[-1] < most:
        sizes.append(min(most, round(_GROWTH * sizes[-1])))
    functional_map = grow(
        (source.eigenvalues, source.basis[source.samples[:_GROWN_OVER]]),
        (target.eigenvalues, target.basis[target.samples[:_GROWN_OVER]]),
        hypothesis,
        sizes[1:],
    )
    return smooth_start(source, target, functional_map, near)


def _make_levels(shape: Shape) -> Levels:
    proxy = make_proxy(shape, _PROXY_VERTICES)
    rough = make_proxy(proxy.shape, _ROUGH_VERTICES)
    for one in (proxy.shape, rough.shape):
        _make_ready(one)
    return Levels(shape, proxy, rough)


def _make_ready(shape: Shape) -> None:
    """Make what several threads would make several times."""
    _ = shape.averaging, shape.patches, shape.normals, shape.position_coefficients, shape.spokes
    _ = [shape.pulled(pull) for pull in PULLS]
