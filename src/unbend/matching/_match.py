"""Public functions of the matcher."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from unbend._types import FloatArray, IntArray
from unbend.alignment import align, closest_points
from unbend.errors import InputError, MeshError
from unbend.matching import _solve
from unbend.matching._confidence import confidence
from unbend.matching._registration import closest_faces
from unbend.matching._shape import Shape, make_shape
from unbend.mesh import as_mesh
from unbend.spectra import eigenpairs
from unbend.surface import Surface, make_surface

_LEAST_EIGENPAIRS = 4
_ICP_COMPONENTS = 3
_POINTS_FOR_ICP = 1500

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Hypothesis:
    """What the search knows of one way to match two shapes.

    Attributes
    ----------
    rigidity : float
        Mean logarithm of the share of local shape that no rotation explains; lower is better.
    orientation : float
        Share of the surface that is kept right side out, less the rest: -1 to 1.
    """

    rigidity: float
    orientation: float


@dataclass(frozen=True, eq=False)
class Match:
    """A map between two shapes.

    Attributes
    ----------
    source_to_target : (n_source,) ndarray of int64
        Target vertex of each source vertex; -1 at source vertices that no face uses.
    target_to_source : (n_target,) ndarray of int64
        Source vertex of each target vertex, likewise.
    functional_map : (k, k) ndarray of float64
        Pulls functions back from target to source, in the first k eigenfunctions (the constant
        among them, unit total area): ``source_basis @ functional_map`` is close to
        ``target_basis[source_to_target]``. For areas `a` of the source that sum to one, it is
        ``source_basis.T @ diag(a) @ target_basis[source_to_target]``.
    orientation : float
        Share of the surface that is kept right side out, less the rest: -1 to 1. A good map
        between people has about 0.5, its mirror image -0.5.
    residual : float
        Root mean square distance of nearest neighbours in the aligned spectral forms, both
        directions; 0 for a perfect match, about 1 for none.
    confidence : float
        Estimate, 0 to 1, of the probability that the map is right as a whole: that its mean
        geodesic error is below 0.08 of the square root of the area.
    hypotheses : tuple of Hypothesis
        The one that was taken, then the runners-up as ranked. Empty for ``method="icp"``.
    faces, weights : (n_source,) ndarray of int64, (n_source, 3) ndarray of float64, or None
        When asked for: the target face that each source vertex falls on, and its barycentric
        coordinates there; -1 and NaN at source vertices that no face uses.
    mirrored : (n_source,) ndarray of int64, or None
        When asked for: the best map that turns the surface inside out, for a symmetric shape the
        map composed with its left-right symmetry.
    """

    source_to_target: IntArray
    target_to_source: IntArray
    functional_map: FloatArray
    orientation: float
    residual: float
    confidence: float
    hypotheses: tuple[Hypothesis, ...] = ()
    faces: IntArray | None = None
    weights: FloatArray | None = None
    mirrored: IntArray | None = None

    def __repr__(self) -> str:
        return (
            f"Match({len(self.source_to_target)} to {len(self.target_to_source)} vertices, "
            f"confidence {self.confidence:.2f})"
        )


def match(
    source: Any,
    target: Any,
    *,
    method: Literal["progressive", "icp"] = "progressive",
    n_eigenpairs: int = 150,
    refine: bool = True,
    allow_mirror: bool = False,
    barycentric: bool = False,
    mirrored: bool = False,
    cache: bool = True,
    progress: Progress | None = None,
) -> Match:
    """Match two deformable shapes, without landmarks or training.

    The shapes' spectral canonical forms are aligned in growing dimension, many hypotheses at a
    time; among those that keep the surface right side out, the one that moves patches of the
    surface most rigidly is taken, and a nearly rigid deformation of the source polishes it.

    Parameters
    ----------
    source, target : mesh-like
        Anything :func:`unbend.as_mesh` accepts. Each a single connected surface, open or closed,
        wound consistently. The vertex counts, units, and positions in space may differ.
    method : {"progressive", "icp"}, default="progressive"
        ``"icp"`` aligns the three-dimensional biharmonic canonical forms by iterative closest
        points, as the paper does: fast, and blind to which limb is which.
    n_eigenpairs : int, default=150
        Eigenpairs of each shape, the constant included; fewer for meshes of few vertices.
    refine : bool, default=True
        Whether to refine the map beyond the search's 30 eigenfunctions.
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
        If an option is out of range, or a shape has no faces.

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
    >>> from unbend.matching import match
    >>> ball = make_sphere(3)
    >>> stone = ball.vertices * [1, 0.8, 0.6] + 0.2 * ball.vertices[:, [1, 2, 0]] ** 2
    >>> found = match((stone, ball.faces), (stone @ np.diag([-2, 2, -2]), ball.faces))
    >>> bool((found.source_to_target == np.arange(len(stone))).all())
    True
    """
    if method not in ("progressive", "icp"):
        raise InputError(f"method must be 'progressive' or 'icp', not {method!r}")
    if n_eigenpairs < _LEAST_EIGENPAIRS:
        raise InputError(f"n_eigenpairs must be at least {_LEAST_EIGENPAIRS}, not {n_eigenpairs}")
    ours, left = _prepare(source, n_eigenpairs, cache, progress)
    theirs, right = _prepare(target, n_eigenpairs, cache, progress)
    if method == "icp":
        return _match_by_icp(ours, left, theirs, right)
    ranked, maps = _solve.candidates(left, right, progress)
    reversing = _solve.rank(left, right, maps, reflected=True) if mirrored or allow_mirror else []
    if allow_mirror:
        ranked = sorted([*ranked, *reversing], key=lambda one: one.rigidity)
    chosen = ranked[0]
    solution = _solve.refine(left, right, chosen, polish=refine, on_step=progress)
    faces = weights = None
    if barycentric:
        faces, weights = _barycentric(left, right, chosen, solution)
    return Match(
        source_to_target=_expand(solution.source_to_target, ours, theirs),
        target_to_source=_expand(solution.target_to_source, theirs, ours),
        functional_map=_functional_map(left, right, solution),
        orientation=chosen.orientation * (-1 if chosen.reflected else 1),
        residual=_solve.point_residual(left, right, solution.functional_map),
        confidence=confidence(left, right, ranked),
        hypotheses=tuple(
            Hypothesis(one.rigidity, one.orientation * (-1 if one.reflected else 1))
            for one in ranked
        ),
        faces=None if faces is None else _expand_rows(faces, ours, -1),
        weights=None if weights is None else _expand_rows(weights, ours, np.nan),
        mirrored=_expand(
            _solve.refine(left, right, reversing[0], polish=refine).source_to_target, ours, theirs
        )
        if mirrored
        else None,
    )


def symmetry(
    mesh: Any,
    *,
    n_eigenpairs: int = 150,
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
    >>> from unbend.matching import symmetry
    >>> ball = make_sphere(3)
    >>> x, y, z = ball.vertices.T
    >>> egg = np.stack([x * (1.3 + 0.4 * y + 0.2 * z), y, 0.7 * z + 0.2 * y**2], axis=1)
    >>> swapped = egg[symmetry((egg, ball.faces)).source_to_target]
    >>> bool(np.abs(swapped * [-1, 1, 1] - egg).max() < 0.1)
    True
    """
    surface, shape = _prepare(mesh, n_eigenpairs, cache, progress)
    _, maps = _solve.candidates(shape, shape, progress)
    ranked = _solve.rank(shape, shape, maps, reflected=True)
    solution = _solve.refine(shape, shape, ranked[0], polish=refine, on_step=progress)
    return Match(
        source_to_target=_expand(solution.source_to_target, surface, surface),
        target_to_source=_expand(solution.target_to_source, surface, surface),
        functional_map=_functional_map(shape, shape, solution),
        orientation=-ranked[0].orientation,
        residual=_solve.point_residual(shape, shape, solution.functional_map),
        confidence=confidence(shape, shape, ranked),
        hypotheses=tuple(Hypothesis(one.rigidity, -one.orientation) for one in ranked),
    )


