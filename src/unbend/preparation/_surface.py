"""A surface of a point cloud; docs/how-matching-works.md describes the steps."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from unbend._arrays import sum_rows, unit_of, unit_vectors
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.errors import MeshError
from unbend.io import MeshLike, as_mesh
from unbend.mesh import Mesh, find_components, label_linked, orient_consistently
from unbend.preparation._prepare import check_size
from unbend.preparation._tetrahedra import (
    LONGEST,
    Tetrahedra,
    boundary,
    find_inside,
    make_tetrahedra,
    split,
)
from unbend.preparation._winding_field import MARGIN, Grid, winding_number

_LEAST_POINTS = 500
_MOST_POINTS = 12_000  # that become vertices, about
_MOST_NODES = 4_000_000  # of the grid
_COARSEST = 2.0  # cell of the grid, in spacings of the points that become vertices
_NEIGHBOURS = 8  # that measure the spacing of points
_LONELY = 3.0  # an outlier's spacing, in those of the points around it
_FITTED = 24  # points that a quadric is fitted to
_MOST_FITTED = 100
_NOISE = 0.03  # median distance of points from the quadrics, in spacings, above which they move
_SMOOTHINGS = 2
_DEPTH = 4.0  # where in a ball the winding number is taken at most, in spacings
_REACH = 5.0  # distance of points from the surface, in spacings
_FACING = 0.3  # cosine of the angle between a face and the normals of its corners
_SMALL = 30  # area of an unsupported patch that is kept, in squared spacings
_LEAST_LEVEL = 0.3  # median winding number at the points; one half on a surface, 0 on a line
_LEAST_SHARE = 0.1  # of the points, that are on the largest piece of their surface
# Mean length of the mean unit normal of a point and its neighbours: 0.88 to 0.93 for bodies with
# noise of 1 % of their size, less where points are farther apart than parts are thick.
_AGREEMENT = 0.86
# Dimension of the set that points fill: up to 2.4 for bodies with noise of 1 % of their size, and
# from 2.55 on for a thousand points and more that fill a volume.
_MOST_DIMENSION = 2.5
_APART = 1e-6  # of the way to its faces, that a vertex keeps from that of another sheet
_FLAT = 1e-9  # thickness of a plane, in its lengths


class PointSurface(NamedTuple):
    """A surface of a point cloud.

    Attributes
    ----------
    mesh : Mesh
        Connected and manifold, its faces oriented outward.
    vertex_of_point : (n,) ndarray of int64, read-only
        The nearest vertex of each point; -1 for outliers.
    point_of_vertex : (m,) ndarray of int64, read-only
        The nearest point of each vertex.
    """

    mesh: Mesh
    vertex_of_point: IntArray
    point_of_vertex: IntArray


def surface_of_points(cloud: MeshLike) -> PointSurface:
    """Reconstruct the surface of a point cloud.

    Parameters
    ----------
    cloud : mesh-like
        A point cloud of at least 500 points.

    Returns
    -------
    PointSurface

    Raises
    ------
    MeshError
        If there are too few points, or they are too sparse or too noisy for a surface, fill a
        volume, or lie in a plane.

    References
    ----------
    Lin, Shi & Liu, "Fast and Globally Consistent Normal Orientation based on the Winding Number
    Normal Consistency", ACM TOG 2024.

    Examples
    --------
    >>> from unbend import Mesh, diagnose
    >>> from unbend.datasets import make_sphere
    >>> from unbend.preparation import surface_of_points
    >>> found = surface_of_points(Mesh(make_sphere(3).vertices))
    >>> health = diagnose(found.mesh)
    >>> health.closed, health.genus, round(health.area / 3.14159)
    (True, 0, 4)
    """
    return _surface_of_points(as_mesh(cloud))


@lru_cache(maxsize=2)  # meshes never change, and a match and a registration ask for the same
def _surface_of_points(cloud: Mesh) -> PointSurface:
    check_size(cloud)
    unit = unit_of(cloud.vertices)
    middle = (cloud.vertices / unit).mean(axis=0)
    everything = cloud.vertices / unit - middle
    axes = np.linalg.svd(everything.T @ everything)[0]
    axes[:, 2] *= np.linalg.det(axes)
    everything = everything @ axes
    points = np.unique(everything, axis=0)
    if len(points) < _LEAST_POINTS:
        raise MeshError(
            f"{cloud.name}: {len(points)} points at different positions are too few for a surface; "
            f"give at least {_LEAST_POINTS:,}"
        )
    points, spacing = _without_outliers(points)
    area = float(np.median(spacing) ** 2) * len(points)
    share = min(1.0, _MOST_POINTS / len(points))
    fine = np.sqrt(area / (share * len(points)))
    box = np.ptp(points, axis=0)
    cell = max(fine, float(np.cbrt((box + 2 * MARGIN * box.max()).prod() / _MOST_NODES)))
    if cell > _COARSEST * fine:
        raise MeshError(
            f"{cloud.name}: it is too long and thin to find the surface of its points, or has "
            "parts far apart; use a mesh"
        )
    if box.min() <= _FLAT * box.max():
        raise MeshError(f"{cloud.name}: its points lie in a plane, and have no inside; use a mesh")
    if _dimension(points) > _MOST_DIMENSION:
        raise MeshError(
            f"{cloud.name}: its points fill a volume, or are too noisy for a surface; use points "
            "of the surface alone, or a mesh"
        )
    grid = Grid(points, cell)
    normals, field = winding_number(grid, len(points))
    level = float(np.median(grid.values(field)))
    no_surface = MeshError(
        f"{cloud.name}: its points are too sparse or too noisy for a surface, or lie along lines; "
        "use more points, or a mesh"
    )
    if level < _LEAST_LEVEL or _agreement(points, normals) < _AGREEMENT:
        raise no_surface
    normals = unit_vectors(normals)
    chosen = np.arange(len(points))
    if share < 1:  # one point of each cell that has any
        chosen = np.unique(np.floor(points / fine), axis=0, return_index=True)[1]
    spacing = spacing[chosen] * np.sqrt(len(points) / len(chosen))
    points = _denoised(points, normals, chosen, spacing)
    tetrahedra = make_tetrahedra(points, spacing)
    winding, normals = _sides(tetrahedra, grid, field - level)
    faces, edges, cut = boundary(tetrahedra, find_inside(tetrahedra, normals, winding))
    kept = ~cut
    kept[kept] = _supported(faces[kept], points, normals, spacing)
    if kept[~cut].all():  # what is partial anyway stays open at cuts, too
        kept[:] = True
    if not kept.any():
        raise no_surface
    point, faces = split(faces[kept], edges[kept])
    largest = find_components(faces, len(point)).of_vertex == 0
    vertices = points[point[largest]]
    # Almost flat tetrahedra may have been wound inward.
    wound = orient_consistently(vertices, (np.cumsum(largest) - 1)[faces[largest[faces[:, 0]]]])
    assert wound is not None
    # Sheets that share a point stay apart: each one's vertex is a little nearer to its own faces.
    inward = sum_rows(wound.ravel(), np.repeat(vertices[wound].mean(axis=1), 3, 0), len(vertices))
    inward /= np.bincount(wound.ravel())[:, None]
    vertices += _APART * (inward - vertices)
    away, vertex_of_point = cKDTree(vertices).query(everything)
    vertex_of_point[away > _REACH * max(fine, cell)] = -1
    if (vertex_of_point >= 0).mean() < _LEAST_SHARE:
        raise no_surface
    point_of_vertex = cKDTree(everything).query(vertices)[1]
    for numbers in (vertex_of_point, point_of_vertex):  # others get the same
        numbers.setflags(write=False)
    mesh = Mesh((vertices @ axes.T + middle) * unit, wound, name=cloud.name, notes=cloud.notes)
    return PointSurface(mesh, vertex_of_point, point_of_vertex)


def triangulate_points(cloud: Mesh) -> Mesh:
    """Join the points of a cloud by triangles along its surface, to draw them.

    Each vertex of the surface moves to the nearest point. The other points then split the triangles
    beside them; outliers are no corners. The result has the order of the points, and need not be
    manifold. Raises MeshError if :func:`surface_of_points` finds no surface.
    """
    found = surface_of_points(cloud)
    faces = np.sort(found.point_of_vertex[found.mesh.faces], axis=1)
    _, first = np.unique(faces, axis=0, return_index=True)
    faces = found.point_of_vertex[found.mesh.faces[first]]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    rest = np.setdiff1d(np.flatnonzero(found.vertex_of_point >= 0), faces)
    while len(rest):  # one of them splits a triangle in each round
        middles = cloud.vertices[faces].mean(axis=1)
        nearest = cKDTree(middles).query(cloud.vertices[rest])[1]
        split, chosen = np.unique(nearest, return_index=True)
        a, b, c = faces[split].T
        point = rest[chosen]
        parts = np.stack([[a, b, point], [b, c, point], [c, a, point]]).transpose(0, 2, 1)
        faces = np.concatenate([np.delete(faces, split, axis=0), parts.reshape(-1, 3)])
        rest = np.delete(rest, chosen)
    notes = *cloud.notes, "a point cloud, drawn with triangles between its points"
    return Mesh(cloud.vertices, faces, name=cloud.name, notes=notes)


def _without_outliers(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points that are not much farther apart than those around them, and their spacing."""
    distances, near = cKDTree(points).query(points, _NEIGHBOURS + 1)
    farthest = distances[:, -1]
    kept = farthest <= _LONELY * np.median(farthest[near[:, 1:]], axis=1)
    return points[kept], farthest[kept] * np.sqrt(np.pi / _NEIGHBOURS)


