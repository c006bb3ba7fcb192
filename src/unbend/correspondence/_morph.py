"""Interpolation between two matched shapes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from unbend._arrays import is_number, sum_rows
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.alignment import nearest_rotation, procrustes
from unbend.correspondence._fitting import TIE, carried, extended, in_unmatched_components, joined
from unbend.correspondence._transfer import positions_on_target, warn_of_match
from unbend.deformation import ElasticSurface
from unbend.errors import InputError, warn
from unbend.io import MeshLike, as_mesh
from unbend.matching import Match
from unbend.mesh import Mesh, edge_ends
from unbend.preparation import join_seams, restrict

_MOST_RATIO = 5  # of sizes in one unit: millimetres and centimetres seldom differ by just ten

# Rotations are averaged over so many rings of neighbours, which hides the rounding to vertices.
_AVERAGED_RINGS = 4


def morph(source: MeshLike, target: MeshLike, match: Match | npt.ArrayLike, t: float) -> Mesh:
    """Shape between the source and the target, along a match.

    The source moves rigidly while its neighbourhoods rotate and stretch evenly. Limbs therefore
    rotate about their joints, and do not shrink on straight lines.

    Parameters
    ----------
    source, target : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    match : Match or (n_source,) array_like of int
        From source to target; or the target vertex of each source vertex, -1 where there is none.
        A match with barycentric coordinates (``match(..., barycentric=True)``) gives smoother
        shapes.
    t : float
        0 is exactly the source; 1 is the source on the target. Other values extrapolate.

    Returns
    -------
    Mesh
        With the source's vertices, in their order, and its faces. Parts without an image keep
        their shape and follow their neighbours. Components without any image follow the rigid
        motion, scaled like the rest; vertices that no face uses, the surface around them.

    Raises
    ------
    InputError
        If `t` is not finite, or the map does not fit the shapes.

    Warns
    -----
    UnbendWarning
        Of a match that is wrong in part, or whose parts differ in size, or that is a
        reflection, see :class:`unbend.Match`; and if one shape is more than five times as large as
        the other, unless `t` is 0 or 1.

    Notes
    -----
    Each end of an edge prescribes it: stretched by the share `t`, and rotated by the share `t` of
    the rotation of the end's neighbourhood. The vertices fit the means of both in least squares,
    by one sparse solve.

    References
    ----------
    After Xu, Zhang, Wang & Bao, "Poisson shape interpolation", Graphical Models 68(3), 2006, and
    Sorkine & Alexa, "As-rigid-as-possible surface modeling", SGP 2007.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.datasets import make_sphere
    >>> from unbend import morph
    >>> ball = make_sphere(2)
    >>> half = morph(ball, (3 * ball.vertices, ball.faces), np.arange(ball.n_vertices), 0.5)
    >>> np.linalg.norm(half.vertices, axis=1).round(6).tolist() == [2.0] * 162
    True
    """
    source, target = as_mesh(source, "source"), as_mesh(target, "target")
    if not is_number(t) or not np.isfinite(t):
        raise InputError(f"t must be a finite number, not {t!r}")
    warn_of_match(match, source)
    goal = positions_on_target(match, target, source)
    name = f"{source.name} to {target.name} at {t:g}"
    if t == 0:
        return Mesh(source.vertices, source.faces, name=name)
    whole, number = join_seams(source)
    part, kept, _ = restrict(whole, number == np.arange(len(number)))
    start, faces = part.vertices, part.faces
    goal, number = goal[kept], np.searchsorted(kept, number)
    moving = np.asarray(np.isfinite(np.hstack([goal, start])).all(axis=1))
    if moving.sum() < 3:
        raise InputError("fewer than 3 vertices of the source have an image: nothing to morph")
    rotation, translation = procrustes(start[moving], goal[moving], reflect=False)
    size, center = _growth(start, goal, moving, faces), start[moving].mean(axis=0)
    goal[~moving] = size * (start[~moving] - center) @ rotation.T + goal[moving].mean(axis=0)
    surface = _evenly_weighted(start, faces) if source.n_faces else None
    if surface is not None and not moving.all():
        loose = in_unmatched_components(faces, moving) & (surface.areas > 0)
        surface = joined(surface, loose)
        goal = extended(surface, goal, moving, rotation, size)
    if t == 1:
        if surface is not None:
            _carry_unused(surface, start, goal, size, ~moving)
        return Mesh(goal[number], source.faces, name=name)
    warn_of_units((_extent(source), _extent(target)), (source.name, target.name))
    # The shape changes in the source's own frame; then the rigid motion follows.
    goal = (goal - translation) @ rotation
    between = start + t * (goal - start)
    if surface is not None:
        between = _bend(surface, goal, between, t)
        _carry_unused(surface, start, between, 1 + t * (size - 1), ~moving)
    share = Rotation.from_rotvec(t * Rotation.from_matrix(rotation).as_rotvec()).as_matrix()
    travel = center @ rotation.T + translation - center
    between = (between - center) @ share.T + center + t * travel
    return Mesh(between[number], source.faces, name=name)


def warn_of_units(
    sizes: Sequence[float] | FloatArray, names: Sequence[str], advice: str = "use one"
) -> None:
    """Warn if one of some shapes is so much larger than another that units seem to differ."""
    least, most = int(np.argmin(sizes)), int(np.argmax(sizes))
    if 0 < _MOST_RATIO * sizes[least] < sizes[most]:
        warn(
            f"{names[most]} is {sizes[most] / sizes[least]:,.0f} times as large as "
            f"{names[least]}: they may be in different units; {advice}"
        )


def _extent(mesh: Mesh) -> float:
    """Longest side of the box around what is in use of a mesh."""
    vertices = mesh.vertices if mesh.is_point_cloud else mesh.vertices[np.unique(mesh.faces)]
    return float(np.max(np.nanmax(vertices, axis=0) - np.nanmin(vertices, axis=0)))


def _growth(start: FloatArray, goal: FloatArray, moving: BoolArray, faces: IntArray) -> float:
    """Length of the edges with images there, over that in the source."""
    i, j = edge_ends(faces, len(start)).T
    known = moving[i] & moving[j]
    spans = [(points[j] - points[i])[known] for points in (start, goal)]
    if not known.any():  # images are scattered
        spans = [points[moving] - points[moving].mean(axis=0) for points in (start, goal)]
    before, after = (float(np.linalg.norm(one, axis=1).sum()) for one in spans)
    return after / before if before > 0 else 1.0


def _carry_unused(
    surface: ElasticSurface, start: FloatArray, places: FloatArray, size: float, some: BoolArray
) -> None:
    """Move those of some vertices (n,) that no face uses with the surface around them, in place."""
    used = surface.areas > 0
    some = some & ~used
    if some.any():
        vectors = _rotation_vectors(surface, np.where(used[:, None], places, 0))[used]
        turns = size * Rotation.from_rotvec(vectors).as_matrix()
        moved = carried(start[some], start[used], places[used], turns, surface.areas[used])
        places[some] = moved


def _bend(surface: ElasticSurface, goal: FloatArray, straight: FloatArray, t: float) -> FloatArray:
    """Rotate and stretch edges by the share `t`; vertices that no face uses stay on the way."""
    used, n = surface.areas > 0, len(goal)
    before, after = surface.vertices, np.where(used[:, None], goal, 0)
    i, j = surface.edge_weights.nonzero()
    turns = _rotation_vectors(surface, after)[i]
    edges, images = before[j] - before[i], after[j] - after[i]
    # Without its end's rotation, an edge's image differs from the edge by stretch alone.
    still = Rotation.from_rotvec(turns).apply(images, inverse=True)
    wanted = Rotation.from_rotvec(t * turns).apply(edges + t * (still - edges))
    pull = sum_rows(j, wanted, n) - sum_rows(i, wanted, n)
    line = np.where(used[:, None], straight, 0)
    tie = TIE * max(len(i) / n, 1.0)
    fitted = surface.system_of(np.full(n, tie / 2)).solve((pull + tie * line) / 2)
    return np.where(used[:, None], fitted, straight)


def _evenly_weighted(points: FloatArray, faces: IntArray) -> ElasticSurface:
    """Surface with equal weights of its edges, and equal areas of the vertices in use."""
    n = len(points)
    used = np.isin(np.arange(n), faces)
    # Unreferenced vertices, which may be NaN, must not enter the equations: they are put at 0.
    surface = ElasticSurface(np.where(used[:, None], points, 0), faces, used / used.sum())
    i, j = edge_ends(faces, n).T
    links = sp.csr_matrix((np.ones(len(i)), (i, j)), shape=(n, n))
    return surface.with_edge_weights(sp.csr_matrix(links + links.T))


def _rotation_vectors(surface: ElasticSurface, places: FloatArray) -> FloatArray:
    """Rotation of each vertex's neighbourhood to a pose, (n, 3), in radians."""
    cross = surface.covariances(places).reshape(-1, 9)
    for _ in range(_AVERAGED_RINGS):
        cross = cross + surface.edge_weights @ cross
        cross /= np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), np.finfo(float).tiny)
    rotations = nearest_rotation(cross.reshape(-1, 3, 3).transpose(0, 2, 1))
    return np.asarray(Rotation.from_matrix(rotations).as_rotvec())
