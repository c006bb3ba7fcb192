"""The ways from a surface to its canonical form: exact, through two levels, or sampled."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple

import numpy as np

from unbend._memory import check_memory
from unbend._parallel import one_blas_thread
from unbend._types import FloatArray, Progress
from unbend.canonical._interpolation import distance_coefficients
from unbend.canonical._mds import area_scaling, exact_scaling, refined_scaling, sampled_scaling
from unbend.canonical._sampling import shape_end, spread_samples
from unbend.choices import DistanceKind, Interpolation, Weighting
from unbend.distances import (
    SPECTRAL,
    Metric,
    gram_metric,
    make_metric,
    spectral_filter,
    truncated_metric,
)
from unbend.linalg.two_level import two_levels
from unbend.mesh import aggregate_vertices
from unbend.spectral import Surface, eigenpairs

# Residuals that the two-level route ends at: of the form's eigenpairs, and of the solves that its
# stress is taken from.
_RESIDUAL, _FOR_STRESS = 1e-6, 1e-4
# Vectors it works on beyond the form's dimension, and for its stress at a time; columns of vectors
# that are there at a time.
_MORE, _NARROW, _COLUMNS = 5, 8, 64
# The same of an exact form, for each of its dimensions and one more. Measured for 3 to 100.
_FORM_COLUMNS = 16


@dataclass(frozen=True)
class Options:
    """What :func:`unbend.canonical_form` was asked for."""

    distance: DistanceKind
    n_components: int
    weighting: Weighting
    n_eigenpairs: int
    n_samples: int
    mu: float
    interpolation: Interpolation
    time: float
    random_state: int
    cache: bool
    n_coarse: int | None


class Scaled(NamedTuple):
    """Points (n, d), their eigenvalues, and the distances that they stand for.

    One eigenvalue more than was asked for shows whether it equals the last; a column of points may
    come with it. The residual is that of the eigenpairs where a two-level solver was used.
    """

    points: FloatArray
    eigenvalues: FloatArray
    metric: Metric
    residual: float | None = None


class Steps:
    """Names and times the steps of a computation."""

    def __init__(self, progress: Progress | None) -> None:
        self.seconds: dict[str, float] = {}
        self._progress = progress

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        told = self._progress or (lambda stage, share: None)
        told(name, 0.0)
        start = clock.perf_counter()
        yield
        self.seconds[name] = clock.perf_counter() - start
        told(name, 1.0)


def exact(surface: Surface, options: Options, steps: Steps) -> Scaled:
    """Scale all distances through their operator."""
    if options.weighting == "uniform":  # the basis of the largest eigenpairs grows with them
        columns = _FORM_COLUMNS * (options.n_components + 1)
        check_memory(surface.mesh.name, surface.n_vertices, columns)
    with steps("factorisation"):
        metric = make_metric(options.distance, surface, time=options.time, cache=options.cache)
    if options.weighting == "uniform":
        assert metric.gram is not None  # every distance in SPECTRAL has one
        with steps("scaling"):
            return Scaled(
                *exact_scaling(
                    metric.gram,
                    surface.n_vertices,
                    min(options.n_components + 1, surface.n_vertices),
                    random_state=options.random_state,
                ),
                metric,
            )
    with steps("spectrum"):
        k = min(options.n_components + 2, surface.n_vertices)
        spectrum = eigenpairs(surface, k, cache=options.cache)
    filtered = spectral_filter(options.distance, spectrum.eigenvalues, options.time)
    return Scaled(*area_scaling(filtered, spectrum.eigenfunctions, spectrum.areas), metric)


def two_level(surface: Surface, options: Options, steps: Steps) -> Scaled:
    """Do the same without a factor of the whole: a coarse mesh starts and preconditions."""
    n_coarse = options.n_coarse
    assert n_coarse is not None  # or this way would not be taken
    check_memory(surface.mesh.name, surface.n_vertices, _COLUMNS, n_coarse=n_coarse)
    with steps("coarsening"):
        aggregates = aggregate_vertices(surface.mesh, n_coarse)
    with steps("factorisation"):
        stiffness, areas = surface.operator.stiffness, surface.operator.areas
        green, rough = two_levels(stiffness, areas, aggregates)
        start = rough(options.n_components + _MORE)
    weights = [areas[:, None], None] if options.distance == "biharmonic" else [None]

    def solves(
        block: FloatArray, guesses: Sequence[FloatArray | None], tol: float
    ) -> list[FloatArray]:
        images = []
        block = block - block.mean(axis=0)
        for weight, guess in zip(weights, guesses, strict=False):
            images.append(green(block, guess, tol))
            block = images[-1] if weight is None else images[-1] * weight
        images[-1] -= images[-1].mean(axis=0)
        return images

    with steps("scaling"):
        points, eigenvalues, residual = refined_scaling(
            solves, start, options.n_components, tol=_RESIDUAL
        )
    lock = Lock()

    def sparing(rhs: FloatArray) -> FloatArray:
        # Each solve is spread over threads already, and a second one would double the memory.
        solution = np.empty_like(rhs)
        with lock:
            for first in range(0, rhs.shape[1], _NARROW):
                part = slice(first, first + _NARROW)
                solution[:, part] = green(np.ascontiguousarray(rhs[:, part]), tol=_FOR_STRESS)
        return solution

    metric = gram_metric(options.distance, surface, options.time, sparing)
    return Scaled(points, eigenvalues, metric, residual)


def sampled(surface: Surface, options: Options, steps: Steps) -> Scaled:
    """Follow the paper: steps 1 to 8."""
    n = surface.n_vertices
    n_samples, n_eigenpairs = min(options.n_samples, n), min(options.n_eigenpairs, n)
    with steps("factorisation"):
        metric = make_metric(options.distance, surface, time=options.time, cache=options.cache)
    with steps("spectrum"):
        spectrum = eigenpairs(surface, n_eigenpairs, cache=options.cache)
    with steps("sampling"):
        start = shape_end(spectrum)
        if options.distance in SPECTRAL:
            # Truncated distances are as good for spreading samples, and cost next to nothing.
            rough = truncated_metric(options.distance, spectrum, options.time)
            samples = spread_samples(rough.from_sources, n, n_samples, start)
            distances = metric.between(samples.indices)
        else:
            samples = spread_samples(metric.from_sources, n, n_samples, start)
            distances = samples.distances
    with steps("interpolation"), one_blas_thread():
        coefficients = distance_coefficients(
            distances**2,
            samples.indices,
            spectrum,
            mu=options.mu,
            interpolation=options.interpolation,
        )
    with steps("scaling"), one_blas_thread():
        return Scaled(
            *sampled_scaling(
                coefficients,
                spectrum.eigenfunctions,
                spectrum.areas,
                options.n_components + 1,
                options.weighting,
            ),
            metric,
        )
