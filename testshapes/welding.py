"""Parts of a surface that have grown together, as in a scan of hands on hips."""

import numpy as np

from testshapes.damage import Damaged, largest_piece, unchanged
from testshapes.measures import along_edges, area, face_normals
from unbend._arrays import snap
from unbend._types import BoolArray, FloatArray, IntArray
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
    >>> from unbend.datasets import make_biped
    >>> from testshapes.welding import weld
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


def fuse(mesh: Mesh, share: float = 0.01, *, random_state: int | None = None) -> Damaged:
    """Let two parts that touch, or nearly, grow together over a patch, which is then inside.

    Parameters
    ----------
    mesh : Mesh
        A single closed surface.
    share : float, default=0.01
        Of the area, that is lost on each of the two; less where the patch would be no disc.
    random_state : int or None, default=None
        As for :func:`weld`.

    Returns
    -------
    Damaged
        Closed and manifold, with one handle more.

    Examples
    --------
    >>> from unbend import diagnose
    >>> from unbend.datasets import make_biped
    >>> from testshapes.welding import fuse
    >>> diagnose(fuse(make_biped(n_vertices=600).mesh, random_state=0).mesh).genus
    1
    """
    ends = touching(mesh, np.random.default_rng(random_state))
    ways = along_edges(mesh, np.array(ends))
    goal = share * area(mesh)
    one, other = (_patch(mesh, way, goal, _REACH * ways[0, ends[1]]) for way in ways)
    walls = _zip(mesh.vertices, one[1], other[1])
    faces = np.concatenate([mesh.faces[~(one[0] | other[0])], walls])
    return largest_piece(mesh, faces)


def _patch(mesh: Mesh, way: FloatArray, goal: float, furthest: float) -> tuple[BoolArray, IntArray]:
    """Faces around a vertex, a disc, and the vertices on its rim as the disc's faces turn."""
    order = np.argsort(snap(way), kind="stable")
    sizes = np.linalg.norm(face_normals(mesh), axis=1) / 2
    for n_inside in range(max(1, int((way < furthest).sum())), 0, -1):
        inside = np.zeros(mesh.n_vertices, dtype=bool)
        inside[order[:n_inside]] = True
        gone = np.asarray(inside[mesh.faces].any(axis=1))
        if n_inside > 1 and sizes[gone].sum() > goal:
            continue
        rim = _only_rim(mesh.faces[gone])
        if rim is not None and not inside[rim].any():
            return gone, rim
    raise InputError(f"{mesh.name} is not closed where its parts touch")


def _only_rim(faces: IntArray) -> IntArray | None:
    """Vertices around a patch in their order, if it has one rim that does not touch itself."""
    sides = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    paired = {(b, a) for a, b in sides.tolist()}
    after = {a: b for a, b in sides.tolist() if (a, b) not in paired}
    n_sides = sum((a, b) not in paired for a, b in sides.tolist())
    if not after:
        return None
    rim = [next(iter(after))]
    while after[rim[-1]] != rim[0]:
        rim.append(after[rim[-1]])
        if len(rim) > len(after):
            return None
    return np.array(rim) if len(rim) == n_sides else None


def _zip(vertices: FloatArray, one: IntArray, other: IntArray) -> IntArray:
    """Faces between two rims, from where they are nearest on, both walked through alike."""
    other = other[::-1]
    gaps = np.linalg.norm(vertices[one][:, None] - vertices[other][None], axis=2)
    first = np.unravel_index(int(snap(gaps).argmin()), gaps.shape)
    one, other = np.roll(one, -first[0]), np.roll(other, -first[1])
    done, other_done = _walked(vertices[one]), _walked(vertices[other])
    i = j = 0
    walls = []
    while i < len(one) or j < len(other):
        a, b = one[i % len(one)], other[j % len(other)]
        if j == len(other) or (i < len(one) and done[i] <= other_done[j]):
            i += 1
            walls.append([a, one[i % len(one)], b])
        else:
            j += 1
            walls.append([a, other[j % len(other)], b])
    return np.array(walls)


def _walked(points: FloatArray) -> FloatArray:
    """Share of a closed way that is done after each of its sides."""
    lengths = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    shares: FloatArray = np.cumsum(lengths) / lengths.sum()
    return shares


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