def _prepare(
    mesh: Any, n_eigenpairs: int, cache: bool, progress: Progress | None
) -> tuple[Surface, Shape]:
    mesh = as_mesh(mesh)
    if mesh.is_point_cloud:
        raise InputError(f"{mesh.name}: matching needs faces, and this is a point cloud")
    surface = make_surface(mesh)
    faces = surface.mesh.faces
    _check_winding(faces, mesh.name)
    pairs = eigenpairs(surface, min(n_eigenpairs, surface.n_vertices // 2), cache=cache)
    if progress is not None:
        progress("spectrum", 1.0)
    shape = make_shape(
        surface.mesh.vertices, faces, pairs.areas, pairs.eigenvalues, pairs.eigenfunctions
    )
    return surface, shape


def _check_winding(faces: IntArray, name: str) -> None:
    """Every directed edge belongs to one face, or its neighbours disagree on what is outside."""
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    order = np.lexsort(directed.T)
    repeated = (np.diff(directed[order], axis=0) == 0).all(axis=1)
    if repeated.any():
        first = int(np.flatnonzero(repeated)[0])
        one, other = sorted(int(i) // 3 for i in order[first : first + 2])
        raise MeshError(
            f"{name}: faces {one} and {other} run along their common edge in the same direction, "
            "so it is unclear which side is outside; repair the winding of the faces"
        )


def _match_by_icp(ours: Surface, left: Shape, theirs: Surface, right: Shape) -> Match:
    d = min(_ICP_COMPONENTS, left.k, right.k)
    forms = [shape.basis[:, :d] / shape.eigenvalues[:d] for shape in (left, right)]
    found = align(
        forms[0][left.samples[:_POINTS_FOR_ICP]], forms[1][right.samples[:_POINTS_FOR_ICP]]
    )
    whole = closest_points(found.apply(forms[0]), forms[1])[:2]
    candidate = _solve.rank(left, right, found.rotation.T[None], reflected=False)[0]
    solution = _solve.Solution(*whole, found.rotation.T, None)
    return Match(
        source_to_target=_expand(whole[0], ours, theirs),
        target_to_source=_expand(whole[1], theirs, ours),
        functional_map=_functional_map(left, right, solution),
        orientation=candidate.orientation,
        residual=found.residual / float(np.sqrt((1 / right.eigenvalues[:d] ** 2).sum())),
        confidence=0.0,
    )


def _functional_map(source: Shape, target: Shape, solution: _solve.Solution) -> FloatArray:
    k = len(solution.functional_map)
    ours = np.hstack([np.ones((len(source.areas), 1)), source.basis[:, :k]])
    theirs = np.hstack([np.ones((len(target.areas), 1)), target.basis[:, :k]])
    pulled = source.areas[:, None] * theirs[solution.source_to_target]
    return np.asarray(ours.T @ pulled)


def _barycentric(
    source: Shape, target: Shape, chosen: _solve.Candidate, solution: _solve.Solution
) -> tuple[IntArray, FloatArray]:
    goal = target.reflected() if chosen.reflected else target
    posed = solution.posed
    if posed is None:
        k = len(solution.functional_map)
        smooth = solution.functional_map @ goal.position_coefficients[:k]
        posed = source.basis[:, :k] @ smooth
    return closest_faces(goal, posed, solution.source_to_target)


def _expand(point_map: IntArray, source: Surface, target: Surface) -> IntArray:
    """From vertices in use to all vertices."""
    return np.asarray(_expand_rows(target.prepared.kept[point_map], source, -1))


def _expand_rows(rows: Any, source: Surface, missing: float) -> Any:
    full = np.full((source.prepared.n_original, *rows.shape[1:]), missing, dtype=rows.dtype)
    full[source.prepared.kept] = rows
    return full
