"""Shapes between two matched shapes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from unbend._arrays import is_number
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.alignment import nearest_rotation, procrustes
from unbend.correspondence._transfer import positions_on_target
from unbend.deformation import ElasticSurface
from unbend.errors import InputError
from unbend.io import MeshLike, as_mesh
from unbend.matching import Match
from unbend.mesh import Mesh, edge_ends

# Rotations are averaged over so many rings of neighbours, which hides the rounding to vertices.
_AVERAGED_RINGS = 4
# Ties every vertex to where a rigid motion alone would take it: the equations determine vertices
# only up to a translation, and those that no face uses not at all.
_TIE = 1e-5
_FAINT = 1e-6  # how little the whole's rotation counts beside that of a neighbourhood
_HELD = 1e3  # holds what has an image while what has none goes along


def morph(source: MeshLike, target: MeshLike, match: Match | npt.ArrayLike, t: float) -> Mesh:
    """Shape between the source and the target, along a match.

    The source turns and moves as a whole while its neighbourhoods turn on the shortest way and
    stretch evenly, so that limbs swing round their joints instead of shrinking on straight lines.

    Parameters
    ----------
    source, target : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    match : Match or (n_source,) array_like of int
        From source to target; or the target vertex of each source vertex, -1 where there is none.
        A match with barycentric coordinates (``match(..., barycentric=True)``) gives smoother
        shapes.
    t : float
        0 is the source, exactly; 1 the source laid onto the target. Values outside go on beyond.

    Returns
    -------
    Mesh
        With the source's vertices, in their order, and its faces. Parts without an image keep
        their shape and go along with what is next to them; vertices that no face uses move rigidly
        with the whole, and so do components without any image, which grow as the rest does.

    Raises
    ------
    InputError
        If `t` is not finite, or the map does not fit the shapes.

    Notes
    -----
    The edges of the in-between shape are prescribed, each the mean of what its two ends ask for:
    the edge stretched by `t` of its way and turned by `t` of the neighbourhood's rotation. The
    vertices then fit them in least squares, which a single sparse solve does.

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
    source, target = as_mesh(source), as_mesh(target)
    if not is_number(t) or not np.isfinite(t):
        raise InputError(f"t must be a finite number, not {t!r}")
    goal = positions_on_target(match, target)
    if len(goal) != source.n_vertices:
        raise InputError(
            f"the map has {len(goal)} rows, but {source.name} has {source.n_vertices} vertices"
        )
    name = f"{source.name} to {target.name} at {t:g}"
    if t == 0:
        return Mesh(source.vertices, source.faces, name=name)
    start = source.vertices
    moving = np.asarray(np.isfinite(np.hstack([goal, start])).all(axis=1))
    if moving.sum() < 3:
        raise InputError("fewer than 3 vertices of the source have an image: nothing to morph")
    rotation, translation = procrustes(start[moving], goal[moving], reflect=False)
    goal[~moving] = start[~moving] @ rotation.T + translation
    if not moving.all() and source.n_faces:
        goal = _carried_along(start, goal, moving, source.faces, rotation)
    if t == 1:
        return Mesh(goal, source.faces, name=name)
    # In the source's own frame, where only the change of shape is left, then turned as a whole.
    goal = (goal - translation) @ rotation
    between = _bend(start, goal, source.faces, t)
    center = start[moving].mean(axis=0)
    turn = Rotation.from_rotvec(t * Rotation.from_matrix(rotation).as_rotvec()).as_matrix()
    travel = center @ rotation.T + translation - center
    return Mesh((between - center) @ turn.T + center + t * travel, source.faces, name=name)


