"""What describes a shape whatever its pose: a vector to compare by Euclidean distance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from unbend._types import FloatArray
from unbend.collection._whole import whole_surface
from unbend.io import MeshLike, as_mesh
from unbend.linalg.lanczos import smallest_eigenpairs
from unbend.mesh import Mesh

DESCRIPTOR_VERSION = "wave-kernel-1"

_N_EIGENPAIRS = 100
# By Weyl's law eigenvalue i of a surface of unit area is about 4 pi i: waves from the first to the
# 80th, evenly in the logarithm, each about 40 % wide.
_ENERGIES = np.linspace(np.log(4 * np.pi * 0.8), np.log(4 * np.pi * 80), 20)
_WIDTH = 0.35
# Shares of the area at whose middles quantiles are taken.
_LEVELS = (np.arange(16) + 0.5) / 16
_LEAST = 1e-6


def descriptor(mesh: MeshLike) -> npt.NDArray[np.float32]:
    """Describe a shape whatever its pose, size and meshing, by numbers of a fixed count.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts: open, non-manifold, in pieces, or a point cloud.

    Returns
    -------
    (320,) ndarray of float32
        Alike for like shapes, by Euclidean distance.

    Raises
    ------
    MeshError
        If the mesh has no area.

    Notes
    -----
    Where waves of an energy are at home on a surface is the wave kernel signature of its points
    (Aubry, Schlickewei & Cremers, "The wave kernel signature", ICCV Workshops 2011). The
    descriptor holds its quantiles over the surface by area, of 20 energies, as logarithms. A
    difference is thus a ratio, on every scale, and nothing is weighted or trained.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.collection import descriptor
    >>> from unbend.datasets import make_biped, make_octopus
    >>> sitting, running = (
    ...     descriptor(make_biped(pose, n_vertices=900).mesh) for pose in ("sitting", "running")
    ... )
    >>> octopus = descriptor(make_octopus(n_vertices=900).mesh)
    >>> apart = np.linalg.norm
    >>> bool(3 * apart(sitting - running) < apart(sitting - octopus))
    True
    """
    return wave_quantiles(make_basis(as_mesh(mesh)))


class Basis(NamedTuple):
    """Eigenpairs of all of a mesh as one connected surface of unit area.

    Attributes
    ----------
    values : (k,) ndarray of float64
        The first is 0.
    functions : (n, k) ndarray of float64
    areas : (n,) ndarray of float64
    """

    values: FloatArray
    functions: FloatArray
    areas: FloatArray


def make_basis(mesh: Mesh) -> Basis:
    """Compute the eigenpairs that a shape is described by."""
    _, stiffness, areas = whole_surface(mesh)
    k = min(_N_EIGENPAIRS, len(areas) // 2)
    return Basis(*smallest_eigenpairs(stiffness, areas, k, tol=1e-5), areas)


def wave_quantiles(basis: Basis) -> npt.NDArray[np.float32]:
    """Descriptor of a shape whose eigenpairs are known; see :func:`descriptor`."""
    values, functions, areas = basis
    quantiles = _quantiles(np.log(_wave_kernel(values[1:], functions[:, 1:]) + _LEAST), areas)
    return np.asarray(quantiles.ravel() / np.sqrt(quantiles.size), dtype=np.float32)


def _wave_kernel(values: FloatArray, functions: FloatArray) -> FloatArray:
    """Wave kernel signature of each vertex at each energy, (n, 20)."""
    apart = _ENERGIES - np.log(np.maximum(values, 1e-12))[:, None]
    shares = np.exp(-(apart**2) / (2 * _WIDTH**2))
    shares /= np.maximum(shares.sum(axis=0), 1e-300)
    signature: FloatArray = functions**2 @ shares
    return signature


def _quantiles(columns: FloatArray, areas: FloatArray) -> FloatArray:
    """Quantiles over the surface of each column, (n_columns, 16)."""
    rows = []
    for column in columns.T:
        order = np.argsort(column)
        share = np.cumsum(areas[order]) - areas[order] / 2
        rows.append(np.interp(_LEVELS, share, column[order]))
    return np.array(rows)
