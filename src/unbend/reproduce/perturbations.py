"""What is done to a shape to see whether its canonical form withstands it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from unbend._arrays import nearest_rows, snap
from unbend._types import FloatArray, IntArray
from unbend.errors import InputError, MissingExtraError
from unbend.mesh import Mesh, edge_ends, vertex_normals
from unbend.preparation import prepare

_N_HOLES = 8
# Of the longest way on the shape: what touches and is farther apart than this is not neighbouring.
_FAR = 0.5
_PROBES = 400
_REACH = 0.25  # of the way between the two parts: how far from its middle a weld may reach


@dataclass(frozen=True, eq=False)
class Perturbed:
    """A shape to which something was done.

    Attributes
    ----------
    mesh : Mesh
    origin : (n,) ndarray of int64
        Of each of its vertices, the vertex of the clean shape that it is, or is nearest to.
    """

    mesh: Mesh
    origin: IntArray


def perturb(mesh: Mesh, kind: str, strength: float) -> Perturbed:
    """Do something to a shape; the same each time.

    Parameters
    ----------
    mesh : Mesh
        A single connected surface.
    kind : str
        ``"noise"``: normal noise along the normals, `strength` its standard deviation in mean
        edge lengths. ``"holes"`` and ``"part missing"``: eight discs, or one, around random
        vertices cut out, together this share of the vertices; of what falls apart the largest
        piece stays. ``"shortcut"``: two parts that touch, or nearly, joined by this many tubes.
        ``"decimation"``: reduced to this share of the faces by quadric collapses.
    strength : float

    Returns
    -------
    Perturbed

    Raises
    ------
    InputError
        If there is no such kind, or no room for so many tubes.
    MissingExtraError
        If decimation is asked for and fast-simplification is not installed.

    References
    ----------
    Garland and Heckbert, "Surface simplification using quadric error metrics", 1997.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from unbend.reproduce.perturbations import perturb
    >>> perturb(make_sphere(3), "part missing", 0.25).mesh
    Mesh(482 vertices, 922 faces)
    """
    chance = np.random.default_rng(0)
    every = np.arange(mesh.n_vertices)
    if kind == "noise":
        offsets = strength * mean_edge(mesh) * chance.standard_normal(mesh.n_vertices)
        vertices = mesh.vertices + offsets[:, None] * vertex_normals(mesh.vertices, mesh.faces)
        return Perturbed(Mesh(vertices, mesh.faces, name=mesh.name), every)
    if kind in ("holes", "part missing"):
        return _cut(mesh, strength, _N_HOLES if kind == "holes" else 1, chance)
    if kind == "shortcut":
        return Perturbed(_weld(mesh, int(strength), chance), every)
    if kind == "decimation":
        return _decimate(mesh, strength)
    raise InputError(f"there is no perturbation {kind!r}")


def mean_edge(mesh: Mesh) -> float:
    """Mean length of the sides of all faces."""
    return float(_edge_graph(mesh)[1].mean())


def _edge_graph(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    edges = edge_ends(mesh.faces, mesh.n_vertices)
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    return edges, lengths


def along_edges(mesh: Mesh, sources: IntArray, nearest: bool = False) -> FloatArray:
    """Lengths of the shortest ways along edges: (s, n), or (n,) from the nearest source."""
    edges, lengths = _edge_graph(mesh)
    n = mesh.n_vertices
    graph = sp.csr_matrix((snap(lengths), (edges[:, 0], edges[:, 1])), shape=(n, n))
    return np.asarray(dijkstra(graph, directed=False, indices=sources, min_only=nearest))


def _cut(mesh: Mesh, share: float, n_holes: int, chance: np.random.Generator) -> Perturbed:
    used = np.unique(mesh.faces)
    centers = chance.choice(used, n_holes, replace=False)
    away = along_edges(mesh, centers, nearest=True)
    gone = np.zeros(mesh.n_vertices, dtype=bool)
    gone[np.argsort(away, kind="stable")[: round(share * len(used))]] = True
    faces = mesh.faces[~gone[mesh.faces].any(axis=1)]
    left = prepare(Mesh(mesh.vertices, faces, name=mesh.name), component="largest")
    return Perturbed(left.mesh, left.kept)


def _weld(mesh: Mesh, n_tubes: int, chance: np.random.Generator) -> Mesh:
    """Join two parts by tubes, each from a face of the one to the nearest free face of the other.

    A tube takes the place of its two end faces: the surface stays closed and manifold.
    """
    here, there = touching(mesh, chance)
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    # Each end stays on its own part.
    ways = along_edges(mesh, np.array([here, there]))
    one, other = (
        np.flatnonzero(way[mesh.faces].max(axis=1) < _REACH * ways[0, there]) for way in ways
    )
    taken = np.zeros(mesh.n_vertices, dtype=bool)
    gone: list[int] = []
    walls: list[IntArray] = []
    for face in one[_nearest_first(middles[one] - mesh.vertices[there])]:
        if len(gone) == 2 * n_tubes:
            break
        if taken[mesh.faces[face]].any():
            continue
        taken[mesh.faces[face]] = True
        for end in other[_nearest_first(middles[other] - middles[face])]:
            if not taken[mesh.faces[end]].any():
                taken[mesh.faces[end]] = True
                gone += [int(face), int(end)]
                walls.append(_tube(mesh.vertices, mesh.faces[face], mesh.faces[end]))
                break
    if len(walls) < n_tubes:
        raise InputError(f"{mesh.name} has room for {len(walls)} tubes, not {n_tubes}")
    faces = np.concatenate([np.delete(mesh.faces, gone, axis=0), *walls])
    return Mesh(mesh.vertices, faces, name=mesh.name)


def _nearest_first(offsets: FloatArray) -> IntArray:
    return np.argsort(snap(np.linalg.norm(offsets, axis=1)), kind="stable")


def touching(mesh: Mesh, chance: np.random.Generator) -> tuple[int, int]:
    """Two vertices that are near in space and far apart on the shape: a hand and the hip, say."""
    used = np.unique(mesh.faces)
    probes = chance.permutation(used)[:_PROBES]
    ways = along_edges(mesh, probes)
    longest = ways[:, used].max()
    gaps = np.linalg.norm(mesh.vertices[probes][:, None] - mesh.vertices[None, :], axis=2)
    gaps[~(ways > _FAR * longest) | ~np.isfinite(ways)] = np.inf
    here, there = np.unravel_index(int(snap(gaps).argmin()), gaps.shape)
    a, b = int(probes[here]), int(there)
    # The probes are few: the nearest on this side is found from the other.
    ways_back = along_edges(mesh, np.array([b]))[0]
    gaps_back = np.linalg.norm(mesh.vertices - mesh.vertices[b], axis=1)
    gaps_back[~(ways_back > _FAR * longest) | ~np.isfinite(ways_back)] = np.inf
    if np.isfinite(gaps_back).any():
        a = int(snap(gaps_back).argmin())
    return a, b


def _tube(vertices: FloatArray, start: IntArray, end: IntArray) -> IntArray:
    """Six faces between the rims of two faces, the less twisted of the three ways to join them."""
    rims = [np.roll(end[::-1], shift) for shift in range(3)]
    twist = np.array([np.linalg.norm(vertices[one] - vertices[start]) for one in rims])
    rim = rims[int(snap(twist).argmin())]
    walls = []
    for i in range(3):
        j = (i + 1) % 3
        walls += [[start[i], start[j], rim[j]], [start[i], rim[j], rim[i]]]
    return np.array(walls)


def _decimate(mesh: Mesh, share: float) -> Perturbed:
    try:
        from fast_simplification import simplify
    except ImportError:
        raise MissingExtraError("fast-simplification", "reproduce") from None
    # It wants arrays that it might write to.
    vertices, faces = simplify(mesh.vertices.copy(), mesh.faces.copy(), target_reduction=1 - share)
    left = prepare(Mesh(vertices, faces, name=mesh.name), component="largest")
    return Perturbed(left.mesh, nearest_rows(left.mesh.vertices, mesh.vertices))
