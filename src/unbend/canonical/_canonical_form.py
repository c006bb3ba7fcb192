"""Canonical forms: a shape unbent, so that its poses look alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from unbend._arrays import is_whole
from unbend._display import Brief, table
from unbend._types import FloatArray, Progress
from unbend.canonical._routes import Options, Scaled, Steps, exact, sampled
from unbend.choices import DistanceKind, Interpolation, LaplacianKind, Weighting
from unbend.distances import SPECTRAL, Metric, check_kind, diffusion_time, length_power
from unbend.errors import InputError, SolverError, warn
from unbend.io import MeshLike
from unbend.spectral import Surface, make_surface

# Stress is taken over all pairs of this many random vertices.
_STRESS_VERTICES = 32
# By how much columns may miss their lengths, right angles and the middle, as a share of the largest
# eigenvalue.
_SKEW = 1e-6
# Eigenvalues that differ by at most this share count as equal. Input in single precision splits a
# double eigenvalue by less than the first, samples mostly by less than the second.
_EQUAL = {"exact": 1e-6, "sampled": 5e-4}


@dataclass(frozen=True, eq=False, repr=False)
class CanonicalForm(Brief):
    """A shape's canonical form and how it was made.

    Attributes
    ----------
    points : (n, d) ndarray of float64
        One row per vertex of the input, in its order; NaN where a vertex is not part of the
        surface. In units of the square root of the area, unless the scale was kept.
    eigenvalues : (d,) ndarray of float64
        Of the Gram matrix, descending: the squared norm of each column of `points`, uniform
        or by area as the weighting says. A negative one (the distances are not Euclidean)
        belongs to a column of zeros.
    stress : float
        ``sqrt(sum (d_ij - |x_i - x_j|)^2 / sum d_ij^2)`` over all pairs of 32 random vertices, d
        being the exact distance: 0 for a perfect embedding.
    distance, method, weighting, laplacian : str
        What was used; `method` is ``"exact"`` or ``"sampled"``, and none is ``"auto"``.
    area : float
        Area of the input, in its own squared units of length.
    notes : tuple of str
        What was done to the input, a sentence each.
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
            ("done to the input", "; ".join(self.notes) or "nothing"),
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
    """Embed a surface in Euclidean space so that straight distances are its intrinsic ones.

    Poses of one shape have nearly the same intrinsic distances, hence nearly the same
    canonical form, up to a rotation or reflection. This form is exact: classical scaling of all
    n^2 distances, through an operator.

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
        Whether each vertex counts the same (the paper's), or by its area, which makes the form
        independent of how densely a region is meshed.
    time : float, optional
        Diffusion time of the diffusion distance, in units of the area; 0.1 by default.
    laplacian : {"auto", "cotangent", "robust"}, default="auto"
        See :func:`unbend.laplacian`.
    component : "largest" or int, optional
        Which component of a mesh that has several, 0 being the largest.
    keep_scale : bool, default=False
        Return the form in the unit that the distance has on the input, not at unit area.
    random_state : int, default=0
        Seed of the vertices that the stress is taken over, and of the solver's first vectors.
    progress : callable, optional
        Called with a step's name and the share of it that is done, 0 to 1.

    Returns
    -------
    CanonicalForm

    Raises
    ------
    InputError
        If a name or number is out of range, or the distance has no exact form or no diffusion time.
    MeshError
        If the mesh cannot be used; the message names the vertex or face. If its computation does
        not fit into the memory that is free.
    SolverError
        If an eigenpair does not reach its accuracy, or the form is not centred on its axes.

    Warns
    -----
    UnbendWarning
        If something was done to the input that the result shows, or the last eigenvalue nearly
        equals the next, which the form leaves out: then it depends on the order of the vertices.
        Symmetric shapes have such multiple eigenvalues.

    See Also
    --------
    unbend.lay_into_pose : The surface itself in the pose of its form.

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
    check_kind(distance)
    if distance not in SPECTRAL:
        raise InputError(
            f"the {distance} distance has no exact form; use sampled_canonical_form, or on the "
            "command line --method sampled"
        )
    time = diffusion_time(distance, time)
    options = Options(distance, n_components, weighting, time, keep_scale, random_state)
    return _form(mesh, exact, "exact", options, laplacian, component, progress)


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
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts. It is scaled to unit area inside.
    n_components : int, default=3
        Dimension d of the form.
    distance : str, default="biharmonic"
        ``"biharmonic"``, ``"commute-time"``, ``"diffusion"``, ``"geodesic"`` or
        ``"geodesic-exact"``; see :func:`unbend.distance`.
    n_samples, n_eigenpairs : int, default=200, 100
        Number of sampled vertices and of eigenfunctions; no more than there are vertices are used.
    mu : float, default=1e4
        Weight of the samples against smoothness.
    interpolation : {"projection", "least-squares"}, default="projection"
        Eq. 15 or Eq. 14 of the paper.
    weighting, time, laplacian, component, keep_scale, progress
        See :func:`canonical_form`.
    random_state : int, default=0
        Seed of the vertices that the stress is taken over.

    Returns
    -------
    CanonicalForm

    Raises
    ------
    InputError
        If a name or number is out of range, or the distance has no diffusion time.
    MeshError, SolverError
        See :func:`canonical_form`.

    Warns
    -----
    UnbendWarning
        See :func:`canonical_form`; and if an eigenvalue is negative, as those of geodesic distances
        may be.

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
    for name, number in (("n_samples", n_samples), ("n_eigenpairs", n_eigenpairs)):
        if not is_whole(number) or number < 2:
            raise InputError(f"{name} must be a whole number of at least 2, not {number}")
    route = partial(
        sampled,
        n_samples=n_samples,
        n_eigenpairs=n_eigenpairs,
        mu=mu,
        interpolation=interpolation,
    )
    options = Options(distance, n_components, weighting, time, keep_scale, random_state)
    # So many samples span a dimension less, and the first eigenfunction is constant.
    most = min(n_samples, n_eigenpairs) - 1
    return _form(mesh, route, "sampled", options, laplacian, component, progress, most)


def _form(
    mesh: MeshLike,
    route: Callable[[Surface, Options, Steps], Scaled],
    method: str,
    options: Options,
    laplacian: LaplacianKind,
    component: str | int | None,
    progress: Progress | None,
    most: int | None = None,
) -> CanonicalForm:
    """Scale a mesh's distances along a route; `most` is the largest dimension it can give."""
    d = options.n_components
    _check_seed(options.random_state)
    if options.weighting not in ("uniform", "area"):
        raise InputError(f'weighting must be "uniform" or "area", not {options.weighting!r}')
    steps = Steps(progress)
    with steps("laplacian"):
        surface = make_surface(mesh, laplacian=laplacian, component=component)
    most = surface.n_vertices - 1 if most is None else min(most, surface.n_vertices - 1)
    if not is_whole(d) or not 1 <= d <= most:
        raise InputError(f"the form's dimension must be 1 to {most} here, not {d}")
    points, values, metric = route(surface, options, steps)
    points = points[:, :d].copy()
    by_area = options.weighting == "area"
    weights = surface.operator.areas if by_area else np.ones(len(points))
    _check_axes(points, values[:d], weights, surface.mesh.name)
    with steps("stress"):
        stress = _stress(points, metric, options.random_state)
    if options.keep_scale:
        unit = surface.area ** (length_power(options.distance) / 2)
        points, values = points * unit, values * unit**2
    found = _eigenvalue_notes(values, d, _EQUAL[method])
    for note in found:
        warn(f"{surface.mesh.name}: {note}")
    return CanonicalForm(
        points=surface.prepared.expand(points),
        eigenvalues=values[:d],
        stress=stress,
        distance=options.distance,
        method=method,
        weighting=options.weighting,
        laplacian=surface.operator.kind,
        area=surface.area,
        notes=surface.prepared.notes + found,
        seconds=steps.seconds,
    )


