"""From a body made of rounded cones to an even, closed triangle mesh of its skin.

The skin is found on a grid (naive surface nets, Gibson 1998), thinned by edge collapses, and evened
out by Delaunay flips and tangential smoothing on the exact implicit surface. A symmetric body is
meshed on the side x >= 0 only and then reflected, which makes the mirror map exact.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage, sparse
from scipy.spatial.transform import Rotation

from unbend._types import BoolArray, FloatArray, IntArray
from unbend.datasets._cones import Cones, newton_step
from unbend.datasets._halfmesh import collapse_short_edges, delaunay_flips
from unbend.errors import InputError
from unbend.mesh import edge_ends, face_normals, find_components

_COARSEST = 0.025  # grid spacing that no part of a body slips through


def skin(cones: Cones, n_vertices: int, *, meshing: int) -> tuple[FloatArray, IntArray, IntArray]:
    """Mesh the skin of a body with exactly so many vertices; also return its mirror map.

    `meshing` is the seed of the grid's orientation and offset. Raises InputError if no grid gives a
    connected surface without handles.
    """
    rng = np.random.default_rng(meshing)
    # A turn about x keeps the left-right symmetry; so does any shift in y and z.
    turn = 0.0 if meshing == 0 else rng.uniform(0.2, 1.3)
    rotation = Rotation.from_euler("x", turn).as_matrix()
    shift = rng.uniform(0, 0.01, 3) * [0, 1, 1]
    turned = cones.turned(rotation, shift)
    spacing = _COARSEST
    for _ in range(8):
        vertices, faces = surface_net(turned, spacing)
        on_plane = vertices[:, 0] == 0
        count = 2 * len(vertices) - int(on_plane.sum())
        n_edges = len(edge_ends(faces, len(vertices)))
        in_one = len(find_components(faces, len(vertices)).n_faces) == 1
        disk = in_one and len(vertices) - n_edges + len(faces) == 1
        if disk and count >= n_vertices:
            break
        spacing *= 0.95 if count >= n_vertices else min(0.95, (count / (1.15 * n_vertices)) ** 0.5)
    else:
        raise InputError("these proportions make parts touch or come off; choose milder ones")
    vertices, faces = _even_out(turned, vertices, faces, on_plane, n_vertices)
    return _reflect((vertices - shift) @ rotation, faces)


def surface_net(cones: Cones, spacing: float) -> tuple[FloatArray, IntArray]:
    """Mesh the side x >= 0 of a skin.

    One vertex per grid cell that the skin passes, one quad (two triangles) per crossed edge.
    """
    inside, origin = _inside(cones, spacing)
    inside = _well_composed(inside)
    corners = np.stack(_corners(inside))
    mixed = corners.any(axis=0) & ~corners.all(axis=0)
    number = np.full(mixed.shape, -1)
    number[mixed] = np.arange(mixed.sum())
    vertices = (np.argwhere(mixed) + 0.5) * spacing + origin
    vertices[np.argwhere(mixed)[:, 0] == 0, 0] = 0.0
    quads = []
    steps = np.eye(3, dtype=np.int64)
    for axis in range(3):
        u, v = steps[(axis + 1) % 3], steps[(axis + 2) % 3]
        crossed = np.diff(inside, axis=axis)
        if axis != 0:
            crossed[0] = False  # the plane x = -spacing / 2 belongs to the mirror image
        nodes = np.argwhere(crossed)
        ring = [number[tuple((nodes - away).T)] for away in (0 * u, u, u + v, v)]
        outward = inside[tuple(nodes.T)]
        quads.append(np.where(outward, ring, ring[::-1]).T)
    all_quads = np.concatenate(quads)
    return vertices, np.concatenate([all_quads[:, [1, 2, 3]], all_quads[:, [0, 1, 3]]])


def _corners(inside: BoolArray) -> list[BoolArray]:
    """View the eight corners of all grid cells."""
    ends = (slice(None, -1), slice(1, None))
    return [inside[i, j, k] for i in ends for j in ends for k in ends]


def _inside(cones: Cones, spacing: float) -> tuple[BoolArray, FloatArray]:
    """Which grid nodes are inside the body, and the position of node (0, 0, 0).

    The first layer of nodes is the mirror image of the second.
    """
    reach = np.maximum(cones.head_radii, cones.tail_radii) + 5 * cones.blend
    low = np.minimum(cones.heads, cones.tails) - reach[:, None]
    high = np.maximum(cones.heads, cones.tails) + reach[:, None]
    origin: FloatArray = low.min(axis=0) - 2 * spacing
    origin[0] = -0.5 * spacing
    shape: IntArray = np.ceil((high.max(axis=0) - origin) / spacing).astype(np.int64) + 3
    total = np.zeros(shape.tolist())
    for chain in range(cones.chains.max() + 1):
        members = np.flatnonzero(cones.chains == chain)
        first = np.floor((low[members].min(axis=0) - origin) / spacing).astype(int)
        last = np.ceil((high[members].max(axis=0) - origin) / spacing).astype(int) + 1
        first, last = np.clip(first, 0, shape), np.clip(last, 0, shape)
        if (first >= last).any():
            continue  # on the other side
        box = tuple(slice(i, j) for i, j in zip(first, last, strict=True))
        points = origin + spacing * np.mgrid[box].reshape(3, -1).T
        distance = np.full(len(points), np.inf)
        for member in members.tolist():
            np.minimum(distance, cones.distances(points, [member])[0], out=distance)
        total[box] += np.exp(np.minimum(-distance / cones.blend, 50)).reshape(last - first)
    return total > 1, origin


def _well_composed(inside: BoolArray) -> BoolArray:
    """Grow a solid without cavities until no two of its voxels touch by an edge or corner only.

    The surface net of such a solid is a manifold (Latecki 1997).
    """
    for _ in range(50):
        inside[0] = inside[1]
        before = int(inside.sum())
        for axis in range(3):
            rolled = np.moveaxis(inside, axis, 0)
            a, b = rolled[:, :-1, :-1], rolled[:, 1:, 1:]
            c, d = rolled[:, :-1, 1:], rolled[:, 1:, :-1]
            critical = (a == b) & (c == d) & (a != c)
            for view in (a, b, c, d):
                view |= critical
        views = _corners(inside)
        count = np.sum(views, axis=0)
        for near in range(4):
            pair = views[near], views[7 - near]
            alone = (count == 2) & pair[0] & pair[1]
            missing = (count == 6) & ~pair[0] & ~pair[1]
            for view in views:
                view |= alone | missing
        if int(inside.sum()) == before:
            break
    doubled = np.concatenate([inside[:0:-1], inside[1:]])
    return np.asarray(ndimage.binary_fill_holes(doubled)[len(inside) - 2 :])


def _even_out(
    cones: Cones, vertices: FloatArray, faces: IntArray, on_plane: BoolArray, n_vertices: int
) -> tuple[FloatArray, IntArray]:
    area = float(np.linalg.norm(face_normals(vertices, faces), axis=1).sum())
    even = (1.15 * area / n_vertices) ** 0.5  # edge length if all triangles were equilateral
    vertices, thickness = _relax(cones, vertices, faces, on_plane, 4)
    while (count := 2 * len(vertices) - int(on_plane.sum())) != n_vertices:
        goal = max(n_vertices, int(0.75 * count))
        # A limb needs a few vertices around it, however coarse the mesh.
        sizes = np.clip(thickness, 0.35 * even, even)
        n_before = len(vertices)
        vertices, faces, on_plane = collapse_short_edges(
            vertices, faces, on_plane, sizes, count - goal
        )
        if len(vertices) == n_before:
            raise InputError(f"{n_vertices} vertices are too few for these proportions")
        faces = delaunay_flips(vertices, faces, on_plane)
        vertices, thickness = _relax(cones, vertices, faces, on_plane, 2)
    for _ in range(4):
        faces = delaunay_flips(vertices, faces, on_plane)
        vertices, _ = _relax(cones, vertices, faces, on_plane, 2)
    return vertices, faces


def _relax(
    cones: Cones, vertices: FloatArray, faces: IntArray, on_plane: BoolArray, rounds: int
) -> tuple[FloatArray, FloatArray]:
    """Move every vertex towards the middle of its neighbours, staying on the implicit surface.

    Returns the vertices and the body's thickness where they were.
    """
    edges = edge_ends(faces, len(vertices))
    both = np.concatenate([edges, edges[:, ::-1]])
    # Seen from the plane, a neighbour off the plane counts twice: itself and its mirror image.
    weights = np.where(on_plane[both[:, 0]] & ~on_plane[both[:, 1]], 2.0, 1.0)
    mean = sparse.csr_array((weights, both.T), shape=(len(vertices),) * 2)
    degrees = mean.sum(axis=1)
    field, thickness = cones.local_field(vertices)
    # Where edges are longer than a limb is thick, smoothing would draw all to one side of it.
    lengths = np.linalg.norm(vertices[both[:, 0]] - vertices[both[:, 1]], axis=1)
    longest = np.zeros(len(vertices))
    np.maximum.at(longest, both[:, 0], lengths)
    step_size = 0.7 * np.clip(2.2 - longest / thickness, 0, 1)
    for _ in range(rounds):
        _, gradients = field(vertices)
        gradients /= np.linalg.norm(gradients, axis=1, keepdims=True)
        move = (mean @ vertices) / degrees[:, None] - vertices
        move -= np.einsum("ni,ni->n", move, gradients)[:, None] * gradients
        vertices = vertices + step_size[:, None] * move
        vertices[on_plane, 0] = 0
        for _ in range(2):
            vertices = newton_step(field, vertices)
            vertices[on_plane, 0] = 0
    return vertices, thickness


def _reflect(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Join the side x >= 0 with its mirror image along the plane."""
    n_half = len(vertices)
    off_plane = np.flatnonzero(vertices[:, 0] != 0)
    mirror = np.arange(n_half)
    mirror[off_plane] = n_half + np.arange(len(off_plane))
    images = vertices[off_plane] * [-1, 1, 1]
    faces = np.concatenate([faces, mirror[faces][:, ::-1]])
    return np.concatenate([vertices, images]), faces, np.concatenate([mirror, off_plane])
