"""What befalls a surface before it reaches us, with the truth kept.

Everything here returns a :class:`Damaged`, which says of every vertex which one it was, so that a
true map between two shapes is one between what is left of them: :func:`damaged_truth`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testshapes.measures import along_edges, area
from unbend._arrays import snap
from unbend._display import Brief
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.errors import InputError
from unbend.mesh import Mesh, find_edges
from unbend.preparation import prepare

_N_DRAWS = 20
_MISSED = 0.01


@dataclass(frozen=True, eq=False, repr=False)
class Damaged(Brief):
    """A surface to which something was done.

    Attributes
    ----------
    mesh : Mesh
    origin : (n,) ndarray of int64
        Of each of its vertices, the vertex of the whole surface that it is, or is nearest to.
    image : (n_whole,) ndarray of int64
        Of each vertex of the whole surface, the vertex that it is now; -1 where it is gone.
    """

    mesh: Mesh
    origin: IntArray
    image: IntArray

    def then(self, later: Damaged) -> Damaged:
        """Take what was done to ``self.mesh`` as done to the whole surface."""
        image = np.where(self.image >= 0, later.image[self.image], -1)
        return Damaged(later.mesh, self.origin[later.origin], image)


def damaged_truth(
    truth: IntArray, source: Damaged | None = None, target: Damaged | None = None
) -> IntArray:
    """Restrict a true map between two surfaces to what is left of them.

    Parameters
    ----------
    truth : (n_source,) ndarray of int64
        For each vertex of the whole source, the vertex of the whole target; -1 for none.
    source, target : Damaged or None
        What is left. None: all.

    Returns
    -------
    (n_source_left,) ndarray of int64
        For each vertex left of the source, the one left of the target; -1 where it is gone.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.datasets import make_sphere
    >>> from testshapes.damage import cut_discs, damaged_truth
    >>> ball = make_sphere(2)
    >>> torn = cut_discs(ball, 0.2, random_state=1)
    >>> truth = damaged_truth(np.arange(ball.n_vertices), target=torn)
    >>> int((truth >= 0).sum()) == torn.mesh.n_vertices
    True
    """
    if source is not None:
        truth = truth[source.origin]
    if target is not None:
        truth = np.where(truth >= 0, target.image[truth], -1)
    return truth


def unchanged(mesh: Mesh) -> Damaged:
    """Say that every vertex is still there, though maybe elsewhere."""
    every = np.arange(mesh.n_vertices)
    return Damaged(mesh, every, every)


def keep(mesh: Mesh, wanted: BoolArray) -> Damaged:
    """Keep the faces between wanted vertices, and of these the largest connected piece.

    Parameters
    ----------
    mesh : Mesh
    wanted : (n,) ndarray of bool

    Returns
    -------
    Damaged

    Examples
    --------
    >>> from unbend.datasets import make_biped
    >>> from testshapes.damage import keep
    >>> body = make_biped(n_vertices=600)
    >>> keep(body.mesh, body.labels != body.parts.index("left_arm")).mesh.n_vertices < 600
    True
    """
    return keep_faces(mesh, np.asarray(wanted[mesh.faces].all(axis=1)))


def keep_faces(mesh: Mesh, kept: BoolArray) -> Damaged:
    """Keep the largest connected piece of the chosen faces (m,), rims that touch themselves apart.

    A surface with two rims, or two stretches of one, that touch in a vertex is no manifold there:
    the faces around such vertices are left out.
    """
    faces = mesh.faces[kept]
    while (pinched := _pinched(faces, mesh.n_vertices)).any():
        faces = faces[~pinched[faces].any(axis=1)]
    return largest_piece(mesh, faces)


def largest_piece(mesh: Mesh, faces: IntArray) -> Damaged:
    """Keep the largest connected piece of faces (m, 3) between the vertices of a mesh."""
    left = prepare(Mesh(mesh.vertices, faces, name=mesh.name), component="largest")
    image = np.full(mesh.n_vertices, -1)
    image[left.kept] = np.arange(len(left.kept))
    return Damaged(left.mesh, left.kept, image)


def _pinched(faces: IntArray, n_vertices: int) -> BoolArray:
    """Vertices whose faces, some of those around it in a manifold, form more than one fan."""
    edges = find_edges(faces, n_vertices)
    inner = np.bincount(edges.ends[edges.n_faces == 2].ravel(), minlength=n_vertices)
    around = np.bincount(faces.ravel(), minlength=n_vertices)
    return np.asarray(around - inner > 1)


def cut(mesh: Mesh, height: FloatArray, share: float) -> Damaged:
    """Cut away a share of the area, from the lowest vertices up.

    What falls apart from the largest piece is lost with it and counts as cut away.

    Parameters
    ----------
    mesh : Mesh
        A single connected surface.
    height : (n,) ndarray of float64
        Anything: a coordinate for a plane, a distance for a disc around a point.
    share : float
        Of the area, to within a face and what falls off with it: 0 to less than 1.

    Returns
    -------
    Damaged

    Raises
    ------
    InputError
        If the share is out of range.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from testshapes.damage import cut
    >>> ball = make_sphere(3)
    >>> bool((cut(ball, ball.vertices[:, 2], 0.5).mesh.vertices[:, 2] > -0.2).all())
    True
    """
    if not 0 <= share < 1:
        raise InputError(f"the share to cut away must be from 0 to less than 1, not {share}")
    goal = (1 - share) * area(mesh)
    lowest = np.asarray(height)[mesh.faces].min(axis=1)
    order = np.argsort(snap(lowest), kind="stable")

    def without(n_faces: int) -> Damaged:
        kept = np.ones(mesh.n_faces, dtype=bool)
        kept[order[:n_faces]] = False
        return keep_faces(mesh, kept)

    few, many = 0, mesh.n_faces - 1
    while many - few > 1:
        middle = (few + many) // 2
        enough = area(without(middle).mesh) >= goal
        few, many = (middle, many) if enough else (few, middle)
    # Between the two lies a face, or what falls off with it.
    return min(without(few), without(many), key=lambda one: abs(area(one.mesh) - goal))


def cut_discs(
    mesh: Mesh, share: float, n_discs: int = 1, *, random_state: int | None = None
) -> Damaged:
    """Cut out discs around random vertices: a missing part, or holes.

    What a disc cuts off is lost with it. Where it is so much that the share is missed by more than
    a hundredth, other discs are drawn.

    Parameters
    ----------
    mesh : Mesh
        A single connected surface.
    share : float
        Of the area, for all discs and what falls off together.
    n_discs : int, default=1
    random_state : int or None, default=None
        Seed of the discs' middles.

    Returns
    -------
    Damaged

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from testshapes.damage import cut_discs
    >>> cut_discs(make_sphere(3), 0.25, 3, random_state=0).mesh.n_faces  # of 1280
    959
    """
    chance = np.random.default_rng(random_state)
    used, whole = np.unique(mesh.faces), area(mesh)
    tried = []
    for _ in range(_N_DRAWS):
        middles = chance.choice(used, n_discs, replace=False)
        left = cut(mesh, along_edges(mesh, middles, nearest=True), share)
        tried.append((abs(1 - share - area(left.mesh) / whole), left))
        if tried[-1][0] < _MISSED:
            break
    return min(tried, key=lambda one: one[0])[1]
