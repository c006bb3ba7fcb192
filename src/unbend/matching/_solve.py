"""The matcher on plain arrays: search, choose, grow, polish."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from unbend._types import FloatArray, IntArray
from unbend.alignment import nearest_pairs
from unbend.matching._kernels import walk
from unbend.matching._registration import register
from unbend.matching._rigidity import orientation_score, rigidity_score
from unbend.matching._search import search
from unbend.matching._shape import Shape
from unbend.matching._zoomout import grow, spectral_weights

_SIZES = (40, 50, 60, 75, 90, 110, 130, 150, 175, 200, 250, 300, 400, 500)
_GROWTH_SAMPLES = 1500
# So many candidates are grown to these sizes, on so many samples, before one is chosen.
_FINALISTS = 8
_TRIAL_SIZES, _TRIAL_SAMPLES = (40, 50, 60), 700
_BLOCK_ROWS = 1024

OnStep = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One functional map and what is known of it.

    Attributes
    ----------
    functional_map : (k, k) ndarray of float64
        Orthogonal; ``source.basis[:, :k] @ functional_map`` corresponds to ``target.basis``.
    rigidity : float
        See `rigidity_score`; lower is better.
    orientation : float
        See `orientation_score`.
    reflected : bool
        Whether the target was taken as its mirror image.
    """

    functional_map: FloatArray
    rigidity: float
    orientation: float
    reflected: bool = False


@dataclass(frozen=True, eq=False)
class Solution:
    """A refined pair of point maps.

    Attributes
    ----------
    source_to_target, target_to_source : ndarrays of int64
    functional_map : (k, k) ndarray of float64
    landing : pair of ndarrays
        Positions of the source's vertices (n, d) and the target's (m, d) that correspond where
        they are close: in one common pose, or in two side by side.
    residual : float
        Root mean square distance of corresponding places, both directions.
    """

    source_to_target: IntArray
    target_to_source: IntArray
    functional_map: FloatArray
    landing: tuple[FloatArray, FloatArray]
    residual: float


def rank(source: Shape, target: Shape, maps: FloatArray, *, reflected: bool) -> list[Candidate]:
    """Order the maps that keep the surface right side out, most rigid first.

    The most rigid few are grown a little and scored again; the mean of both scores tells near
    ties apart. If no map keeps the right side out, all are ranked. With `reflected` the target
    is taken as its mirror image: the first is then the best map that reverses orientation.
    """
    goal = target.reflected() if reflected else target
    turned = [(orientation_score(source, goal, one), one) for one in maps]
    kept = [one for orientation, one in turned if orientation > 0]
    scored = [(rigidity_score(source, goal, one), one) for one in kept or maps]
    ranked = []
    for rigidity, one in sorted(scored, key=lambda pair: pair[0])[:_FINALISTS]:
        grown = _grown(source, target, one, _TRIAL_SIZES, _TRIAL_SAMPLES)
        mean = (rigidity + rigidity_score(source, goal, grown)) / 2
        ranked.append(Candidate(grown, mean, orientation_score(source, goal, grown), reflected))
    return sorted(ranked, key=lambda one: one.rigidity)


def refine(
    source: Shape,
    target: Shape,
    candidate: Candidate,
    *,
    polish: bool = True,
    on_step: OnStep | None = None,
) -> Solution:
    """Bring a candidate to full resolution.

    Parameters
    ----------
    source, target : Shape
    candidate : Candidate
    polish : bool, default=True
        Whether to grow the map to all eigenfunctions and polish it by moving each shape onto the
        other; else the map's nearest neighbours are taken as it stands.
    on_step : callable, optional
        Told the stage's name and the share of it that is done.
    """
    told = on_step or (lambda stage, share: None)
    goal = target.reflected() if candidate.reflected else target
    if not polish:
        maps = dense_maps(source, goal, candidate.functional_map)
        told("refine", 1.0)
        k = len(candidate.functional_map)
        pulled = candidate.functional_map @ goal.position_coefficients[:k]
        smooth = target.basis[:, :k] @ goal.position_coefficients[:k]
        places = source.basis[:, :k] @ pulled, smooth
        return _solution(source, target, *maps, candidate.functional_map, places)
    functional_map = _grown(source, target, candidate.functional_map, _SIZES, _GROWTH_SAMPLES)
    told("refine", 0.4)
    forward, backward = dense_maps(source, goal, functional_map)
    found = register(source, goal, functional_map, forward, backward)
    told("refine", 1.0)
    places = found.source_places, found.target_places
    return _solution(source, target, *found[:2], functional_map, places)