def _dimension(points: FloatArray) -> float:
    """Dimension of the set that points fill, by how the number of neighbours grows with distance.

    Eight times as many are the square root of eight times as far away on a surface.
    """
    count, some = max(_NEIGHBOURS, len(points) // 200), max(1, len(points) // 1000)
    distances = cKDTree(points).query(points[::some], [count + 1, 8 * count + 1])[0]
    return float(np.log(8) / np.median(np.log(distances[:, 1] / distances[:, 0])))


def _agreement(points: FloatArray, normals: FloatArray) -> float:
    """Mean length of the mean unit normal of each point and its neighbours, 0 to 1."""
    near = cKDTree(points).query(points, _NEIGHBOURS + 1)[1]
    return float(np.linalg.norm(unit_vectors(normals)[near].mean(axis=1), axis=1).mean())


def _denoised(
    points: FloatArray, normals: FloatArray, chosen: IntArray, spacing: FloatArray
) -> FloatArray:
    """Move chosen points along their normals to quadrics through their neighbours, if noisy."""
    fitted = min(_FITTED * len(points) // len(chosen), _MOST_FITTED)
    around, points, normals = (points, normals), points[chosen], normals[chosen]
    for _ in range(_SMOOTHINGS):
        heights = _heights(points, normals, *around, fitted)
        if np.median(np.abs(heights) / spacing) < _NOISE:
            break
        points = points + normals * heights[:, None]
        around, fitted = (points, normals), _FITTED
    return points


def _heights(
    points: FloatArray, normals: FloatArray, others: FloatArray, their: FloatArray, fitted: int
) -> FloatArray:
    """Height (n,), over each point, of a quadric through the others that face its way."""
    distances, near = cKDTree(others).query(points, fitted)
    width = distances[:, -1:] / 2
    weights = np.exp(-((distances / width) ** 2))
    weights *= np.maximum(np.einsum("ni,nki->nk", normals, their[near]), 0)
    u = unit_vectors(np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)]))
    offsets = (others[near] - points[:, None]) / width[..., None]
    axes = (u, np.cross(normals, u), normals)
    x, y, height = (np.einsum("nki,ni->nk", offsets, axis) for axis in axes)
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)
    weighted = weights[..., None] * terms
    left = np.einsum("nki,nkj->nij", weighted, terms) + 1e-6 * np.eye(6)
    right = np.einsum("nki,nk->ni", weighted, height)
    constant = np.linalg.solve(left, right[..., None])[:, 0, 0]
    return np.asarray(np.clip(constant, -1, 1) * width[:, 0])


