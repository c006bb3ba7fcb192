"""A surface of a point cloud.

The surface is where the winding number of oriented points is one half. Their normals are unknown.
They are found as those whose winding number is one half at all points and whose direction is that
of its gradient there, while the field is smoothed less and less (Lin, Shi & Liu, "Fast and Globally
Consistent Normal Orientation based on the Winding Number Normal Consistency", ACM TOG 2024). On a
regular grid, Fourier transforms compute the field and its gradient. Marching tetrahedra extract
the surface, and what no points support is removed from it.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.fft as fft
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from unbend._arrays import unit_of
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.errors import MeshError
from unbend.mesh import Mesh, edge_ends, find_components, find_edges, vertex_normals
from unbend.mesh.decimation import decimate
from unbend.preparation._prepare import check_size

ComplexArray = npt.NDArray[np.complex128]

_LEAST_POINTS = 500
_MOST_CELLS = 12_000  # of the grid that the surface crosses, about
_MOST_NODES = 4_000_000
_NEIGHBOURS = 8  # that measure the spacing of points
_LONELY = 3.0  # an outlier's spacing, in those of the points around it
_SMOOTHING = (3.0, 0.7)  # standard deviation of the Gaussian in cells, at first and in the end
_STEPS = 20
_REACH = 2.5  # distance of points from the surface, in cells or spacings
_FACING = (
    0.3  # cosine of the angle between the normals of a point and of the surface that it supports
)
_SMALL = 30  # cells of an unsupported patch that is kept
_LEAST_LEVEL = 0.3  # median winding number at the points; one half on a surface, 0 on a line
# Mean length of the mean unit normal of a point and its neighbours: 0.84 for points that fill a
# volume, 0.88 to 0.93 for bodies with noise of 1 % of their size.
_AGREEMENT = 0.86
_MARGIN = 0.15  # of the grid around the points, in sizes
_MOST_NODES = 20_000_000  # of the grid, which take 0.8 GiB
_NEAREST = 0.02  # distance of a vertex to a node of the grid, in edges


class PointSurface(NamedTuple):
    """A surface of a point cloud.

    Attributes
    ----------
    mesh : Mesh
        Connected and manifold, its faces oriented outward.
    vertex_of_point : (n,) ndarray of int64
        The nearest vertex of each point; -1 for outliers.
    point_of_vertex : (m,) ndarray of int64
        The nearest point of each vertex.
    """

    mesh: Mesh
    vertex_of_point: IntArray
    point_of_vertex: IntArray


@lru_cache(maxsize=2)  # meshes never change, and a match and a registration ask for the same
def surface_of_points(cloud: Mesh) -> PointSurface:
    """Reconstruct the surface of a point cloud.

    Parameters
    ----------
    cloud : Mesh
        A point cloud of at least 500 points.

    Returns
    -------
    PointSurface

    Raises
    ------
    MeshError
        If there are too few points, or they are too sparse or too noisy for a surface.

    References
    ----------
    Lin, Shi & Liu, "Fast and Globally Consistent Normal Orientation based on the Winding Number
    Normal Consistency", ACM TOG 2024.

    Examples
    --------
    >>> from unbend import Mesh, diagnose
    >>> from unbend.datasets import make_sphere
    >>> from unbend.preparation import surface_of_points
    >>> found = surface_of_points(Mesh(make_sphere(4).vertices))
    >>> health = diagnose(found.mesh)
    >>> health.closed, health.genus, round(health.area / 3.14159)
    (True, 0, 4)
    """
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
    cell = np.sqrt(area / min(len(points), _MOST_CELLS))
    extent = np.ptp(points, axis=0)
    cell = max(cell, np.cbrt((extent + 2 * _MARGIN * extent.max()).prod() / _MOST_NODES))
    reach = np.maximum(cell, spacing)
    grid = _Grid(points, cell, cloud.name)
    normals, field = _winding_number(grid, len(points))
    level = float(np.median(grid.values(field)))
    if level < _LEAST_LEVEL or _agreement(points, normals) < _AGREEMENT:
        raise MeshError(
            f"{cloud.name}: its points are too sparse or too noisy for a surface; use more points, "
            "or a mesh"
        )
    vertices, faces = _march(field, level)
    vertices = grid.origin + cell * vertices
    used, faces = _supported(vertices, faces, points, normals, reach, area / cell**2)
    vertices = vertices[used]
    kept, faces, _ = decimate(vertices, faces, min(len(points), _MOST_CELLS))
    vertices = vertices[kept]
    away, vertex_of_point = cKDTree(vertices).query(everything)
    vertex_of_point[away > 2 * _REACH * cell] = -1
    point_of_vertex = cKDTree(everything).query(vertices)[1]
    mesh = Mesh((vertices @ axes.T + middle) * unit, faces, name=cloud.name, notes=cloud.notes)
    return PointSurface(mesh, vertex_of_point, point_of_vertex)


def triangulate_points(cloud: Mesh) -> Mesh:
    """Join the points of a cloud by triangles along its surface, to draw them.

    Each vertex of the surface moves to the nearest point. The other points then split the triangles
    beside them; outliers are no corners. The result has the order of the points.

    Parameters
    ----------
    cloud : Mesh
        A point cloud of at least 500 points.

    Returns
    -------
    Mesh
        It need not be manifold.

    Raises
    ------
    MeshError
        If :func:`surface_of_points` finds no surface.

    Examples
    --------
    >>> from unbend import Mesh
    >>> from unbend.datasets import make_sphere
    >>> from unbend.preparation import triangulate_points
    >>> triangulate_points(Mesh(make_sphere(3).vertices)).n_vertices
    642
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


