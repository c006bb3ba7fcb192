"""The plan of a match: stages that propose candidates, and how many candidates of each are kept.

A stage is a function of the two shapes and the candidates so far, best first and at the level of
its line in :data:`PLAN`, that returns new candidates at that level. It may read the proxies of the
other level. To add a source of hypotheses, write such a function and give it a line::

    Step(COARSE, from_tattoos, BEAM)

With ``for_parts=True`` it runs only if either shape may be partial. Coarse lines come first, and
the first of them must propose something. docs/how-matching-works.md has the same table.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from unbend._parallel import run_all
from unbend._types import FloatArray, IntArray, Progress
from unbend.alignment import Motions, find_motions
from unbend.deformation import TURNING
from unbend.matching import _constants as constants
from unbend.matching._extremities import find_extremities, guess_limbs, limb_maps
from unbend.matching._registration import (
    Registered,
    laid_maps,
    laid_starts,
    lift,
    limited,
    mapped_start,
    register,
    rough_start,
)
from unbend.matching._score import FLOOR, Candidate, missed_landmarks, ranked, rough_costs, scored
from unbend.matching._search import search
from unbend.matching._shape import Proxy, Shape, make_proxy

COARSE, MEDIUM = 0, 1  # levels of detail
_SAMPLES = 64  # points of a shape, by which motions are compared
# The best map costs so many times as much if the target is a mirror image: of closed shapes, and of
# others, where the map onto that costs less than `FEATURES`, as poses hardly differ; and elsewhere.
# Of shapes of one side and symmetric ones it costs up to 1.1, 1.3 and 1.6 times as much.
_MIRRORED = 1 + constants.NEARLY, 1.5, 2.0
BEAM = constants.BEAM
COARSE_WEIGHTS, MEDIUM_WEIGHTS = constants.DATA_WEIGHTS[2:5], constants.DATA_WEIGHTS[5:]


class Levels(NamedTuple):
    """A shape, and its proxies by level, the coarser one a proxy of the finer one."""

    shape: Shape
    proxies: tuple[Proxy, Proxy]

    def changed(self, change: Callable[[Shape], Shape]) -> Levels:
        """Change the shape and its proxies alike."""
        coarse, medium = (one._replace(shape=change(one.shape)) for one in self.proxies)
        return Levels(change(self.shape), (coarse, medium))

    def apart(self, one: IntArray, other: IntArray) -> FloatArray:
        """Geodesic distances between vertices of the shape, as its coarse copy has them."""
        coarse, medium = self.proxies
        places = coarse.parents[medium.parents]
        return coarse.shape.distances[places[one], places[other]]


class Sides(NamedTuple):
    """Two shapes to match, and the functional maps that bring their spectral forms close.

    Eigenfunctions, and so the maps, do not tell a surface from its mirror image.
    """

    source: Levels
    target: Levels
    maps: FloatArray  # (h, k, k)
    turned: bool = False  # whether the target is the mirror image of what was given

    def at(self, level: int) -> tuple[Shape, Shape]:
        """Proxies of source and target at a level."""
        return self.source.proxies[level].shape, self.target.proxies[level].shape

    @property
    def partial(self) -> bool:
        """Whether either may be partial."""
        return self.source.shape.partial or self.target.shape.partial

    def reflected(self) -> Sides:
        """Take the target as its mirror image."""
        return self._replace(target=self.target.changed(Shape.reflected), turned=not self.turned)

    def unled(self) -> Sides:
        """Take both without their landmarks."""
        bare = functools.partial(Shape.led, landmarks=self.source.shape.landmarks[:0])
        return self._replace(source=self.source.changed(bare), target=self.target.changed(bare))


Stage = Callable[[Sides, list[Candidate]], list[Candidate]]


class Step(NamedTuple):
    """A line of the plan: a stage, the level at which it proposes, and how many it keeps."""

    level: int
    stage: Stage
    keep: int
    for_parts: bool = False  # left out where neither shape may be partial


def make_sides(source: Shape, target: Shape) -> Sides:
    """Make the proxies, and factorise what every hypothesis solves with."""
    shapes = [source] if target is source else [source, target]
    levels = run_all(functools.partial(_make_levels, one) for one in shapes)
    mine, other = levels[0], levels[-1]
    medium = constants.DATA_WEIGHTS if any(one.partial for one in shapes) else MEDIUM_WEIGHTS
    tasks = []
    for level, weights in (COARSE, COARSE_WEIGHTS), (MEDIUM, medium):
        pair = mine.proxies[level].shape, other.proxies[level].shape
        data_weights = limited(*pair, weights)
        tasks += [functools.partial(precompute, one, data_weights) for one in pair]
    coarse = other.proxies[COARSE].shape
    maps, *_ = run_all(
        [functools.partial(search, source, target), lambda: coarse.distances, *tasks]
    )
    return Sides(mine, other, maps)


def candidates(sides: Sides, on_step: Progress | None = None) -> list[Candidate]:
    """Find distinct candidate maps between the finer proxies, the best first."""
    found: list[Candidate] = []
    ranks, level = found, COARSE
    for i, step in enumerate(PLAN):
        if sides.partial or not step.for_parts:
            if step.level != level:
                # Duplicates go along: the better of two on this level may be the worse on the next.
                found, level = lifted(sides, ranked(found)), step.level
                ranks = best(sides, level, found)
            found = [*found, *best(sides, level, step.stage(sides, ranks))[: step.keep]]
            ranks = best(sides, level, found)
        if on_step is not None:
            on_step("search", (i + 1) / len(PLAN))
    return ranks if level == MEDIUM else best(sides, MEDIUM, lifted(sides, ranked(found)))


def onto_mirror_image(sides: Sides, found: Sequence[Candidate]) -> list[Candidate]:
    """Return the map onto the target's mirror image if it fits clearly better than all found.

    That happens if one shape is a left hand, and the other a right one; for symmetric bodies the
    two are about as good. If hands end at different places, spectra differ more than canonical
    forms. Landmarks do not count, as no turn of a right hand brings them onto a left one.
    """
    least = min(one.energy for one in found)
    turned = without_landmarks(sides.reflected()._replace(maps=sides.maps[:BEAM]), least)
    return [one for one in turned if least > _clearly(sides, one) * max(one.energy, FLOOR)]


def _clearly(sides: Sides, turned: Candidate) -> float:
    closed, open_ones, elsewhere = _MIRRORED
    if turned.energy >= constants.FEATURES:
        return elsewhere
    return open_ones if sides.partial else closed


def without_landmarks(sides: Sides, most: float = np.inf) -> list[Candidate]:
    """Find the best map from spectra that no landmark draws, if its energy is below the most."""
    unled = sides.unled()
    found = lifted(unled, [one for one in ranked(_proposed(unled))[:1] if one.energy < most])
    missed = functools.partial(missed_landmarks, *sides.at(MEDIUM))
    return [replace(one, missed=missed(*one.registered[:2])) for one in found]


def misleading_landmarks(found: Sequence[Candidate]) -> list[int]:
    """Return the landmarks that the best map agrees with, and one that fits far better does not.

    One is wrong, or two were exchanged: true ones cost no more than maps that are nearly as good.
    Of shapes with few features, little shows.
    """
    first, least = found[0], min(found, key=lambda one: one.energy)
    most = (1 + constants.NEARLY) * max(least.energy, constants.FEATURES)
    wrong = least.missed & ~first.missed & (first.energy > most)
    return [int(row) for row in np.flatnonzero(wrong)]


def _proposed(sides: Sides) -> list[Candidate]:
    found = from_spectra(sides, [])
    return found + _onto_forms(sides, 2 * BEAM) if sides.partial else found


def best(sides: Sides, level: int, found: Sequence[Candidate]) -> list[Candidate]:
    """Rank candidates at a level, without those that lead where a better one does."""
    coarse, areas = sides.target.proxies[COARSE], sides.at(level)[0].areas
    places = np.arange(len(coarse.kept)) if level == COARSE else coarse.parents
    kept: list[Candidate] = []

    def same(one: Registered, other: Registered) -> bool:
        apart = coarse.shape.distances[places[one.forward], places[other.forward]]
        both = areas * (one.source.overlap & other.source.overlap)
        return bool(both @ (apart > constants.LIMB) <= constants.SMALLEST_PART)

    for one in ranked(found):
        if not any(same(one.registered, other.registered) for other in kept):
            kept.append(one)
    return kept


def differences(sides: Sides, ranks: Sequence[Candidate]) -> FloatArray:
    """Geodesic distances (h, n) between where candidates and the first lead each vertex.

    They are of the finer proxies. Whatever has a partner by one of two alone is led to another
    limb, and what the first leaves without partner does not count.
    """
    target, first = sides.target.proxies[COARSE], ranks[0].registered
    images = [target.parents[one.registered.forward] for one in ranks]
    apart = target.shape.distances[images, images[0]]
    given = np.array([one.registered.source.overlap for one in ranks])
    return np.where(given, apart, constants.LIMB) * first.source.overlap


def mean_differences(sides: Sides, first: Candidate, apart: FloatArray) -> FloatArray:
    """Means (h,) of such distances over what the first gives a partner."""
    areas = sides.source.proxies[MEDIUM].shape.areas * first.registered.source.overlap
    return np.asarray(apart @ areas / max(areas.sum(), np.finfo(float).tiny))


def moved_share(sides: Sides, found: Candidate) -> float:
    """Share of what has a partner that a map of a shape to itself leads as far as a limb, or on."""
    coarse = sides.target.proxies[COARSE]
    apart = coarse.shape.distances[coarse.parents, coarse.parents[found.registered.forward]]
    areas = sides.at(MEDIUM)[0].areas * found.registered.source.overlap
    return float(areas @ (apart > constants.LIMB) / max(areas.sum(), np.finfo(float).tiny))


def kept_extremities(sides: Sides, found: Candidate) -> tuple[int, int]:
    """Count extremities that a map of a shape to itself leads near to where they are, and all."""
    extremities = find_extremities(sides.at(MEDIUM)[0])
    images = found.registered.forward[extremities.vertices]
    away = extremities.fields[images, np.arange(len(images))]
    return int((away < constants.LIMB / 2).sum()), len(away)


def distinct(sides: Sides, found: Sequence[Candidate], count: int) -> list[int]:
    """Choose candidates that are not right together with a better one that is chosen."""
    chosen = [0]
    for i in range(1, len(found)):
        if len(chosen) == count:
            break
        ranks = [found[j] for j in (i, *chosen)]
        apart = mean_differences(sides, ranks[0], differences(sides, ranks))
        if (apart[1:] >= constants.ALIKE).all():
            chosen.append(i)
    return chosen


def lifted(sides: Sides, found: Sequence[Candidate]) -> list[Candidate]:
    """Carry candidates from the coarser proxies to the finer ones, and register them there."""
    coarse = sides.source.proxies[COARSE], sides.target.proxies[COARSE]
    starts = [lift(one.registered, *coarse, *sides.at(MEDIUM)) for one in found]
    return registered(sides, MEDIUM, starts, MEDIUM_WEIGHTS)


def registered(
    sides: Sides,
    level: int,
    starts: Sequence[Registered],
    data_weights: tuple[float, ...],
    *,
    resize: bool = True,
) -> list[Candidate]:
    """Register the proxies of a level from every start, in parallel, and score the results."""
    shapes = sides.at(level)
    found = register(*shapes, starts, data_weights, constants.STEPS, resize=resize)
    return run_all(functools.partial(scored, *shapes, one, sides.turned) for one in found)


def from_spectra(sides: Sides, found: list[Candidate]) -> list[Candidate]:
    """Register from alignments of spectral canonical forms in growing dimension."""
    coarse = sides.at(COARSE)
    starts = run_all(functools.partial(rough_start, *coarse, one) for one in sides.maps)
    return registered(sides, COARSE, starts, COARSE_WEIGHTS[-1:])


def from_extremities(sides: Sides, found: list[Candidate]) -> list[Candidate]:
    """Register from the likeliest guesses which extremities correspond.

    Likely are those whose distances deviate little and whose maps explain much: the product of a
    guess's ranks by either decides.
    """
    medium = sides.at(MEDIUM)
    mine, other = run_all(functools.partial(find_extremities, one) for one in medium)
    guesses = guess_limbs(mine, other, 48 * BEAM)
    if not guesses:
        return []
    kept = sides.source.proxies[COARSE].kept, sides.target.proxies[COARSE].kept
    maps = run_all(
        functools.partial(
            limb_maps, mine.taken(one.source, kept[0]), other.taken(one.target, kept[1])
        )
        for one in guesses
    )
    coarse = sides.at(COARSE)
    forward, backward = (np.stack(some, axis=1) for some in zip(*maps, strict=True))
    costs = rough_costs(*coarse, forward, backward).round(constants.DIGITS)
    by_cost = np.argsort(np.argsort(costs, kind="stable"))
    ranks = (1 + by_cost) * [1 + one.rank for one in guesses]
    starts = run_all(
        functools.partial(mapped_start, *coarse, forward[:, i], backward[:, i], guesses[i].size)
        for i in np.argsort(ranks, kind="stable")[: 4 * BEAM]
    )
    begun = best(sides, COARSE, registered(sides, COARSE, starts, COARSE_WEIGHTS[:1], resize=False))
    poses = [one.registered for one in begun[:BEAM]]
    return registered(sides, COARSE, poses, COARSE_WEIGHTS[1:], resize=False)


def from_motions(sides: Sides, found: list[Candidate]) -> list[Candidate]:
    """Register from motions that lay one shape onto the other as they stand."""
    coarse = sides.at(COARSE)
    maps, motions = _motions(coarse, [one.vertices for one in coarse], 12 * BEAM)
    return _narrowed(sides, laid_starts(*coarse, maps, motions), 4 * BEAM)


def from_forms(sides: Sides, found: list[Candidate]) -> list[Candidate]:
    """Register from motions that lay one geodesic canonical form onto the other."""
    return _onto_forms(sides, 6 * BEAM)


def _onto_forms(sides: Sides, count: int) -> list[Candidate]:
    coarse = sides.at(COARSE)
    forms = run_all(functools.partial(getattr, one, "form") for one in coarse)
    maps, motions = _motions(coarse, forms, count)
    starts = run_all(
        functools.partial(mapped_start, *coarse, *both, size, inside=True)
        for both, size in zip(maps, motions.sizes, strict=True)
    )
    return _narrowed(sides, starts, 2 * BEAM)


def _motions(
    shapes: tuple[Shape, Shape], places: Sequence[FloatArray], count: int
) -> tuple[list[tuple[IntArray, IntArray]], Motions]:
    """Find motions that lay one surface, its vertices at places, onto the other, and their maps."""
    mine, other = (one.partial for one in shapes)
    # Of unit area both, a part is larger than the same on a whole; of two parts either may be.
    least = -1.5 * mine / (mine + other)
    sizes = [2 ** (least + step / 2) for step in range(4)]
    ours, theirs = (
        one.as_oriented(where, _SAMPLES) for one, where in zip(shapes, places, strict=True)
    )
    motions = find_motions(ours, theirs, sizes, count, constants.LIMB)
    landmarks = shapes[0].landmarks, shapes[1].landmarks
    if len(landmarks[0]):  # a motion that lays them is rarely among the best
        led = find_motions(ours, theirs, sizes, count, constants.LIMB, landmarks)
        motions = Motions(*(np.concatenate(both) for both in zip(motions, led, strict=True)))
    return laid_maps(ours, theirs, motions), motions


def _narrowed(sides: Sides, poses: Sequence[Registered], keep: int) -> list[Candidate]:
    """Register from the least data weight on, at which shapes hardly bend; most prove wrong."""
    for i, data_weight in enumerate(constants.DATA_WEIGHTS[:5]):
        begun = registered(sides, COARSE, poses, (data_weight,), resize=False)
        found = best(sides, COARSE, begun)[: 2 * BEAM if i else keep]
        poses = [one.registered for one in found]
    return found


def relaxed(sides: Sides, found: list[Candidate]) -> list[Candidate]:
    """Register the best again from small data weights, which let parts slide."""
    starts = [one.registered for one in found[:BEAM]]
    return registered(sides, MEDIUM, starts, constants.DATA_WEIGHTS)


def _make_levels(shape: Shape) -> Levels:
    _ = shape.samples  # what the search asks for, of both shapes at once
    medium = make_proxy(shape, constants.N_VERTICES[MEDIUM])
    return Levels(shape, (make_proxy(medium.shape, constants.N_VERTICES[COARSE]), medium))


def precompute(shape: Shape, data_weights: tuple[float, ...]) -> None:
    """Compute what several threads would otherwise compute several times."""
    _ = shape.normals, shape.position_coefficients, shape.fans
    _ = [shape.system(1.0, length**2) for length in (TURNING, shape.detail)]
    _ = [shape.system(2 * data_weight) for data_weight in data_weights]  # both directions pull


PLAN = [
    Step(COARSE, from_spectra, BEAM),
    Step(COARSE, from_extremities, BEAM),
    Step(COARSE, from_motions, 2 * BEAM, for_parts=True),
    Step(COARSE, from_forms, 2 * BEAM, for_parts=True),
    Step(MEDIUM, relaxed, BEAM, for_parts=True),
]