def _carried_along(
    start: FloatArray, goal: FloatArray, moving: BoolArray, faces: IntArray, rotation: FloatArray
) -> FloatArray:
    """Move parts without an image as what is next to them turns, or the whole, their shape kept."""
    surface, used = _evenly_weighted(start, faces)
    before, after = surface.vertices, np.where(used[:, None], goal, 0)
    i, j = surface.edge_weights.nonzero()
    edges, images = before[j] - before[i], after[j] - after[i]
    # How neighbourhoods turn is known where they have images, and spreads from there. Where too few
    # have any, the whole's rotation decides.
    known, mask = moving[i] & moving[j], sp.diags(moving.astype(np.float64))
    both_known = surface.with_edge_weights(sp.csr_matrix(mask @ surface.edge_weights @ mask))
    cross = both_known.covariances(after) + _FAINT * (edges**2).mean() * rotation.T
    ties = np.where(moving, 1.0, _TIE) / 2
    spread = surface.system_of(ties).solve(ties[:, None] * cross.reshape(-1, 9))
    turns = nearest_rotation(spread.reshape(-1, 3, 3).transpose(0, 2, 1))
    spans = [edges[known], images[known]]
    if not known.any():  # images are scattered
        spans = [points[moving] - points[moving].mean(axis=0) for points in (start, goal)]
    lengths = [np.linalg.norm(one, axis=1).sum() for one in spans]
    size = lengths[1] / lengths[0] if lengths[0] > 0 else 1.0
    ties = np.where(moving, _HELD, _TIE) / 2
    moved = surface.fit_places(surface.system_of(ties), ties[:, None] * after, turns, size)
    return np.where((used & ~moving)[:, None], moved, goal)


def _bend(start: FloatArray, goal: FloatArray, faces: IntArray, t: float) -> FloatArray:
    straight = start + t * (goal - start)
    if not len(faces):
        return straight
    surface, used = _evenly_weighted(start, faces)
    before, after = surface.vertices, np.where(used[:, None], goal, 0)
    i, j = surface.edge_weights.nonzero()
    turns = _rotation_vectors(surface, after)[i]
    edges, images = before[j] - before[i], after[j] - after[i]
    # Turned back by its end's rotation, an edge's image differs from the edge by stretch alone.
    still = Rotation.from_rotvec(turns).apply(images, inverse=True)
    wanted = Rotation.from_rotvec(t * turns).apply(edges + t * (still - edges))
    pull = _summed(j, wanted, len(start)) - _summed(i, wanted, len(start))
    line = np.where(used[:, None], straight, 0)
    tie = _TIE * max(len(i) / len(start), 1.0)
    fitted = surface.system_of(np.full(len(start), tie / 2)).solve((pull + tie * line) / 2)
    return np.where(used[:, None], fitted, straight)


def _evenly_weighted(points: FloatArray, faces: IntArray) -> tuple[ElasticSurface, BoolArray]:
    """Surface all of whose edges count the same, and the vertices in use; the others are at 0."""
    n = len(points)
    used = np.zeros(n, dtype=bool)
    used[faces] = True
    # What unreferenced vertices hold, perhaps NaN, must not enter the equations.
    surface = ElasticSurface(np.where(used[:, None], points, 0), faces, used / used.sum())
    i, j = edge_ends(faces, n).T
    links = sp.csr_matrix((np.ones(len(i)), (i, j)), shape=(n, n))
    return surface.with_edge_weights(sp.csr_matrix(links + links.T)), used


def _summed(at: IntArray, rows: FloatArray, n: int) -> FloatArray:
    """Add up the rows that go to the same place, (n, d)."""
    return np.stack([np.bincount(at, column, n) for column in rows.T], axis=1)


def _rotation_vectors(surface: ElasticSurface, places: FloatArray) -> FloatArray:
    """Rotation of each vertex's neighbourhood to a pose, (n, 3), in radians."""
    cross = surface.covariances(places).reshape(-1, 9)
    for _ in range(_AVERAGED_RINGS):
        cross = cross + surface.edge_weights @ cross
        cross /= np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), np.finfo(float).tiny)
    rotations = nearest_rotation(cross.reshape(-1, 3, 3).transpose(0, 2, 1))
    return np.asarray(Rotation.from_matrix(rotations).as_rotvec())