def _agreement(points: FloatArray, normals: FloatArray) -> float:
    """Mean length of the mean unit normal of each point and its neighbours, 0 to 1."""
    near = cKDTree(points).query(points, _NEIGHBOURS + 1)[1]
    return float(np.linalg.norm(_unit(normals)[near].mean(axis=1), axis=1).mean())


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300))


class _Grid:
    """Trilinear interpolation between points and a regular grid, and its frequencies."""

    def __init__(self, points: FloatArray, cell: float, name: str) -> None:
        low, high = points.min(axis=0), points.max(axis=0)
        margin = _MARGIN * (high - low).max() + 4 * cell
        self.shape = tuple(
            fft.next_fast_len(int(np.ceil(size / cell)), real=True)
            for size in high - low + 2 * margin
        )
        if np.prod(self.shape, dtype=np.float64) > _MOST_NODES:
            raise MeshError(
                f"{name}: it is too long and thin to find the surface of its points; use a mesh"
            )
        self.cell = cell
        self.origin = (low + high) / 2 - cell * (np.array(self.shape) - 1) / 2
        place = (points - self.origin) / cell
        node = np.floor(place).astype(np.int64)
        corners = np.array(list(product((0, 1), repeat=3)))
        self._nodes = np.ravel_multi_index(
            tuple((node[:, None] + corners).transpose(2, 0, 1)), self.shape
        )
        share = (place - node)[:, None]
        self._weights = np.where(corners == 1, share, 1 - share).prod(axis=2)
        x, y, z = self.shape
        self.waves = np.meshgrid(
            fft.fftfreq(x), fft.fftfreq(y), fft.rfftfreq(z), indexing="ij", sparse=True
        )
        self.squared: FloatArray = np.asarray(sum(wave**2 for wave in self.waves))

    def values(self, field: FloatArray) -> FloatArray:
        """Interpolate a field at the points, (n,)."""
        return np.asarray((self._weights * field.ravel()[self._nodes]).sum(axis=1))

    def spectrum(self, values: FloatArray) -> ComplexArray:
        """Fourier transform of the field that has these values (n,) at the points."""
        size = int(np.prod(self.shape))
        spread = np.bincount(
            self._nodes.ravel(), (self._weights * values[:, None]).ravel(), minlength=size
        )
        return np.asarray(fft.rfftn(spread.reshape(self.shape)))

    def field(self, spectrum: ComplexArray) -> FloatArray:
        """Invert a Fourier transform."""
        return np.asarray(fft.irfftn(spectrum, self.shape))


def _winding_number(grid: _Grid, n: int) -> tuple[FloatArray, FloatArray]:
    """Find normals (n, 3) of the points, times their areas, and the winding number on the grid."""
    normals = np.zeros((n, 3))
    squared = 2 * np.pi * np.where(grid.squared > 0, grid.squared, np.inf)
    for smoothing in np.geomspace(*_SMOOTHING, _STEPS):
        kernel = 1j * np.exp(-2 * (np.pi * smoothing) ** 2 * grid.squared) / squared
        # One step of steepest descent towards a winding number of one half at all points.
        missing = 0.5 - _inside(grid, _winding(grid, kernel, normals))
        spectrum = kernel.conj() * grid.spectrum(missing)
        step = np.stack([grid.values(grid.field(wave * spectrum)) for wave in grid.waves], axis=1)
        change = _inside(grid, _winding(grid, kernel, step))
        normals = normals + step * (missing @ change / max(float(change @ change), 1e-300))
        # The normals turn to the gradient and keep their lengths.
        spectrum = _winding(grid, kernel, normals)
        slope = [grid.values(grid.field(-1j * wave * spectrum)) for wave in grid.waves]
        normals = _unit(np.stack(slope, axis=1)) * np.linalg.norm(normals, axis=1, keepdims=True)
    field = grid.field(_winding(grid, kernel, normals))
    return normals, field - _outside(field)


def _winding(grid: _Grid, kernel: ComplexArray, normals: FloatArray) -> ComplexArray:
    """Fourier transform of the smoothed winding number."""
    flux = sum(
        wave * grid.spectrum(column) for wave, column in zip(grid.waves, normals.T, strict=True)
    )
    return np.asarray(kernel * flux)


def _inside(grid: _Grid, spectrum: ComplexArray) -> FloatArray:
    """Winding number (n,) of the points, 0 outside."""
    field = grid.field(spectrum)
    return grid.values(field) - _outside(field)