def _sides(
    tetrahedra: Tetrahedra, grid: Grid, winding: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Winding number (t,) in the empty balls, and normals (n, 3) of the points.

    A normal leads to or from the centre of the largest ball at its point. Sheets that face each
    other have their largest balls on opposite sides, however close they are.
    """
    points, corners, centres = tetrahedra.points, tetrahedra.corners, tetrahedra.centres
    depth = _DEPTH * np.maximum(tetrahedra.spacing, grid.cell)

    def towards(start: FloatArray, end: FloatArray, most: FloatArray) -> FloatArray:
        way = end - start
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
        return grid.at(winding, start + way * np.minimum(1, most / length)[:, None])

    order = np.argsort(tetrahedra.radii)
    largest = np.zeros(len(points), dtype=np.int64)
    largest[corners[order].ravel()] = np.repeat(order, 4)  # the last one stays
    outward = np.where(towards(points, centres[largest], depth) < 0, 1, -1)
    normals = unit_vectors(centres[largest] - points) * outward[:, None]
    middles = points[corners].mean(axis=1)
    return towards(middles, centres, depth[corners].mean(axis=1)), normals


def _supported(
    faces: IntArray, points: FloatArray, normals: FloatArray, spacing: FloatArray
) -> BoolArray:
    """Which faces (m,) are short and turned like the points, or lie in a small patch of others."""
    corners, scale = points[faces], spacing[faces].mean(axis=1)
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    across = np.cross(sides[:, 1], sides[:, 2])
    facing = (unit_vectors(across) * unit_vectors(normals[faces].mean(axis=1))).sum(axis=1)
    supported = (longest <= LONGEST * scale) & (facing > _FACING)
    rest = faces[~supported]
    links = np.repeat(rest[:, 0], 2), rest[:, 1:].ravel()
    patch = label_linked(links, len(points))[rest[:, 0]]
    area = np.linalg.norm(across[~supported], axis=1) / 2 / scale[~supported] ** 2
    supported[~supported] = (np.bincount(patch, area) < _SMALL)[patch]
    return np.asarray(supported)
