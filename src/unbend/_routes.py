"""The ways from a surface to its canonical form: exact, through two levels, or sampled."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from unbend._types import FloatArray
from unbend.choices import DistanceKind, Interpolation, Weighting
from unbend.coarsening import aggregate_vertices
from unbend.distances import Metric, make_metric
from unbend.distances.gram import SPECTRAL, gram_metric, spectral_filter, truncated_metric
from unbend.errors import InputError
from unbend.interpolation import distance_coefficients
from unbend.linalg.two_level import two_level_green_operator
from unbend.mds import area_scaling, exact_scaling, sampled_scaling
from unbend.memory import check_memory
from unbend.sampling import shape_end, spread_samples
from unbend.spectra import eigenpairs
from unbend.surface import Surface

# Residuals of the two-level route: of a solve, and of the form's eigenpairs.
_SOLVED, RESIDUAL = 1e-8, 1e-6
# Columns of its vectors that are there at a time.
_COLUMNS = 64


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
    max_vertices: int | None


class Scaled(NamedTuple):
    """Points (n, d), their eigenvalues, and the distances that they stand for."""

    points: FloatArray
    eigenvalues: FloatArray
    metric: Metric


class Steps:
    """Names and times the steps of a computation."""

    def __init__(self, progress: Callable[[str], None] | None) -> None:
        self.seconds: dict[str, float] = {}
        self._progress = progress

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        if self._progress is not None:
            self._progress(name)
        start = clock.perf_counter()
        yield
        self.seconds[name] = clock.perf_counter() - start


def exact(surface: Surface, options: Options, steps: Steps) -> Scaled:
    """Scale all distances through their operator."""
    with steps("factorisation"):
        metric = make_metric(options.distance, surface, time=options.time)
    if options.weighting == "uniform":
        assert metric.gram is not None  # every distance in SPECTRAL has one
        with steps("scaling"):
            return Scaled(
                *exact_scaling(
                    metric.gram,
                    surface.n_vertices,
                    options.n_components,
                    random_state=options.random_state,
                ),
                metric,
            )
    with steps("spectrum"):
        spectrum = eigenpairs(surface, options.n_components + 1, cache=options.cache)
    filtered = spectral_filter(options.distance, spectrum.eigenvalues, options.time)
    return Scaled(*area_scaling(filtered, spectrum.eigenfunctions, spectrum.areas), metric)


def two_level(surface: Surface, options: Options, steps: Steps) -> Scaled:
    """Do the same without a factor of the whole: a coarse mesh starts and preconditions."""
    if options.distance not in ("biharmonic", "commute-time") or options.weighting != "uniform":
        raise InputError(
            "max_vertices is for exact biharmonic and commute-time forms with uniform weights; "
            "reduce the mesh for others"
        )
    n_coarse = options.max_vertices
    assert n_coarse is not None  # or this way would not be taken
    check_memory(surface.mesh.name, surface.n_vertices, _COLUMNS, n_coarse=n_coarse)
    with steps("coarsening"):
        aggregates = aggregate_vertices(surface.mesh, n_coarse)
    with steps("factorisation"):
        operator = surface.operator
        green, rough = two_level_green_operator(
            operator.stiffness, operator.areas, aggregates, _SOLVED
        )
        metric = gram_metric(options.distance, surface, options.time, green)
        start = rough(options.n_components + 3)
    assert metric.gram is not None
    with steps("scaling"):
        return Scaled(
            *exact_scaling(
                metric.gram, surface.n_vertices, options.n_components, tol=RESIDUAL, start=start
            ),
            metric,
        )


def sampled(surface: Surface, options: Options, steps: Steps) -> Scaled:
    """Follow the paper: steps 1 to 8."""
    n = surface.n_vertices
    n_samples, n_eigenpairs = min(options.n_samples, n), min(options.n_eigenpairs, n)
    with steps("factorisation"):
        metric = make_metric(options.distance, surface, time=options.time)
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
    with steps("interpolation"):
        coefficients = distance_coefficients(
            distances**2,
            samples.indices,
            spectrum,
            mu=options.mu,
            interpolation=options.interpolation,
        )
    with steps("scaling"):
        return Scaled(
            *sampled_scaling(
                coefficients,
                spectrum.eigenfunctions,
                spectrum.areas,
                options.n_components,
                options.weighting,
            ),
            metric,
        )
