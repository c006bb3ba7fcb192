"""What describes a shape whatever its pose: a vector to compare by Euclidean distance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from unbend._memory import check_memory
from unbend._types import FloatArray
from unbend.collection._whole import whole_surface
from unbend.errors import SolverError
from unbend.io import MeshLike, as_mesh
from unbend.linalg.lanczos import smallest_eigenpairs, working_columns
from unbend.mesh import Mesh

DESCRIPTOR_VERSION = "heat-wave-3"

# By Weyl's law eigenvalue i of a surface of unit area is about 4 pi i, so these reach 1200.
_N_EIGENPAIRS = 100
_EQUAL = 1e-4  # eigenvalues that differ by no more than this share count as one
# Times from where the last eigenfunction is damped to a tenth to where the first few are, evenly
# in the logarithm.
_TIMES = np.geomspace(2e-3, 0.3, 8)
# Energies of the waves, from the first eigenvalue's to that of the 80th, evenly in the logarithm.
# Their widths overlap, so that it does not matter on which side of an energy an eigenvalue lies.
_ENERGIES = np.linspace(np.log(4 * np.pi * 0.8), np.log(4 * np.pi * 80), 12)
_WIDTH = 0.7
_LEVELS = (np.arange(16) + 0.5) / 16  # shares of the area up to which quantiles reach
_LOST = 1e-4  # by how much a signature's mean over the surface, known beforehand, may be missed
# Signatures and variances below these are noise, and have no logarithm to speak of.
_LEAST_SIGNATURE, _LEAST_VARIANCE = 1e-6, 1e-3


def descriptor(mesh: MeshLike) -> npt.NDArray[np.float32]:
    """Describe a shape whatever its pose, size and meshing.

    Pieces of the surface are joined, boundaries are closed, and tiny pieces are left out.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts: open, non-manifold, in pieces, or a point cloud.

    Returns
    -------
    (206,) ndarray of float32
        Similar shapes have a small Euclidean distance. Only descriptors of one
        ``DESCRIPTOR_VERSION`` can be compared.

    Raises
    ------
    MeshError
        If the mesh has no area, or its computation does not fit into the memory that is free.
    SolverError
        If its eigenpairs do not reach their accuracy, or the integrals of its signatures are off.

    References
    ----------
    Quantiles of the heat kernel signature (Sun, Ovsjanikov & Guibas, SGP 2009), and the covariance
    (Arsigny et al., SIMAX 29, 2007) of the wave kernel signature (Aubry, Schlickewei & Cremers,
    2011).

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.collection import descriptor
    >>> from unbend.datasets import make_biped, make_octopus
    >>> sitting, running = (
    ...     descriptor(make_biped(pose, n_vertices=600).mesh) for pose in ("sitting", "running")
    ... )
    >>> octopus = descriptor(make_octopus(n_vertices=600).mesh)
    >>> apart = np.linalg.norm
    >>> bool(3 * apart(sitting - running) < apart(sitting - octopus))
    True
    """
    return describe(make_basis(as_mesh(mesh)))


class Basis(NamedTuple):
    """Eigenpairs of a whole mesh, as one connected surface of unit area; the first value is 0."""

    values: FloatArray
    functions: FloatArray
    areas: FloatArray


def make_basis(mesh: Mesh) -> Basis:
    """Compute the eigenpairs that a shape is described by."""
    _, stiffness, areas = whole_surface(mesh)
    k = min(_N_EIGENPAIRS, len(areas) // 2)
    check_memory(mesh.name, len(areas), working_columns(len(areas), k + 1))
    values, functions = smallest_eigenpairs(stiffness, areas, k + 1, tol=1e-5)
    # All eigenfunctions of a multiple eigenvalue are used, or none: which of them come first
    # depends on the order of the vertices.
    ends = np.flatnonzero(np.diff(values) > _EQUAL * values[1:]) + 1
    kept = max(2, ends[-1])
    return Basis(values[:kept], functions[:, :kept], areas)


def describe(basis: Basis) -> npt.NDArray[np.float32]:
    """Descriptor of a shape whose eigenpairs are known; see :func:`descriptor`."""
    heat = heat_kernel(basis, _TIMES)
    waves = wave_kernel(basis, _ENERGIES, _WIDTH)
    # Over the surface, the heat kernel integrates to its trace, and the wave kernel to one.
    traces = np.exp(-np.outer(basis.values, _TIMES)).sum(axis=0)
    lost = max(np.abs(basis.areas @ heat / traces - 1).max(), np.abs(basis.areas @ waves - 1).max())
    if not lost <= _LOST:
        raise SolverError(f"the integrals of the shape's signatures are off by {lost:.1e}")
    heat = np.log(np.maximum(heat, _LEAST_SIGNATURE))
    waves = np.log(waves + _LEAST_SIGNATURE)
    blocks = quantiles(heat, basis.areas, _LEVELS).ravel(), log_covariance(waves, basis.areas)
    return np.concatenate([block / np.sqrt(block.size) for block in blocks]).astype(np.float32)


def heat_kernel(basis: Basis, times: FloatArray) -> FloatArray:
    """Heat kernel signature of each vertex at each time, (n, n_times)."""
    return np.asarray(basis.functions**2 @ np.exp(-np.outer(basis.values, times)))


def wave_kernel(basis: Basis, energies: FloatArray, width: float) -> FloatArray:
    """Wave kernel signature of each vertex at each energy, a logarithm: (n, n_energies)."""
    apart = energies - np.log(np.maximum(basis.values[1:], 1e-9))[:, None]
    shares = np.exp(-(apart**2) / (2 * width**2))
    shares /= np.maximum(shares.sum(axis=0), 1e-300)
    return np.asarray(basis.functions[:, 1:] ** 2 @ shares)


def quantiles(columns: FloatArray, areas: FloatArray, levels: FloatArray) -> FloatArray:
    """Quantiles over the surface of each column, (n_columns, n_levels)."""
    rows = []
    for column in columns.T:
        order = np.argsort(column, kind="stable")
        share = np.cumsum(areas[order]) - areas[order] / 2
        rows.append(np.interp(levels, share, column[order]))
    return np.array(rows)


def log_covariance(columns: FloatArray, areas: FloatArray) -> FloatArray:
    """Logarithm of the covariance matrix over the surface, as a vector with the matrix's norm."""
    centred = columns - areas @ columns
    values, vectors = np.linalg.eigh((centred * areas[:, None]).T @ centred)
    values = np.log(np.maximum(values, 0) + _LEAST_VARIANCE)
    logarithm = (vectors * values) @ vectors.T
    upper = np.triu_indices(len(values))
    weights = np.where(upper[0] == upper[1], 1, np.sqrt(2))
    return np.asarray(logarithm[upper] * weights)
