"""The exact and the sampled method: from a surface to scaled points."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from contextlib import contextmanager
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

# Vectors in memory for each dimension of an exact form, as measured for 3 to 100 dimensions.
_FORM_COLUMNS = 16

# Points and eigenvalues in n_components + 1 dimensions, if there are so many, and the metric.
Scaled = tuple[FloatArray, FloatArray, Metric]


class Options(NamedTuple):
    """Parameters of both methods."""

    distance: DistanceKind
    n_components: int
    weighting: Weighting
    time: float
    keep_scale: bool
    random_state: int


class Steps:
    """Report the steps of a computation and their times."""

    def __init__(self, progress: Progress | None) -> None:
        self.seconds: dict[str, float] = {}
        self._report = progress or (lambda stage, share: None)

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        self._report(name, 0.0)
        start = clock.perf_counter()
        yield
        self.seconds[name] = clock.perf_counter() - start
        self._report(name, 1.0)


def exact(surface: Surface, options: Options, steps: Steps) -> Scaled:
    """Scale all distances."""
    n, d = surface.n_vertices, options.n_components
    uniform = options.weighting == "uniform"
    if uniform:
        check_memory(surface.mesh.name, n, _FORM_COLUMNS * (d + 1))
    with steps("factorisation"):
        metric = make_metric(options.distance, surface, time=options.time)
    if uniform:
        assert metric.gram is not None  # every distance in SPECTRAL has one
        with steps("scaling"):
            count = min(d + 1, n)
            scaled = exact_scaling(metric.gram, n, count, random_state=options.random_state)
    else:
        with steps("spectrum"):
            spectrum = eigenpairs(surface, min(d + 2, n))
        filtered = spectral_filter(options.distance, spectrum.eigenvalues, options.time)
        scaled = area_scaling(filtered, spectrum.eigenfunctions, spectrum.areas)
    return *scaled, metric


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
    """Scale distances between samples, interpolated: the paper's steps 1 to 8."""
    n = surface.n_vertices
    n_samples, n_eigenpairs = min(n_samples, n), min(n_eigenpairs, n)
    with steps("factorisation"):
        metric = make_metric(options.distance, surface, time=options.time)
    with steps("spectrum"):
        spectrum = eigenpairs(surface, n_eigenpairs)
    with steps("sampling"):
        spreading = metric
        if options.distance in SPECTRAL:  # truncated distances spread samples as well, and faster
            spreading = truncated_metric(options.distance, spectrum, options.time)
        indices, distances = spread_samples(
            spreading.from_sources, n, n_samples, shape_end(spectrum)
        )
        if options.distance in SPECTRAL:
            distances = metric.between(indices)
    with steps("interpolation"), one_blas_thread():
        coefficients = distance_coefficients(
            distances**2, indices, spectrum, mu=mu, interpolation=interpolation
        )
    with steps("scaling"), one_blas_thread():
        functions, areas, count = spectrum.eigenfunctions, spectrum.areas, options.n_components + 1
        scaled = sampled_scaling(coefficients, functions, areas, count, options.weighting)
    return *scaled, metric