def _solution(
    source: Shape,
    target: Shape,
    forward: IntArray,
    backward: IntArray,
    functional_map: FloatArray,
    places: tuple[FloatArray, FloatArray],
) -> Solution:
    ahead = source.areas @ ((places[0] - places[1][forward]) ** 2).sum(axis=1)
    back = target.areas @ ((places[1] - places[0][backward]) ** 2).sum(axis=1)
    residual = float(np.sqrt((ahead + back) / 2))
    return Solution(forward, backward, functional_map, places, residual)


def _grown(
    source: Shape, target: Shape, start: FloatArray, sizes: Sequence[int], count: int
) -> FloatArray:
    smallest, largest = len(start), min(source.k, target.k)
    wanted = sorted({min(k, largest) for k in sizes if k > smallest})
    functional_map, _ = grow(
        (source.eigenvalues, source.basis[source.samples[:count]]),
        (target.eigenvalues, target.basis[target.samples[:count]]),
        start,
        wanted,
    )
    return functional_map


def dense_maps(
    source: Shape, target: Shape, functional_map: FloatArray
) -> tuple[IntArray, IntArray]:
    """Nearest neighbours of all vertices, both ways, under a functional map.

    Every vertex is compared with the samples of the other shape, and walks from the nearest of
    them over the mesh: n log n work where comparing all pairs would be n^2.
    """
    k = len(functional_map)
    weights = spectral_weights(source.eigenvalues, target.eigenvalues, k)
    left = source.basis[:, :k] @ functional_map * weights
    right = target.basis[:, :k] * weights
    ours = source.spokes.indptr, source.spokes.indices
    theirs = target.spokes.indptr, target.spokes.indices
    forward = target.samples[_nearest(left, right[target.samples])]
    backward = source.samples[_nearest(right, left[source.samples])]
    for _ in range(2):
        forward = walk(left, right, forward, *ours, *theirs)
        backward = walk(right, left, backward, *theirs, *ours)
    return forward, backward


def point_residual(source: Shape, target: Shape, functional_map: FloatArray) -> float:
    """Symmetric residual of a functional map over the samples, 0 to about 1."""
    k = len(functional_map)
    weights = spectral_weights(source.eigenvalues, target.eigenvalues, k)
    left = source.basis[source.samples[:_GROWTH_SAMPLES], :k] @ functional_map * weights
    right = target.basis[target.samples[:_GROWTH_SAMPLES], :k] * weights
    return float(nearest_pairs(left[None], right).residual[0])


def candidates(
    source: Shape, target: Shape, on_step: OnStep | None = None
) -> tuple[list[Candidate], FloatArray]:
    """Search, and rank what was found under the rule that orientation is kept."""
    step = None if on_step is None else lambda share: on_step("search", share)
    maps = search(source, target, on_step=step)
    return rank(source, target, maps, reflected=False), maps


def _nearest(points: FloatArray, among: FloatArray) -> IntArray:
    left = points.astype(np.float32)
    right = among.astype(np.float32)
    norms = (right**2).sum(axis=1)
    result = np.empty(len(left), dtype=np.int64)
    for i in range(0, len(left), _BLOCK_ROWS):
        block = slice(i, i + _BLOCK_ROWS)
        result[block] = np.argmin(norms - 2 * left[block] @ right.T, axis=1)
    return result
