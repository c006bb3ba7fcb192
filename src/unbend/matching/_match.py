"""Public functions of the matcher."""

from __future__ import annotations

from typing import Literal

import numpy as np

from unbend._options import refuse_given
from unbend._types import FloatArray, Progress
from unbend.alignment import align, closest_points
from unbend.errors import InputError
from unbend.io import MeshLike
from unbend.matching import _solve
from unbend.matching._confidence import decide
from unbend.matching._inputs import expand, expand_rows, prepare_shape
from unbend.matching._projection import closest_faces
from unbend.matching._result import Hypothesis, Match
from unbend.matching._rigidity import orientation_score
from unbend.matching._shape import Shape
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

    The shapes' spectral canonical forms are aligned in growing dimension, many hypotheses at a
    time; among those that keep the surface right side out, the one that moves patches of the
    surface most rigidly is taken, and nearly rigid deformations of both shapes polish it. Where
    two maps move it nearly alike, both are polished, and the one that fits better is taken.

    Parameters
    ----------
    source, target : mesh-like
        Anything :func:`unbend.as_mesh` accepts. Each a single connected surface, open or closed,
        wound consistently. The vertex counts, units, and positions in space may differ.
    method : {"progressive", "icp"}, default="progressive"
        ``"icp"`` aligns the three-dimensional biharmonic canonical forms by iterative closest
        points, as the paper does: fast, and blind to which limb is which.
    n_eigenpairs : int, optional
        Eigenpairs of each shape, the constant included, 150 by default; fewer for meshes of few
        vertices. This and all options below but the last two are for ``"progressive"``.
    refine : bool, optional
        Whether to refine the map beyond the search's 30 eigenfunctions, as is done by default.
    allow_mirror : bool, default=False
        Whether a map may turn the surface inside out when that is the more rigid one.
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
        If a mesh cannot be used, has several components, or is wound inconsistently.
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
    ranked, maps = _solve.candidates(left, right, progress)
    reversing = _solve.rank(left, right, maps, reflected=True) if mirrored or allow_mirror else []
    if allow_mirror:
        ranked = sorted([*ranked, *reversing], key=lambda one: one.rigidity)
    ranked, solution, confidence = decide(left, right, ranked, polish=polish, on_step=progress)
    chosen = ranked[0]
    faces = weights = None
    if barycentric:
        faces, weights = closest_faces(*solution.landing, right.faces, solution.source_to_target)
    return Match(
        source_to_target=expand(solution.source_to_target, ours, theirs),
        target_to_source=expand(solution.target_to_source, theirs, ours),
        functional_map=_functional_map(left, right, solution),
        orientation=chosen.orientation * (-1 if chosen.reflected else 1),
        residual=_solve.point_residual(left, right, solution.functional_map),
        confidence=confidence,
        hypotheses=tuple(
            Hypothesis(one.rigidity, one.orientation * (-1 if one.reflected else 1))
            for one in ranked
        ),
        faces=None if faces is None else expand_rows(faces, ours, -1),
        weights=None if weights is None else expand_rows(weights, ours, np.nan),
        mirrored=expand(
            _solve.refine(left, right, reversing[0], polish=polish).source_to_target, ours, theirs
        )
        if mirrored
        else None,
    )


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
    _, maps = _solve.candidates(shape, shape, progress)
    ranked = _solve.rank(shape, shape, maps, reflected=True)
    ranked, solution, confidence = decide(shape, shape, ranked, polish=refine, on_step=progress)
    return Match(
        source_to_target=expand(solution.source_to_target, surface, surface),
        target_to_source=expand(solution.target_to_source, surface, surface),
        functional_map=_functional_map(shape, shape, solution),
        orientation=-ranked[0].orientation,
        residual=_solve.point_residual(shape, shape, solution.functional_map),
        confidence=confidence,
        hypotheses=tuple(Hypothesis(one.rigidity, -one.orientation) for one in ranked),
    )


def _match_by_icp(ours: Surface, left: Shape, theirs: Surface, right: Shape) -> Match:
    d = min(_ICP_COMPONENTS, left.k, right.k)
    forms = [shape.basis[:, :d] / shape.eigenvalues[:d] for shape in (left, right)]
    found = align(
        forms[0][left.samples[:_POINTS_FOR_ICP]], forms[1][right.samples[:_POINTS_FOR_ICP]]
    )
    whole = closest_points(found.apply(forms[0]), forms[1])[:2]
    solution = _solve.Solution(
        *whole, found.rotation.T, (left.vertices, right.vertices), found.residual
    )
    return Match(
        source_to_target=expand(whole[0], ours, theirs),
        target_to_source=expand(whole[1], theirs, ours),
        functional_map=_functional_map(left, right, solution),
        orientation=orientation_score(left, right, found.rotation.T),
        residual=found.residual / float(np.sqrt((1 / right.eigenvalues[:d] ** 2).sum())),
        confidence=float("nan"),
    )


def _functional_map(source: Shape, target: Shape, solution: _solve.Solution) -> FloatArray:
    k = len(solution.functional_map)
    ours = np.hstack([np.ones((len(source.areas), 1)), source.basis[:, :k]])
    theirs = np.hstack([np.ones((len(target.areas), 1)), target.basis[:, :k]])
    pulled = source.areas[:, None] * theirs[solution.source_to_target]
    return np.asarray(ours.T @ pulled)
