"""Canonical forms: pose-invariant versions of a shape."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple, get_args

import numpy as np

from unbend._arrays import check_choice, check_whole
from unbend._display import Brief, table
from unbend._memory import check_memory
from unbend._parallel import one_blas_thread
from unbend._types import FloatArray, Progress
from unbend.canonical._interpolation import distance_coefficients
from unbend.canonical._mds import area_scaling, exact_scaling, sampled_scaling
from unbend.canonical._quality import check_axes, eigenvalue_notes, stress_of
from unbend.canonical._sampling import shape_end, spread_samples
from unbend.choices import DistanceKind, Interpolation, LaplacianKind, Weighting
from unbend.distances import (
    GEODESIC,
    Metric,
    diffusion_time,
    length_power,
    make_metric,
    spectral_filter,
    truncated_metric,
)
from unbend.errors import InputError, warn
from unbend.io import MeshLike
from unbend.spectral import Surface, eigenpairs, make_surface

# Vectors in memory for each dimension of an exact form, as measured for 3 to 100 dimensions.
_FORM_COLUMNS = 16
# Eigenvalues that differ by at most this share count as equal. Input in single precision splits
# double eigenvalues by less than the first; samples split most by less than the second.
_EQUAL = {"exact": 1e-6, "sampled": 5e-4}

_Scaled = tuple[FloatArray, FloatArray]  # points and eigenvalues in d + 1 dimensions, or d


@dataclass(frozen=True, eq=False, repr=False)
class CanonicalForm(Brief):
    """A shape's canonical form and how it was made.

    Attributes
    ----------
    points : (n, d) ndarray of float64
        One row per vertex of the input, in its order; NaN where a vertex is not part of the
        surface. In the distance's unit at area 1, or with `keep_scale` on the input.
    eigenvalues : (d,) ndarray of float64
        Of the Gram matrix, descending: the squared norm of each column of `points`, vertices
        weighted by 1 or by their share of the area. A negative one has a column of zeros: the
        distances are not Euclidean.
    stress : float
        ``sqrt(sum (d_ij - |x_i - x_j|)^2 / sum d_ij^2)`` over all pairs of 32 random vertices with
        exact distances d: 0 for a perfect embedding. Other vertices may give a third more or less.
    distance, method, weighting, laplacian : str
        What was used, never ``"auto"``; `method` is ``"exact"`` or ``"sampled"``.
    time : float or None
        Of diffusion distances.
    area : float
        Of the input, in its own squared units of length.
    notes : tuple of str
        Changes to the input and warnings about the form, a sentence each.
    seconds : dict of str to float
        Wall time of each step.
    """

    points: FloatArray
    eigenvalues: FloatArray
    stress: float
    distance: str
    method: str
    weighting: str
    laplacian: str
    time: float | None
    area: float
    notes: tuple[str, ...]
    seconds: dict[str, float]

    def _repr_html_(self) -> str:
        n, d = self.points.shape
        rows = [
            ("canonical form", f"{n:,} points in {d} dimensions"),
            ("distance", f"{self.distance}, {self.method}, {self.weighting} weights"),
            ("eigenvalues", ", ".join(f"{value:.4g}" for value in self.eigenvalues[:8])),
            ("stress", f"{self.stress:.3f}"),
            ("notes", "; ".join(self.notes) or "none"),
        ]
        return table(rows)


def canonical_form(
    mesh: MeshLike,
    *,
    n_components: int = 3,
    distance: DistanceKind = "biharmonic",
    weighting: Weighting = "uniform",
    time: float | None = None,
    laplacian: LaplacianKind = "auto",
    component: str | int | None = None,
    keep_scale: bool = False,
    random_state: int = 0,
    progress: Progress | None = None,
) -> CanonicalForm:
    """Embed a surface in Euclidean space so that straight distances approximate intrinsic ones.

    Poses of one shape have nearly the same intrinsic distances, hence nearly the same form, up to
    a rotation or reflection. This form is exact: it scales all n^2 distances, through an operator.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts. It is scaled to unit area inside.
    n_components : int, default=3
        Dimension d of the form.
    distance : {"biharmonic", "commute-time", "diffusion"}, default="biharmonic"
        See :func:`unbend.distance`. For geodesic distances use
        :func:`unbend.sampled_canonical_form`.
    weighting : {"uniform", "area"}, default="uniform"
        Whether each vertex counts equally (as in the paper), or by its area; then the form does not
        depend on how densely a region is meshed.
    time : float, optional
        Diffusion time of the diffusion distance, in units of the area; 0.1 by default.
    laplacian : {"auto", "cotangent", "robust"}, default="auto"
        See :func:`unbend.laplacian`.
    component : "largest" or int, optional
        Which of several components, counted from 0, the largest.
    keep_scale : bool, default=False
        Return the form in the distance's unit on the input, not at unit area.
    random_state : int, default=0
        Random seed of the vertices for the stress, and of the solver's first vectors.
    progress : callable, optional
        Called with a step's name and its share done, 0 to 1.

    Returns
    -------
    CanonicalForm

    Raises
    ------
    InputError
        If a name or number is out of range, or the distance has no exact form or no diffusion time.
    MeshError
        If the mesh cannot be used (the message names the vertex or face), or the form does not fit
        into free memory.
    SolverError
        If an eigenpair does not reach its accuracy, or the form is not centred on its axes.

    Warns
    -----
    UnbendWarning
        If a change to the input affects the result; or if the last eigenvalue nearly equals the
        first one left out, as on symmetric shapes: then the form depends on the vertices' order.

    References
    ----------
    Yang, Obaseki and Chen, "Spectral multi-dimensional scaling using biharmonic distance",
    GRAPP 2019.

    Examples
    --------
    >>> from unbend import canonical_form
    >>> from unbend.datasets import make_sphere
    >>> form = canonical_form(make_sphere(2))
    >>> form.points.shape, form.method
    ((162, 3), 'exact')
    """
    if distance in GEODESIC:
        raise InputError(f"the {distance} distance has no exact form; use sampled_canonical_form")
    time = diffusion_time(distance, time)
    options = _Options("exact", distance, n_components, weighting, time, keep_scale, random_state)
    return _form(mesh, options, laplacian, component, progress)


def sampled_canonical_form(
    mesh: MeshLike,
    *,
    n_components: int = 3,
    distance: DistanceKind = "biharmonic",
    n_samples: int = 200,
    n_eigenpairs: int = 100,
    mu: float = 1e4,
    interpolation: Interpolation = "projection",
    weighting: Weighting = "uniform",
    time: float | None = None,
    laplacian: LaplacianKind = "auto",
    component: str | int | None = None,
    keep_scale: bool = False,
    random_state: int = 0,
    progress: Progress | None = None,
) -> CanonicalForm:
    """Embed a surface like :func:`canonical_form`, from samples as in the paper.

    Squared distances between sampled vertices are interpolated by eigenfunctions of the Laplacian.
    This takes any distance, and is approximate.

    Parameters
    ----------
    distance : str, default="biharmonic"
        Any that :func:`unbend.distance` takes.
    n_samples, n_eigenpairs : int, default=200, 100
        Number of sampled vertices and of eigenfunctions, limited by the number of vertices.
    mu : float, default=1e4
        Weight of the samples against smoothness.
    interpolation : {"projection", "least-squares"}, default="projection"
        Eq. 15 or Eq. 14 of the paper.
    mesh, n_components, weighting, time, laplacian, component, keep_scale, random_state, progress
        See :func:`canonical_form`.

    Returns
    -------
    CanonicalForm

    Raises
    ------
    InputError, MeshError, SolverError
        See :func:`canonical_form`.

    Warns
    -----
    UnbendWarning
        See :func:`canonical_form`; and if an eigenvalue is negative, which geodesic distances may
        have.

    References
    ----------
    Yang, Obaseki and Chen, "Spectral multi-dimensional scaling using biharmonic distance",
    GRAPP 2019. Aflalo and Kimmel, "Spectral multidimensional scaling", PNAS 110(45), 2013.

    Examples
    --------
    >>> from unbend import sampled_canonical_form
    >>> from unbend.datasets import make_sphere
    >>> form = sampled_canonical_form(make_sphere(2), distance="geodesic", n_samples=50)
    >>> form.points.shape, form.method
    ((162, 3), 'sampled')
    """
    time = diffusion_time(distance, time)
    n_samples = check_whole(n_samples, "n_samples", 2)
    n_eigenpairs = check_whole(n_eigenpairs, "n_eigenpairs", 2)
    options = _Options("sampled", distance, n_components, weighting, time, keep_scale, random_state)
    options = options._replace(
        n_samples=n_samples, n_eigenpairs=n_eigenpairs, mu=mu, interpolation=interpolation
    )
    return _form(mesh, options, laplacian, component, progress)


class _Options(NamedTuple):
    """Parameters of both methods, then those of the sampled one."""

    method: str
    distance: DistanceKind
    n_components: int
    weighting: Weighting
    time: float
    keep_scale: bool
    random_state: int
    n_samples: int = 0
    n_eigenpairs: int = 0
    mu: float = 0.0
    interpolation: Interpolation = "projection"


class _Steps:
    """Report the steps of a computation and their times."""

    def __init__(self, progress: Progress | None) -> None:
        self.seconds: dict[str, float] = {}
        self._report = progress or (lambda stage, share: None)

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        self._report(name, 0.0)
        start = perf_counter()
        yield
        self.seconds[name] = perf_counter() - start
        self._report(name, 1.0)


def _form(
    mesh: MeshLike,
    options: _Options,
    laplacian: LaplacianKind,
    component: str | int | None,
    progress: Progress | None,
) -> CanonicalForm:
    method = options.method
    check_whole(options.random_state, "random_state")
    check_choice(options.weighting, "weighting", get_args(Weighting))
    steps = _Steps(progress)
    with steps("laplacian"):
        surface = make_surface(mesh, laplacian=laplacian, component=component)
    most = surface.n_vertices
    if method == "sampled":  # p samples span p - 1 dimensions; an eigenfunction is constant
        most = min(most, options.n_samples, options.n_eigenpairs)
    d = check_whole(options.n_components, "the form's dimension", 1, most - 1)
    options = options._replace(n_components=d)
    if method == "exact" and options.weighting == "uniform":
        check_memory(surface.mesh.name, surface.n_vertices, _FORM_COLUMNS * (d + 1))
    with steps("factorisation"):
        metric = make_metric(options.distance, surface, time=options.time)
    scale = _exact if method == "exact" else _sampled
    points, values = scale(surface, metric, options, steps)
    points = points[:, :d].copy()
    by_area = options.weighting == "area"
    weights = surface.operator.areas if by_area else np.ones(len(points))
    check_axes(points, values[:d], weights, surface.mesh.name)
    with steps("stress"):
        stress = stress_of(points, metric, options.random_state)
    if options.keep_scale:
        unit = surface.area ** (length_power(options.distance) / 2)
        points, values = points * unit, values * unit**2
    notes = eigenvalue_notes(values, d, _EQUAL[method])
    for note in notes:
        warn(f"{surface.mesh.name}: {note}")
    return CanonicalForm(
        points=surface.prepared.expand(points),
        eigenvalues=values[:d],
        stress=stress,
        distance=options.distance,
        method=method,
        weighting=options.weighting,
        laplacian=surface.operator.kind,
        time=options.time if options.distance == "diffusion" else None,
        area=surface.area,
        notes=surface.prepared.notes + notes,
        seconds=steps.seconds,
    )


def _exact(surface: Surface, metric: Metric, options: _Options, steps: _Steps) -> _Scaled:
    """Scale all distances."""
    n, d = surface.n_vertices, options.n_components
    if options.weighting == "uniform":
        assert metric.gram is not None  # every spectral distance has one
        with steps("scaling"):
            return exact_scaling(metric.gram, n, d + 1, options.random_state)
    with steps("spectrum"):
        spectrum = eigenpairs(surface, min(d + 2, n))
    filtered = spectral_filter(options.distance, spectrum.eigenvalues, options.time)
    return area_scaling(filtered, spectrum.eigenfunctions, spectrum.areas)


def _sampled(surface: Surface, metric: Metric, options: _Options, steps: _Steps) -> _Scaled:
    """Scale distances between samples, interpolated: the paper's steps 1 to 8."""
    n, kind = surface.n_vertices, options.distance
    with steps("spectrum"):
        spectrum = eigenpairs(surface, min(options.n_eigenpairs, n))
    with steps("sampling"):
        # Truncated distances spread samples as well as whole ones, and faster.
        rough = metric if kind in GEODESIC else truncated_metric(kind, spectrum, options.time)
        samples, distances = spread_samples(
            rough.from_sources, n, min(options.n_samples, n), shape_end(spectrum)
        )
        if rough is not metric:
            distances = metric.between(samples)
    with steps("interpolation"), one_blas_thread():
        coefficients = distance_coefficients(
            distances**2, samples, spectrum, mu=options.mu, interpolation=options.interpolation
        )
    with steps("scaling"), one_blas_thread():
        return sampled_scaling(coefficients, spectrum, options.n_components + 1, options.weighting)
