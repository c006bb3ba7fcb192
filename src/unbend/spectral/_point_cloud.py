"""The Laplacian of a point cloud, from Delaunay triangles around each of its points.

They form the tangential Delaunay complex of Boissonnat and Ghosh (2014). Every corner adds the
share of a triangle that lies in its own cell; Sharp and Crane (2020, section 5.7) add a third.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph as csgraph

from unbend._arrays import first_equal_row, unit_of
from unbend._parallel import run_all, slices
from unbend._types import BoolArray, FloatArray, IntArray, SparseMatrix
from unbend.errors import MeshError, SolverError, warn
from unbend.mesh import Mesh, label_linked, measure_corners
from unbend.preparation import check_size
from unbend.spectral._assembly import assemble_stiffness, mixed_voronoi

_NEIGHBOURS = 30
_ROWS = 8192  # points that a task works on
# Largest circumradius of a triangle, in distances to the farthest neighbour. Triangles of random
# points reach two thirds; larger ones bridge a gap.
_WIDEST = 0.8
# No triangle has an angle this close to 180 degrees, in radians: its corners are three points of a
# straight boundary, on a line but for rounding.
_FLAT = 1e-3
_PLACE = 1e-9  # points closer than this are at one place, in sizes of the cloud
_LINK = 1e6  # weight between points at one place, in sums of the weights around them
_POSITIVE = 0.1  # entry of the stiffness matrix between points with no surface beyond their edge
_ENERGY = 1e-6  # relative difference between two ways to the area
_AGREEMENT = 0.9  # share of the triangles' area that counts, below which there is a warning


class Triangulation(NamedTuple):
    """Triangles between the points of a cloud."""

    faces: IntArray  # (m, 3), each once; of the points at one place, only the first is a corner
    weights: FloatArray  # (m,) share that counts, up to 1 if all three corners agree on it
    first: IntArray  # (n,) for each point the first point at the same place


def delaunay_triangles(mesh: Mesh) -> Triangulation:
    """Find the Delaunay triangles around each point of a cloud; MeshError if there are none."""
    check_size(mesh)
    placed = (mesh.vertices - mesh.vertices.min(axis=0)) / unit_of(mesh.vertices)
    first = _first_at_place(placed)
    distinct = np.flatnonzero(first == np.arange(len(first)))
    points = placed[distinct]
    faces, found, unseen, widest = _triangles_around(points)
    dots, squared, double_areas = measure_corners(points, faces)
    solid = double_areas > -_FLAT * dots.min(axis=1)
    # The circumradius is the product of the edges over four times the area.
    edges = np.sqrt(squared.prod(axis=1))
    found &= solid[:, None] & (edges[:, None] <= 2 * double_areas[:, None] * widest[faces])
    used = found.any(axis=1)
    faces, areas = faces[used], double_areas[used] / 2
    shares = mixed_voronoi(squared[used], dots[used] / double_areas[used, None], areas)
    weights = (shares * (found | unseen)[used]).sum(axis=1) / areas
    if np.bincount(faces.ravel(), minlength=len(points)).min() == 0:
        raise MeshError(
            f"{mesh.name}: its points span no surface: those around some of them lie on one line; "
            "give points of a surface, or a mesh"
        )
    return Triangulation(distinct[faces], weights, first)


def cloud_operator(mesh: Mesh) -> tuple[SparseMatrix, FloatArray]:
    """Stiffness matrix and areas of a point cloud, as this module describes them.

    Points at one place share its area, and links between them keep functions equal there.
    """
    faces, weights, first = delaunay_triangles(mesh)
    n, unit = mesh.n_vertices, unit_of(mesh.vertices)
    dots, squared, double_areas = measure_corners(mesh.vertices / unit, faces)
    cotangents, areas = dots / double_areas[:, None], double_areas / 2
    agreed = weights @ areas / areas.sum()
    if agreed < _AGREEMENT:
        warn(
            f"{mesh.name}: neighbouring points disagree about {1 - agreed:.0%} of the surface: "
            "they are noisy, or too far apart to separate its parts; use more points, or a mesh"
        )
    stiffness = assemble_stiffness(faces, weights[:, None] * cotangents / 2, n)
    cells = unit**2 * _cells(faces, weights, squared, cotangents, areas, stiffness)
    copies = np.flatnonzero(first != np.arange(n))
    if len(copies):
        cells = (cells / np.bincount(first, minlength=n).clip(1))[first]
        firm = _LINK * stiffness.diagonal()[first[copies]]
        links = sp.csr_array((firm, (first[copies], copies)), shape=(n, n))
        stiffness = sp.csr_array(stiffness + csgraph.laplacian(links, symmetrized=True))
    check_energy(mesh, stiffness, cells)
    return stiffness, cells


def check_energy(mesh: Mesh, stiffness: SparseMatrix, areas: FloatArray) -> None:
    """Raise SolverError for weights and areas that are not those of one surface.

    The Dirichlet energy of the three coordinates, which follows from the weights alone, is twice
    the area of the surface.
    """
    upper = sp.triu(stiffness, 1, format="coo")
    squared = ((mesh.vertices[upper.row] - mesh.vertices[upper.col]) ** 2).sum(axis=1)
    energy, area = -float(upper.data @ squared), float(areas.sum())
    if not abs(energy / 2 - area) <= _ENERGY * area:
        raise SolverError(
            f"{mesh.name}: the weights of its Laplacian are those of an area of {energy / 2:g}, "
            f"but its points have {area:g}"
        )


def _cells(
    faces: IntArray,
    weights: FloatArray,
    squared: FloatArray,
    cotangents: FloatArray,
    areas: FloatArray,
    stiffness: SparseMatrix,
) -> FloatArray:
    """Area (n,) of the Voronoi cell of each point.

    The cell does not depend on which triangles there are between points on one circle. At an angle
    above 90 degrees it reaches beyond the triangle. Where there is no surface beyond, the
    triangle's area is shared as Meyer et al. (2003) do it.
    """
    n, rows, widest = stiffness.shape[0], np.arange(len(faces)), cotangents.argmin(axis=1)
    product = squared * cotangents
    voronoi = (np.roll(product, -1, axis=1) + np.roll(product, -2, axis=1)) / 8
    mixed = mixed_voronoi(squared, cotangents, areas)

    def add(shares: FloatArray) -> FloatArray:
        return np.bincount(faces.ravel(), (weights[:, None] * shares).ravel(), n).astype(float)

    facing = stiffness[faces[rows, (widest + 1) % 3], faces[rows, (widest + 2) % 3]]
    alone = (cotangents[rows, widest] < 0) & (facing > _POSITIVE)
    least = add(mixed) / 10
    while True:
        found = add(np.where(alone[:, None], mixed, voronoi))
        small = found < least
        if not small.any():
            return found
        alone |= small[faces].any(axis=1)


def _first_at_place(points: FloatArray) -> IntArray:
    """For each point the first one at the same place, (n,)."""
    from scipy.spatial import cKDTree

    first = first_equal_row(points)
    distinct, of_point = np.unique(first, return_inverse=True)
    close = cKDTree(points[distinct]).query_pairs(_PLACE, output_type="ndarray")
    place = label_linked(close.T, len(distinct))
    lowest = np.unique(place, return_index=True)[1]
    return np.asarray(distinct[lowest[place]][of_point])


def _triangles_around(points: FloatArray) -> tuple[IntArray, BoolArray, BoolArray, FloatArray]:
    """Delaunay triangles around each of n points at n places.

    Returns each triangle once (m, 3), its corners in increasing order; whether it is one of those
    around each of its corners (m, 3); whether it lies beyond the neighbours of a corner that seems
    to be on the boundary (m, 3); and the largest circumradius that a triangle around each point may
    have.
    """
    from scipy.spatial import cKDTree

    from unbend.spectral._fans import fans

    n, tree = len(points), cKDTree(points)
    k = min(_NEIGHBOURS, n - 1)

    def around(rows: slice) -> tuple[IntArray, FloatArray, BoolArray, IntArray]:
        distances, near = tree.query(points[rows], k + 1)  # the nearest is the point itself
        offsets = points[near[:, 1:]] - points[rows, None]
        squared = distances[:, 1:, None] ** 2
        planar = offsets @ _tangent_planes(offsets, squared)
        triangles, is_open = fans(planar / squared, near, _FLAT)
        return triangles, distances[:, -1], is_open, near[is_open]

    parts = run_all(partial(around, rows) for rows in slices(n, _ROWS))
    triangles, reach, is_open, near = (np.concatenate(part) for part in zip(*parts, strict=True))
    corners = np.sort(triangles, axis=1)
    order = np.lexsort(corners.T)
    centres, corners = triangles[order, :1], corners[order]
    new = np.diff(corners, axis=0, prepend=-1).any(axis=1)
    faces = corners[new]
    found = np.zeros(faces.shape, dtype=bool)
    found[np.cumsum(new) - 1, (corners == centres).argmax(axis=1)] = True
    unseen = ~found & is_open[faces]
    row, corner = np.nonzero(unseen)
    near = near[np.cumsum(is_open)[faces[row, corner]] - 1]
    seen = [(near == faces[row, (corner + c) % 3, None]).any(axis=1) for c in (1, 2)]
    unseen[row, corner] = ~(seen[0] & seen[1])
    # In a small cloud, all points are neighbours: any triangle may be one of its surface.
    return faces, found, unseen, reach * (_WIDEST if k < n - 1 else 1 / _FLAT)


def _tangent_planes(offsets: FloatArray, squared: FloatArray) -> FloatArray:
    """Axes (m, 3, 2) of planes fitted to the neighbours of points, the nearest above all.

    ``offsets`` (m, k, 3) lead to the neighbours; ``squared`` (m, k, 1) are their squared lengths.
    """
    farthest = squared[:, -1:]
    weights = (1 - squared / (9 / 8 * farthest)) ** 3
    total = weights.sum(axis=1, keepdims=True)
    middle = (weights * offsets).sum(axis=1, keepdims=True) / total
    second = (weights * offsets).transpose(0, 2, 1) @ offsets
    covariance = second - total * middle.transpose(0, 2, 1) @ middle
    axes: FloatArray = np.linalg.eigh(covariance / (total * farthest))[1]
    return axes[:, :, 1:]  # the first one, of the least eigenvalue, is the normal
