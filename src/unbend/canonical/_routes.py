"""The two ways from a surface to its canonical form: exact and sampled."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from unbend._memory import check_memory
from unbend._parallel import one_blas_thread
from unbend._types import FloatArray, Progress
from unbend.canonical._interpolation import distance_coefficients
from unbend.canonical._mds import area_scaling, exact_scaling, sampled_scaling
from unbend.canonical._sampling import shape_end, spread_samples
from unbend.choices import DistanceKind, Interpolation, Weighting
from unbend.distances import SPECTRAL, Metric, make_metric, spectral_filter, truncated_metric
from unbend.spectral import Surface, eigenpairs

# Columns of vectors that an exact form keeps at once, for each of its dimensions and one more.
# Measured for 3 to 100 dimensions.
_FORM_COLUMNS = 16


@dataclass(frozen=True)
class Options:
    """What both kinds of canonical forms are asked for."""

    distance: DistanceKind
    n_components: int
    weighting: Weighting
    time: float
    keep_scale: bool
    random_state: int


class Scaled(NamedTuple):
    """Points (n, d), their eigenvalues, and the distances that they stand for.

    One eigenvalue more than was asked for shows whether it equals the last; a column of points may
    come with it.
    """

    points: FloatArray
    eigenvalues: FloatArray
    metric: Metric


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
        metric = make_metric(options.distance, surface, time=options.time)
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
        spectrum = eigenpairs(surface, k)
    filtered = spectral_filter(options.distance, spectrum.eigenvalues, options.time)
    return Scaled(*area_scaling(filtered, spectrum.eigenfunctions, spectrum.areas), metric)


def sampled(
    surface: Surface,
    options: Options,
    steps: Steps,
    *,
    n_samples: int,
    n_eigenpairs: int,
    mu: float,
    interpolation: Interpolation,
) -> Scaled:
    """Follow the paper: steps 1 to 8."""
    n = surface.n_vertices
    n_samples, n_eigenpairs = min(n_samples, n), min(n_eigenpairs, n)
    with steps("factorisation"):
        metric = make_metric(options.distance, surface, time=options.time)
    with steps("spectrum"):
        spectrum = eigenpairs(surface, n_eigenpairs)
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
            mu=mu,
            interpolation=interpolation,
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
