"""Public functions of the matcher."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from unbend._options import refuse_given
from unbend._types import Progress
from unbend.alignment import align, closest_points
from unbend.errors import InputError
from unbend.io import MeshLike
from unbend.matching._inputs import expand, expand_rows, prepare_shape
from unbend.matching._judge import Candidate, confidence, judge
from unbend.matching._projection import closest_faces
from unbend.matching._registration import landing_places, rough_start, spectral_residual
from unbend.matching._result import Hypothesis, Match
from unbend.matching._shape import Shape
from unbend.matching._solve import candidates, make_sides, refined
from unbend.spectral import Surface

_N_EIGENPAIRS, _LEAST_EIGENPAIRS = 150, 4
_ICP_COMPONENTS = 3
_POINTS_FOR_ICP = 1500


def match(
    source: MeshLike,
    target: MeshLike,
    *,
    method: Literal["progressive", "icp"] = "progressive",
    n_eigenpairs: int | None = None,
    refine: bool | None = None,
    allow_mirror: bool = False,
    barycentric: bool = False,
    mirrored: bool = False,
    cache: bool = True,
    progress: Progress | None = None,
) -> Match:
    """Match two deformable shapes, without landmarks or training.

    Many hypotheses, from alignments of spectral canonical forms in growing dimension and, where
    the bodies differ, from tips of limbs, are registered on coarse copies of the shapes; among
    those that keep the surface right side out, the one whose patches, turned and scaled, explain
    the most of the other shape is taken, and polished on the shapes themselves.

    Parameters
    ----------
    source, target : mesh-like
        Anything :func:`unbend.as_mesh` accepts. Each a single connected surface with two sides,
        open or closed; faces wound unlike their neighbours are turned. The vertex counts, units,
        and positions in space may differ.
    method : {"progressive", "icp"}, default="progressive"
        ``"icp"`` aligns the three-dimensional biharmonic canonical forms by iterative closest
        points, as the paper does: fast, and blind to which limb is which.
    n_eigenpairs : int, optional
        Eigenpairs of each shape, the constant included, 150 by default; fewer for meshes of few
        vertices. This and all options below but the last two are for ``"progressive"``.
    refine : bool, optional
        Whether to polish the map on the full meshes, as is done by default; else it is as exact as
        their coarse copies.
    allow_mirror : bool, default=False
        Whether a map may turn the surface inside out when that explains more.
    barycentric : bool, default=False
        Whether to give faces and weights, for accuracy below a vertex.
    mirrored : bool, default=False
        Whether to give the best orientation-reversing map too.
    cache : bool, default=True
        Whether to keep eigenpairs on disk; see :func:`unbend.spectrum`.
    progress : callable, optional
        Called with a stage's name and the share of it that is done.

    Returns
    -------
    Match

    Raises
    ------
    MeshError
        If a mesh cannot be used, has several components, or has only one side.
    InputError
        If an option is out of range or not for this method, or a shape has no faces.

    Notes
    -----
    Nothing is random: the same meshes give the same map.

    References
    ----------
    Yang, Obaseki & Chen, "Spectral multi-dimensional scaling using biharmonic distance", GRAPP
    2019 (canonical forms); Melzi et al., "ZoomOut", ACM TOG 2019 (growth); Ren et al.,
    "MapTree: recovering multiple solutions in the space of maps", ACM TOG 2020 (hypotheses).

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.datasets import make_sphere
    >>> from unbend import match
    >>> ball = make_sphere(3)
    >>> stone = ball.vertices * [1, 0.8, 0.6] + 0.2 * ball.vertices[:, [1, 2, 0]] ** 2
    >>> found = match((stone, ball.faces), (stone @ np.diag([-2, 2, -2]), ball.faces))
    >>> bool((found.source_to_target == np.arange(len(stone))).all())
    True
    """
    if method not in ("progressive", "icp"):
        raise InputError(f"method must be 'progressive' or 'icp', not {method!r}")
    if method == "icp":
        refuse_given(
            'is for method="progressive"; leave it out',
            n_eigenpairs=n_eigenpairs,
            refine=refine,
            allow_mirror=allow_mirror or None,
            barycentric=barycentric or None,
            mirrored=mirrored or None,
        )
        n_eigenpairs = _ICP_COMPONENTS + 1
    n_eigenpairs = _N_EIGENPAIRS if n_eigenpairs is None else n_eigenpairs
    polish = refine is None or refine
    if n_eigenpairs < _LEAST_EIGENPAIRS:
        raise InputError(f"n_eigenpairs must be at least {_LEAST_EIGENPAIRS}, not {n_eigenpairs}")
    ours, left = prepare_shape(source, n_eigenpairs, cache, progress)
    theirs, right = prepare_shape(target, n_eigenpairs, cache, progress)
    if method == "icp":
        return _match_by_icp(ours, left, theirs, right)
    sides = make_sides(left, right)
    found = candidates(sides, progress)
    turned = candidates(sides.reflected(), progress) if mirrored or allow_mirror else []
    if allow_mirror:
        found = sorted([*found, *turned], key=lambda one: one.energy)
    chosen = refined(sides, found[0], polish=polish)
    if progress is not None:
        progress("refine", 1.0)
    result = _result(ours, left, theirs, right, chosen, found)
    if barycentric:
        landing = landing_places(left, right, chosen.registered)
        faces, weights = closest_faces(*landing, right.faces, chosen.registered.forward)
        result = replace(
            result,
            faces=expand_rows(faces, ours, -1),
            weights=expand_rows(weights, ours, np.nan),
        )
    if mirrored:
        other = refined(sides, turned[0], polish=polish)
        result = replace(result, mirrored=expand(other.registered.forward, ours, theirs))
    return result


def prepare_spectrum(mesh: MeshLike) -> None:
    """Compute the eigenpairs that :func:`match` needs of a mesh, and keep them on disk for it.

    Raises
    ------
    MeshError, InputError
        See :func:`match`.
    """
    prepare_shape(mesh, _N_EIGENPAIRS, cache=True, progress=None)


def symmetry(
    mesh: MeshLike,
    *,
    n_eigenpairs: int = _N_EIGENPAIRS,
    refine: bool = True,
    cache: bool = True,
    progress: Progress | None = None,
) -> Match:
    """Intrinsic reflective symmetry of a shape: its best map to itself that swaps left and right.

    Parameters
    ----------
    mesh : mesh-like
        See :func:`match`.
    n_eigenpairs, refine, cache, progress
        See :func:`match`.

    Returns
    -------
    Match
        From the mesh to itself, reversing orientation. Its `confidence` says how likely it is
        that the shape has such a symmetry.

    Raises
    ------
    MeshError, InputError
        See :func:`match`.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.datasets import make_sphere
    >>> from unbend import symmetry
    >>> ball = make_sphere(3)
    >>> x, y, z = ball.vertices.T
    >>> egg = np.stack([x * (1.3 + 0.4 * y + 0.2 * z), y, 0.7 * z + 0.2 * y**2], axis=1)
    >>> swapped = egg[symmetry((egg, ball.faces)).source_to_target]
    >>> bool(np.abs(swapped * [-1, 1, 1] - egg).max() < 0.1)
    True
    """
    surface, shape = prepare_shape(mesh, n_eigenpairs, cache, progress)
    sides = make_sides(shape, shape).reflected()
    found = candidates(sides, progress)
    chosen = refined(sides, found[0], polish=refine)
    if progress is not None:
        progress("refine", 1.0)
    return _result(surface, shape, surface, shape, chosen, found)


def _match_by_icp(ours: Surface, left: Shape, theirs: Surface, right: Shape) -> Match:
    d = min(_ICP_COMPONENTS, left.k, right.k)
    forms = [shape.basis[:, :d] / shape.eigenvalues[:d] for shape in (left, right)]
    found = align(
        forms[0][left.samples[:_POINTS_FOR_ICP]], forms[1][right.samples[:_POINTS_FOR_ICP]]
    )
    forward, backward, _ = closest_points(found.apply(forms[0]), forms[1])
    poses = rough_start(left, right, found.rotation.T)
    judged = judge(left, right, poses._replace(forward=forward, backward=backward))
    result = _result(ours, left, theirs, right, judged, [])
    return replace(
        result,
        residual=found.residual / float(np.sqrt((1 / right.eigenvalues[:d] ** 2).sum())),
        confidence=float("nan"),
    )


def _result(
    ours: Surface,
    left: Shape,
    theirs: Surface,
    right: Shape,
    chosen: Candidate,
    found: Sequence[Candidate],
) -> Match:
    forward, backward = chosen.registered[:2]
    k = min(left.k, right.k)
    mine, other = (
        np.hstack([np.ones((len(shape.areas), 1)), shape.basis[:, :k]]) for shape in (left, right)
    )
    return Match(
        source_to_target=expand(forward, ours, theirs),
        target_to_source=expand(backward, theirs, ours),
        functional_map=mine.T @ (left.areas[:, None] * other[forward]),
        orientation=_orientation(chosen),
        residual=spectral_residual(left, right, chosen.registered),
        confidence=confidence(found) if found else float("nan"),
        hypotheses=tuple(Hypothesis(one.energy, _orientation(one)) for one in found),
    )


def _orientation(one: Candidate) -> float:
    return -one.orientation if one.reflected else one.orientation
