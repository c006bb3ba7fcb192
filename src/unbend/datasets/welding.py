"""Parts of a surface that have grown together, as in a scan of hands on hips."""

from __future__ import annotations

import numpy as np

from unbend._arrays import snap
from unbend._types import FloatArray, IntArray
from unbend.datasets._measures import along_edges
from unbend.datasets.damage import Damaged, unchanged
from unbend.errors import InputError
from unbend.mesh import Mesh

# Of the longest way on the shape: what touches and is farther apart than this is not neighbouring.
_FAR = 0.5
_PROBES = 400
_REACH = 0.25  # of the way between the two parts: how far from its middle a weld may reach


def weld(mesh: Mesh, n_tubes: int = 1, *, random_state: int | None = None) -> Damaged:
    """Join two parts that touch, or nearly, by tubes: each a handle of the surface.

    Parameters
    ----------
    mesh : Mesh
        A single connected surface.
    n_tubes : int, default=1
        Each from a face of the one part to the nearest free face of the other, whose place it
        takes: the surface stays closed and manifold.
    random_state : int or None, default=None
        Seed of the vertices between which the nearest parts are looked for.

    Returns
    -------
    Damaged

    Raises
    ------
    InputError
        If there is no room for so many tubes.

    Examples
    --------
    >>> from unbend import diagnose
    >>> from unbend.datasets import make_biped, weld
    >>> diagnose(weld(make_biped(n_vertices=600).mesh, 2, random_state=0).mesh).genus
    2
    """
    chance = np.random.default_rng(random_state)
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
    return unchanged(Mesh(mesh.vertices, faces, name=mesh.name))


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