def _check_seed(random_state: int) -> None:
    try:
        np.random.default_rng(random_state)
    except (TypeError, ValueError):
        raise InputError(
            f"random_state must be a whole number, not negative, and not {random_state!r}"
        ) from None


def _check_axes(
    points: FloatArray, eigenvalues: FloatArray, weights: FloatArray, name: str
) -> None:
    """Refuse a form that is not what classical scaling gives: centred, its columns its axes."""
    if eigenvalues.max() <= 0:
        raise SolverError(
            f"{name}: all points of the form coincide: the distances it should keep are lost in "
            "rounding"
        )
    weighted = points * weights[:, None]
    apart = points.T @ weighted - np.diag(np.maximum(eigenvalues, 0))
    largest = float(eigenvalues.max())
    middle = weighted.sum(axis=0) / np.sqrt(largest * weights.sum())
    skew = max(float(np.abs(apart).max()) / largest, float(np.abs(middle).max()))
    if not skew <= _SKEW:
        raise SolverError(
            f"{name}: the form's columns miss their eigenvalues, each other's right angles or the "
            f"middle by {skew:.1e} of the largest eigenvalue"
        )


def _stress(points: FloatArray, metric: Metric, random_state: int) -> float:
    chance = np.random.default_rng(random_state)
    some = np.sort(chance.permutation(len(points))[:_STRESS_VERTICES])
    wanted = metric.between(some)
    reached = np.linalg.norm(points[some][:, None] - points[some][None, :], axis=2)
    return float(np.sqrt(((wanted - reached) ** 2).sum() / (wanted**2).sum()))


def _eigenvalue_notes(values: FloatArray, d: int, equal: float) -> tuple[str, ...]:
    """Say what is wrong with the first d eigenvalues; the next one may be there, too."""
    notes = []
    negative = int((values[:d] < 0).sum())
    if negative:
        notes.append(
            f"{negative} of the {d} leading eigenvalues are negative (these distances are not "
            "Euclidean); their coordinates are zero"
        )
    apart = values[:-1] - values[1:] > equal * values[:-1]
    if len(values) > d and values[d] > 0 and not apart[d - 1]:
        fewer = np.flatnonzero(apart[: d - 1]) + 1
        choices = " or ".join(str(n) for n in (*fewer[-1:], d + 1))
        notes.append(
            f"eigenvalues {d} and {d + 1} are nearly equal ({values[d - 1]:.6g} and "
            f"{values[d]:.6g}), so the form holds an arbitrary part of their eigenspace; use "
            f"n_components={choices}"
        )
    return tuple(notes)
