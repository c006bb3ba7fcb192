"""Canonical forms: a shape unbent, so that its poses look alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from unbend._arrays import is_whole
from unbend._display import Brief, Drawn
from unbend._options import refuse_given
from unbend._types import FloatArray, Progress
from unbend.canonical._routes import Options, Steps, exact, sampled
from unbend.choices import Detail, DistanceKind, Interpolation, LaplacianKind, Method, Weighting
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
# Of the sampled method, unless others are asked for.
_N_EIGENPAIRS, _N_SAMPLES, _MU = 100, 200, 1e4


@dataclass(frozen=True, eq=False, repr=False)
class CanonicalForm(Brief, Drawn):
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
        What was used; never ``"auto"``.
    area : float
        Area of the input, in its own squared units of length.
    notes : tuple of str
        What was done to the input, a sentence each.
    seconds : dict of str to float
        Wall time of each step.
    surface : (n, 3) ndarray of float64, or None
        With ``detail="preserved"``: the vertices of the surface itself, laid as rigidly as possible
        into the form's pose; NaN where `points` is. At unit area, unless the scale was kept.
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
    surface: FloatArray | None = None


def canonical_form(
    mesh: MeshLike,
    *,
    n_components: int = 3,
    distance: DistanceKind = "biharmonic",
    method: Method = "auto",
    weighting: Weighting = "uniform",
    n_eigenpairs: int | None = None,
    n_samples: int | None = None,
    mu: float | None = None,
    interpolation: Interpolation | None = None,
    time: float | None = None,
    laplacian: LaplacianKind = "auto",
    component: str | int | None = None,
    keep_scale: bool = False,
    random_state: int = 0,
    detail: Detail | None = None,
    progress: Progress | None = None,
) -> CanonicalForm:
    """Embed a surface in Euclidean space so that straight distances are its intrinsic ones.

    Poses of one shape have nearly the same intrinsic distances, hence nearly the same
    canonical form, up to a rotation or reflection.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts. It is scaled to unit area inside.
    n_components : int, default=3
        Dimension d of the form.
    distance : str, default="biharmonic"
        ``"biharmonic"``, ``"commute-time"``, ``"diffusion"``, ``"geodesic"`` or
        ``"geodesic-exact"``; see :func:`unbend.distance`.
    method : {"auto", "exact", "sampled"}, default="auto"
        ``"exact"``: classical scaling of all n^2 distances through an operator, for the first
        three distances. ``"sampled"``: the paper's, for any distance, from `n_samples` vertices
        and `n_eigenpairs` eigenfunctions; ``"auto"``: exact where it exists.
    weighting : {"uniform", "area"}, default="uniform"
        Whether each vertex counts the same (the paper's), or by its area, which makes the form
        independent of how densely a region is meshed.
    n_eigenpairs, n_samples : int, optional
        Of the sampled method, 100 and 200 by default; no more than there are vertices are used.
    mu : float, optional
        Weight of the samples against smoothness, in the sampled method; 1e4 by default.
    interpolation : {"projection", "least-squares"}, optional
        Eq. 15 (the default) or Eq. 14 of the paper, in the sampled method.
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
    detail : "preserved", optional
        Give the `surface` too: the mesh as it looks in the form's pose, its limbs as thick and its
        edges about as long as they are. Needs faces and at least 3 dimensions.
    progress : callable, optional
        Called with a step's name and the share of it that is done, 0 to 1.

    Returns
    -------
    CanonicalForm

    Raises
    ------
    InputError
        If a name or number is out of range, or an option is given that the method or the distance
        cannot use.
    MeshError
        If the mesh cannot be used; the message names the vertex or face. If its computation does
        not fit into the memory that is free.
    SolverError
        If an eigenpair does not reach its accuracy, or the form is not centred on its axes.

    Warns
    -----
    UnbendWarning
        If something was done to the input that the result shows, an eigenvalue is negative, or the
        last one nearly equals the next, which the form leaves out: then it depends on the order of
        the vertices. Symmetric shapes have such multiple eigenvalues.

    References
    ----------
    Yang, Obaseki and Chen, "Spectral multi-dimensional scaling using biharmonic distance",
    GRAPP 2019. Aflalo and Kimmel, "Spectral multidimensional scaling", PNAS 110(45), 2013. Detail:
    after Lian, Godil and Xiao, "Feature-preserved 3D canonical form", IJCV 102, 2013.

    Examples
    --------
    >>> from unbend import canonical_form
    >>> from unbend.datasets import make_sphere
    >>> form = canonical_form(make_sphere(2))
    >>> form.points.shape, form.method
    ((162, 3), 'exact')
    """
    chosen = _choose_method(method, distance)
    _check_seed(random_state)
    if weighting not in ("uniform", "area"):
        raise InputError(f'weighting must be "uniform" or "area", not {weighting!r}')
    if chosen == "exact":
        refuse_given(
            'is for sampled forms; use method="sampled", or leave it out',
            n_eigenpairs=n_eigenpairs,
            n_samples=n_samples,
            mu=mu,
            interpolation=interpolation,
        )
    if detail is not None:
        _check_detail(detail, n_components)
    options = Options(
        distance,
        n_components,
        weighting,
        _N_EIGENPAIRS if n_eigenpairs is None else n_eigenpairs,
        _N_SAMPLES if n_samples is None else n_samples,
        _MU if mu is None else mu,
        interpolation or "projection",
        diffusion_time(distance, time),
        random_state,
    )
    steps = Steps(progress)
    with steps("laplacian"):
        surface = make_surface(mesh, laplacian=laplacian, component=component)
    _check_dimension(surface, chosen, options)
    if detail is not None and surface.mesh.is_point_cloud:
        raise InputError(f"{surface.mesh.name}: detail needs faces, and this is a point cloud")
    route = exact if chosen == "exact" else sampled
    points, values, metric = route(surface, options, steps)
    points = points[:, :n_components].copy()
    weights = surface.operator.areas if weighting == "area" else np.ones(len(points))
    _check_axes(points, values[:n_components], weights, surface.mesh.name)
    with steps("stress"):
        stress = _stress(points, metric, random_state)
    laid = None
    if detail is not None:
        from unbend.canonical._detail import lay_into_pose  # slow to import, and seldom needed

        with steps("detail"):
            laid = lay_into_pose(
                surface.mesh.vertices / np.sqrt(surface.area),
                surface.mesh.faces,
                surface.operator.areas,
                points[:, :3],
                progress or (lambda stage, share: None),
            )
        if keep_scale:
            laid *= np.sqrt(surface.area)
    if keep_scale:
        unit = surface.area ** (length_power(distance) / 2)
        points, values = points * unit, values * unit**2
    found = _eigenvalue_notes(values, n_components, _EQUAL[chosen])
    for note in found:
        warn(f"{surface.mesh.name}: {note}")
    return CanonicalForm(
        points=surface.prepared.expand(points),
        eigenvalues=values[:n_components],
        stress=stress,
        distance=distance,
        method=chosen,
        weighting=weighting,
        laplacian=surface.operator.kind,
        area=surface.area,
        notes=surface.prepared.notes + found,
        seconds=steps.seconds,
        surface=None if laid is None else surface.prepared.expand(laid),
    )


def _choose_method(method: str, distance: DistanceKind) -> str:
    check_kind(distance)
    if method == "auto":
        return "exact" if distance in SPECTRAL else "sampled"
    if method not in ("exact", "sampled"):
        raise InputError(f'method must be "auto", "exact" or "sampled", not {method!r}')
    if method == "exact" and distance not in SPECTRAL:
        raise InputError(f'the {distance} distance has no exact form; use method="sampled"')
    return method


def _check_detail(detail: str, n_components: int) -> None:
    if detail != "preserved":
        raise InputError(f'detail must be "preserved" or left out, not {detail!r}')
    if n_components < 3:
        raise InputError(f"detail needs a form of at least 3 dimensions, not {n_components}")


def _check_seed(random_state: int) -> None:
    try:
        np.random.default_rng(random_state)
    except (TypeError, ValueError):
        raise InputError(
            f"random_state must be a whole number, not negative, and not {random_state!r}"
        ) from None


def _check_dimension(surface: Surface, method: str, options: Options) -> None:
    most = surface.n_vertices - 1
    if method == "sampled":
        # So many samples span a dimension less, and the first eigenfunction is constant.
        for name in ("n_samples", "n_eigenpairs"):
            number = getattr(options, name)
            if not is_whole(number) or number < 2:
                raise InputError(f"{name} must be a whole number of at least 2, not {number}")
            most = min(most, number - 1)
    if not is_whole(options.n_components) or not 1 <= options.n_components <= most:
        raise InputError(
            f"the form's dimension must be 1 to {most} here, not {options.n_components}"
        )


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
