"""Similarity of shapes in any pose: the cosine of their canonical forms."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from unbend._arrays import check_choice, check_whole, numbers_of
from unbend._types import FloatArray, IntArray
from unbend.canonical import CanonicalForm, canonical_form, sampled_canonical_form
from unbend.choices import DistanceKind, Weighting
from unbend.distances import GEODESIC, diffusion_time
from unbend.errors import InputError
from unbend.io import as_mesh, checked_map
from unbend.matching import Match
from unbend.mesh import Mesh, vertex_areas


def similarity(
    model: Any,
    probe: Any,
    *,
    match: Any = None,
    n_components: int = 3,
    distance: DistanceKind = "biharmonic",
    weighting: Literal["auto", "uniform", "area"] = "auto",
    areas: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
) -> float:
    """Similarity of two shapes in any pose: the cosine of their canonical forms.

    Both forms are centred, and one is rotated or reflected onto the other. Poses of one shape have
    a similarity close to 1.

    Parameters
    ----------
    model, probe : CanonicalForm or mesh-like
        Anything :func:`unbend.as_mesh` accepts; or its form, which saves time when many shapes are
        compared.
    match : Match or (n_model,) array_like of int, optional
        From model to probe. By default, vertices with the same number correspond.
    n_components : int, default=3
        Dimension that is compared; further columns of a form are ignored.
    distance : str, default="biharmonic"
        Distance of the canonical forms of meshes. They are exact, except for geodesic distances:
        see :func:`unbend.canonical_form` and :func:`unbend.sampled_canonical_form`.
    weighting : {"auto", "uniform", "area"}, default="auto"
        Whether vertices count equally or by their area, both in the canonical forms of meshes and
        in the cosine. ``"auto"``: by area with a match, since its shapes may be meshed differently,
        and with `areas`; otherwise equally, as in the paper. Forms that are given stay as they are.
    areas : ((n_model,), (n_probe,)) arrays_like of float, optional
        Vertex areas, needed only where vertices count by area and a form is given.

    Returns
    -------
    float
        0 to 1. Sizes do not count.

    Raises
    ------
    InputError
        If the numbers of vertices differ and there is no match, or something does not fit, such as
        forms by different distances, diffusion times or weightings.
    MeshError
        If a mesh cannot be used; the message names the vertex or face.

    Notes
    -----
    For centred S and T with one row for each pair of corresponding vertices, the aligned cosine
    is the sum of the singular values of S^T T over norm(S) norm(T). The pairs of both directions
    of a Match count, so swapping model and probe changes nothing. If the first eigenvalue left
    out is nearly as large as the last one kept, two poses may keep different ones, and their
    similarity is low; compare in another dimension.

    References
    ----------
    Yang, Obaseki & Chen, "Spectral multi-dimensional scaling using biharmonic distance", GRAPP
    2019, Table 2.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from unbend import similarity
    >>> ball = make_sphere(2)
    >>> round(similarity(ball, (-5 * ball.vertices, ball.faces)), 6)
    1.0
    """
    check_choice(distance, "distance", get_args(DistanceKind))
    check_choice(weighting, "weighting", ("auto", "uniform", "area"))
    check_whole(n_components, "n_components", 1)
    if weighting == "uniform" and areas is not None:
        raise InputError('areas have no use with weighting="uniform"')
    if weighting == "auto":
        weighting = "uniform" if match is None and areas is None else "area"
    shapes = [one if isinstance(one, CanonicalForm) else as_mesh(one) for one in (model, probe)]
    kinds = {_kind(one, distance, weighting) for one in shapes}
    if len(kinds) > 1:
        one, other = sorted(kinds)
        raise InputError(
            f"a form by {one} cannot be compared with one by {other}; compute both alike"
        )
    left, right = (_points(one, n_components, distance, weighting) for one in shapes)
    if weighting == "area":
        given = (None, None) if areas is None else tuple(areas)
        if len(given) != 2:
            raise InputError("areas must be those of the model, then those of the probe")
        masses = [_areas(one, own) for one, own in zip(shapes, given, strict=True)]
    else:
        masses = [np.full(len(points), 1 / len(points)) for points in (left, right)]
    rows, columns, weights = _pairs(match, *masses)
    return aligned_cosine(left[rows], right[columns], weights)


def _kind(shape: CanonicalForm | Mesh, distance: str, weighting: str) -> str:
    """Say how a form was made, or will be."""
    time = diffusion_time(distance, None) if distance == "diffusion" else None
    if isinstance(shape, CanonicalForm):
        distance, weighting, time = shape.distance, shape.weighting, shape.time
    at = "" if time is None else f" at time {time:.6g}"
    return f"{distance} distance{at}, {weighting} weighting"


def aligned_cosine(source: FloatArray, target: FloatArray, weights: FloatArray) -> float:
    """Cosine (0 to 1) of corresponding points (r, d) after the best rotation or reflection.

    Points are centred; rows that are not finite in both, or have no positive weight (r,), do not
    count. Raises InputError if no rows count, or all points of one side coincide.
    """
    counted = np.isfinite(source).all(axis=1) & np.isfinite(target).all(axis=1) & (weights > 0)
    if not counted.any():
        raise InputError("no vertex of one shape corresponds to a vertex of the other")
    left, right, mass = source[counted], target[counted], weights[counted] / weights[counted].sum()
    left, right = left - mass @ left, right - mass @ right
    norms = [float(np.sqrt(mass @ (one**2).sum(axis=1))) for one in (left, right)]
    if min(norms) == 0:
        raise InputError("all corresponding points coincide: there is no shape to compare")
    cross = (left * mass[:, None]).T @ right / (norms[0] * norms[1])
    return float(min(np.linalg.svd(cross, compute_uv=False).sum(), 1.0))


def _points(
    shape: CanonicalForm | Mesh, d: int, distance: DistanceKind, weighting: Weighting
) -> FloatArray:
    if isinstance(shape, Mesh):
        make = sampled_canonical_form if distance in GEODESIC else canonical_form
        shape = make(shape, n_components=d, distance=distance, weighting=weighting)
    if shape.points.shape[1] < d:
        raise InputError(
            f"a canonical form of dimension {shape.points.shape[1]} cannot be compared in "
            f"{d} dimensions; compute it with n_components={d}"
        )
    return shape.points[:, :d]


def _areas(shape: CanonicalForm | Mesh, given: npt.ArrayLike | None) -> FloatArray:
    if given is not None:
        areas = numbers_of(given, "areas")
        n = shape.n_vertices if isinstance(shape, Mesh) else len(shape.points)
        if areas.shape != (n,) or not (np.isfinite(areas) & (areas >= 0)).all() or not areas.any():
            raise InputError(f"areas must be {n} finite non-negative numbers, not all 0")
    elif isinstance(shape, Mesh):
        areas = vertex_areas(shape)
    else:
        raise InputError(
            "a canonical form does not know its vertices' areas: give them as areas=, or the "
            'mesh, or weighting="uniform"'
        )
    return np.asarray(areas / areas.sum())


def _pairs(
    match: Any, ours: FloatArray, theirs: FloatArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Corresponding vertices of model and probe, and the weight of each pair."""
    n, m = len(ours), len(theirs)
    if match is None:
        if n != m:
            raise InputError(
                f"the shapes have {n} and {m} vertices; pass a match of model and probe as match="
            )
        return np.arange(n), np.arange(n), ours + theirs
    if isinstance(match, Match):
        rows = np.append(np.arange(n), _images(match.target_to_source, m, n))
        columns = np.append(_images(match.source_to_target, n, m), np.arange(m))
        weights = np.append(ours, theirs)
    else:
        rows, columns, weights = np.arange(n), _images(match, n, m), ours
    matched = (rows >= 0) & (columns >= 0)
    return rows[matched], columns[matched], weights[matched]


def _images(values: Any, n: int, m: int) -> IntArray:
    images = checked_map(values, m, "a map that is no Match")
    if len(images) != n:
        raise InputError(f"the match must have one vertex number for each of {n} vertices")
    return images
