"""The winding number of a point cloud, on a regular grid.

The normals of the points are unknown. They are found as those whose winding number is one half at
all points and whose direction is that of its gradient there, while the field is smoothed less and
less (Lin, Shi & Liu, ACM TOG 2024). The field solves a Poisson equation whose right side is the
divergence of the normals, by Fourier transforms.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.fft as fft
from scipy.ndimage import map_coordinates
from scipy.sparse import csr_array, vstack

from unbend._arrays import unit_vectors
from unbend._types import FloatArray

MARGIN = 0.15  # of the grid around the points, in sizes
_SMOOTHING = (3.0, 0.7)  # standard deviation of the Gaussian in cells, at first and in the end
_STEPS = 20


class _Stencil(NamedTuple):
    start: FloatArray  # (n, 3) a node near each point
    steps: tuple[int, ...]  # along an axis from there
    shares: tuple[FloatArray, ...]  # (n, 3) weight of the node at each step, along each axis


class Grid:
    """Trilinear interpolation between points and a regular grid, and its frequencies."""

    def __init__(self, points: FloatArray, cell: float) -> None:
        low, high = points.min(axis=0), points.max(axis=0)
        margin = MARGIN * (high - low).max() + 4 * cell
        self.shape = tuple(
            fft.next_fast_len(int(np.ceil(size / cell)), real=True)
            for size in high - low + 2 * margin
        )
        self.cell = cell
        self.origin = (low + high) / 2 - cell * (np.array(self.shape) - 1) / 2
        place = (points - self.origin) / cell
        below, nearest = np.floor(place), np.rint(place)
        over, off = place - below, place - nearest
        # Along an axis: linear between two nodes, or the slope of a quadratic through three.
        linear = _Stencil(below, (0, 1), (1 - over, over))
        slope = _Stencil(nearest, (-1, 0, 1), (off - 0.5, -2 * off, off + 0.5))
        self._interpolate = self._matrix([linear] * 3)
        stencils = [[slope if i == axis else linear for i in range(3)] for axis in range(3)]
        self._differentiate = vstack([self._matrix(one) for one in stencils], format="csr")
        x, y, z = self.shape
        waves = np.ix_(fft.fftfreq(x), fft.fftfreq(y), fft.rfftfreq(z))
        self._squared = (2 * np.pi) ** 2 * np.asarray(sum(wave**2 for wave in waves))

    def _matrix(self, stencils: Sequence[_Stencil]) -> csr_array:
        """Make the sparse matrix of a product of stencils, one along each axis."""
        nodes, weights = np.zeros((1, 1), dtype=np.int64), np.ones((1, 1))
        for axis, (start, steps, shares) in enumerate(stencils):
            along = start[:, axis, None].astype(np.int64) + steps
            share = np.stack([one[:, axis] for one in shares], axis=1)
            nodes = nodes[:, :, None] * self.shape[axis] + along[:, None]
            weights = weights[:, :, None] * share[:, None]
            nodes = nodes.reshape(len(along), -1)
            weights = weights.reshape(len(along), -1)
        starts = np.arange(0, nodes.size + 1, nodes.shape[1])
        shape = len(nodes), int(np.prod(self.shape))
        return csr_array((weights.ravel(), nodes.ravel(), starts), shape)

    def values(self, field: FloatArray) -> FloatArray:
        """Interpolate a field at the points, (n,)."""
        return np.asarray(self._interpolate @ field.ravel())

    def at(self, field: FloatArray, places: FloatArray) -> FloatArray:
        """Interpolate a field at any places (m, 3), 0 beyond the grid."""
        return np.asarray(map_coordinates(field, ((places - self.origin) / self.cell).T, order=1))

    def gradient(self, field: FloatArray) -> FloatArray:
        """Interpolate the gradient (n, 3) of a field at the points, a change per cell."""
        return np.asarray((self._differentiate @ field.ravel()).reshape(3, -1).T)

    def smoothing(self, width: float) -> FloatArray:
        """Filter by which a Poisson equation is solved for a field smoothed by a Gaussian."""
        squared = self._squared
        return np.exp(-(width**2) / 2 * squared) / np.where(squared > 0, squared, np.inf)

    def potential(self, values: FloatArray, smoothing: FloatArray) -> FloatArray:
        """Field whose negative Laplacian is the values (n,) at the points, up to a constant."""
        return self._solved(self._interpolate.T @ values, smoothing)

    def winding(self, normals: FloatArray, smoothing: FloatArray) -> FloatArray:
        """Winding number of points with normals (n, 3), up to a constant."""
        return self._solved(self._differentiate.T @ -normals.T.ravel(), smoothing)

    def _solved(self, right: FloatArray, smoothing: FloatArray) -> FloatArray:
        spectrum = smoothing * fft.rfftn(right.reshape(self.shape))
        return np.asarray(fft.irfftn(spectrum, self.shape))


def winding_number(grid: Grid, n: int) -> tuple[FloatArray, FloatArray]:
    """Find normals (n, 3) of the points, times their areas, and the winding number on the grid."""
    normals = np.zeros((n, 3))
    for width in np.geomspace(*_SMOOTHING, _STEPS):
        smoothing = grid.smoothing(width)
        # One step of steepest descent towards a winding number of one half at all points.
        field = grid.winding(normals, smoothing)
        missing = 0.5 - _inside(grid, field)
        step = -grid.gradient(grid.potential(missing, smoothing))
        turned = grid.winding(step, smoothing)
        change = _inside(grid, turned)
        length = missing @ change / max(float(change @ change), 1e-300)
        # The normals turn to the gradient and keep their lengths.
        slope = -grid.gradient(field + length * turned)
        areas = np.linalg.norm(normals + length * step, axis=1, keepdims=True)
        normals = unit_vectors(slope) * areas
    field = grid.winding(normals, smoothing)
    return normals, field - _outside(field)


def _inside(grid: Grid, field: FloatArray) -> FloatArray:
    """Winding number (n,) of the points, 0 outside."""
    return grid.values(field) - _outside(field)


def _outside(field: FloatArray) -> float:
    """Mean of a field on three faces of the grid, which periodicity makes all of its boundary."""
    return float(field[0].mean() + field[:, 0].mean() + field[:, :, 0].mean()) / 3
