"""The matcher on plain arrays: search, choose, grow, polish."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from unbend._kernels import walk
from unbend._types import FloatArray, IntArray
from unbend.matching._registration import register
from unbend.matching._rigidity import orientation_score, rigidity_score
from unbend.matching._search import search
from unbend.matching._shape import Shape
from unbend.refinement import grow, nearest_pairs, spectral_weights

_SIZES = (40, 50, 60, 75, 90, 110, 130, 150, 175, 200, 250, 300, 400, 500)
_GROWTH_SAMPLES = 1500
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
    """A refined pair of point maps, and the deformed source when there is one."""

    source_to_target: IntArray
    target_to_source: IntArray
    functional_map: FloatArray
    posed: FloatArray | None


def rank(source: Shape, target: Shape, maps: FloatArray, *, reflected: bool) -> list[Candidate]:
    """Order the maps that keep the surface right side out, most rigid first.

    If there are none, all are ranked. With `reflected` the target is taken as its mirror image:
    the first is then the best map that reverses orientation.
    """
    goal = target.reflected() if reflected else target
    turned = [(orientation_score(source, goal, one), one) for one in maps]
    kept = [(orientation, one) for orientation, one in turned if orientation > 0]
    ranked = [
        Candidate(one, rigidity_score(source, goal, one), orientation, reflected)
        for orientation, one in kept or turned
    ]
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
        Whether to grow the map to all eigenfunctions and polish it by a registration; else its
        nearest neighbours are taken as it stands.
    on_step : callable, optional
        Told the stage's name and the share of it that is done.
    """
    functional_map = candidate.functional_map
    goal = target.reflected() if candidate.reflected else target
    if polish:
        largest = min(source.k, target.k)
        sizes = sorted({*(k for k in _SIZES if len(functional_map) < k < largest), largest})
        ours, theirs = source.samples[:_GROWTH_SAMPLES], target.samples[:_GROWTH_SAMPLES]
        functional_map, _ = grow(
            (source.eigenvalues, source.basis[ours]),
            (target.eigenvalues, target.basis[theirs]),
            functional_map,
            sizes,
        )
    forward, backward = dense_maps(source, goal, functional_map)
    if on_step is not None:
        on_step("refine", 0.5 if polish else 1.0)
    if not polish:
        return Solution(forward, backward, functional_map, None)
    forward, backward, posed = register(source, goal, functional_map, forward, backward)
    if on_step is not None:
        on_step("refine", 1.0)
    return Solution(forward, backward, functional_map, posed)


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