def _outside(field: FloatArray) -> float:
    """Mean of a field on three faces of the grid, which periodicity makes all of its boundary."""
    return float(field[0].mean() + field[:, 0].mean() + field[:, :, 0].mean()) / 3


def _march(field: FloatArray, level: float) -> tuple[FloatArray, IntArray]:
    """Extract a level set by marching tetrahedra, six to a cell: vertices, in cells, and faces.

    It is a closed manifold that separates the nodes above the level from the others, and its faces
    are oriented towards the others.
    """
    inside = field > level
    x, y, z = (size - 1 for size in field.shape)
    corners = product((0, 1), repeat=3)
    count = sum(inside[i : x + i, j : y + j, k : z + k].astype(np.int8) for i, j, k in corners)
    cells = np.argwhere((count > 0) & (count < 8))
    steps = np.eye(3, dtype=np.int64)
    tetrahedra = np.array(
        [[steps[list(order[:k])].sum(axis=0) for k in range(4)] for order in permutations(range(3))]
    )
    nodes = (cells[:, None, None] + tetrahedra).reshape(-1, 4, 3)
    numbers = np.ravel_multi_index(tuple(nodes.transpose(2, 0, 1)), field.shape)
    order = np.argsort(~inside.ravel()[numbers], axis=1, kind="stable")
    numbers = np.take_along_axis(numbers, order, axis=1)
    nodes = np.take_along_axis(nodes, order[:, :, None], axis=1)
    n_inside = inside.ravel()[numbers].sum(axis=1)
    cut = []  # the edges of tetrahedra at which the corners of faces are, (m, 3, 2)
    for k, edges in enumerate([(0, 1, 0, 2, 0, 3), (0, 2, 0, 3, 1, 3, 1, 2), (0, 3, 1, 3, 2, 3)]):
        some = n_inside == k + 1
        pairs = np.reshape(edges, (-1, 2))
        ends, middles = numbers[some][:, pairs], nodes[some][:, pairs].mean(axis=2)
        normal = np.cross(middles[:, 1] - middles[:, 0], middles[:, 2] - middles[:, 0])
        outward = nodes[some, k + 1 :].mean(axis=1) - nodes[some, : k + 1].mean(axis=1)
        inverted = (normal * outward).sum(axis=1) < 0
        ends[inverted] = ends[inverted][:, ::-1]
        cut += [ends[:, [0, i, i + 1]] for i in range(1, len(pairs) - 1)]
    ends = np.sort(np.concatenate(cut), axis=2)
    keys, faces = np.unique(ends[..., 0] * field.size + ends[..., 1], return_inverse=True)
    first, last = np.divmod(keys, field.size)
    start, end = field.ravel()[first], field.ravel()[last]
    share = np.clip((level - start) / (end - start), _NEAREST, 1 - _NEAREST)[:, None]
    tail, head = (np.stack(np.unravel_index(one, field.shape), axis=1) for one in (first, last))
    return tail * (1 - share) + head * share, faces.reshape(-1, 3)


def _supported(
    vertices: FloatArray,
    faces: IntArray,
    points: FloatArray,
    normals: FloatArray,
    reach: FloatArray,
    n_cells: float,
) -> tuple[IntArray, IntArray]:
    """Largest part of a surface that is near points on its side: its vertices, and its faces."""
    sides = vertex_normals(vertices, faces)
    away, near = cKDTree(points).query(vertices, _NEIGHBOURS)
    facing = np.einsum("ijk,ik->ij", _unit(normals)[near], sides) > _FACING
    above = np.einsum("ijk,ik->ij", points[near] - vertices[:, None], sides)
    beside = np.sqrt(np.maximum(away**2 - above**2, 0))
    close = (beside <= reach[near]) & (np.abs(above) <= _REACH * reach[near])
    supported = (facing & close).any(axis=1)
    # Small patches without points are noise or small holes.
    ends = edge_ends(faces, len(vertices))
    ends = ends[~supported[ends].any(axis=1)]
    graph = sp.coo_array((np.ones(len(ends)), ends.T), shape=(len(vertices),) * 2)
    patch = connected_components(graph, directed=False)[1]
    supported |= np.bincount(patch)[patch] < _SMALL * len(vertices) / n_cells
    faces = faces[supported[faces].all(axis=1)]
    while (pinched := _pinched(faces, len(vertices))).any():
        faces = faces[~pinched[faces].any(axis=1)]
    largest = find_components(faces, len(vertices)).of_vertex == 0
    used = np.flatnonzero(largest)
    return used, (np.cumsum(largest) - 1)[faces[largest[faces[:, 0]]]]


def _pinched(faces: IntArray, n: int) -> BoolArray:
    """Vertices (n,) where two boundaries meet."""
    edges = find_edges(faces, n)
    boundary = edges.ends[edges.n_faces == 1]
    return np.asarray(np.bincount(boundary.ravel(), minlength=n) > 2)
