"""The winding number of a point cloud, on a regular grid.

The normals of the points are unknown. They are found as those whose winding number is one half at
all points and whose direction is that of its gradient there, while the field is smoothed less and
less (Lin, Shi & Liu, ACM TOG 2024). Fourier transforms compute the field and its gradient.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt
import scipy.fft as fft
from scipy.ndimage import map_coordinates

from unbend._arrays import unit_vectors
from unbend._types import FloatArray

ComplexArray = npt.NDArray[np.complex128]

MARGIN = 0.15  # of the grid around the points, in sizes
_SMOOTHING = (3.0, 0.7)  # standard deviation of the Gaussian in cells, at first and in the end
_STEPS = 20


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

    def values(self, field: FloatArray) -> FloatArray:
        """Interpolate a field at the points, (n,)."""
        return np.asarray((self._weights * field.ravel()[self._nodes]).sum(axis=1))

    def at(self, field: FloatArray, places: FloatArray) -> FloatArray:
        """Interpolate a field at any places (m, 3), 0 beyond the grid."""
        return np.asarray(map_coordinates(field, ((places - self.origin) / self.cell).T, order=1))

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


def winding_number(grid: Grid, n: int) -> tuple[FloatArray, FloatArray]:
    """Find normals (n, 3) of the points, times their areas, and the winding number on the grid."""
    normals = np.zeros((n, 3))
    squared = np.asarray(sum(wave**2 for wave in grid.waves))
    inverse = 1j / (2 * np.pi * np.where(squared > 0, squared, np.inf))
    for smoothing in np.geomspace(*_SMOOTHING, _STEPS):
        kernel = inverse * np.exp(-2 * (np.pi * smoothing) ** 2 * squared)
        # One step of steepest descent towards a winding number of one half at all points.
        winding = _winding(grid, kernel, normals)
        missing = 0.5 - _inside(grid, winding)
        spectrum = kernel.conj() * grid.spectrum(missing)
        step = np.stack([grid.values(grid.field(wave * spectrum)) for wave in grid.waves], axis=1)
        turned = _winding(grid, kernel, step)
        change = _inside(grid, turned)
        length = missing @ change / max(float(change @ change), 1e-300)
        normals, winding = normals + length * step, winding + length * turned
        # The normals turn to the gradient and keep their lengths.
        slope = [grid.values(grid.field(-1j * wave * winding)) for wave in grid.waves]
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = unit_vectors(np.stack(slope, axis=1)) * lengths
    field = grid.field(_winding(grid, kernel, normals))
    return normals, field - _outside(field)


def _winding(grid: Grid, kernel: ComplexArray, normals: FloatArray) -> ComplexArray:
    """Fourier transform of the smoothed winding number."""
    flux = sum(
        wave * grid.spectrum(column) for wave, column in zip(grid.waves, normals.T, strict=True)
    )
    return np.asarray(kernel * flux)


def _inside(grid: Grid, spectrum: ComplexArray) -> FloatArray:
    """Winding number (n,) of the points, 0 outside."""
    field = grid.field(spectrum)
    return grid.values(field) - _outside(field)


def _outside(field: FloatArray) -> float:
    """Mean of a field on three faces of the grid, which periodicity makes all of its boundary."""
    return float(field[0].mean() + field[:, 0].mean() + field[:, :, 0].mean()) / 3
