"""Eigenpairs of a mesh's Laplacian."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse.csgraph as csgraph

from unbend._memory import check_memory
from unbend._types import FloatArray
from unbend.choices import AreaKind, LaplacianKind
from unbend.errors import InputError
from unbend.linalg.lanczos import smallest_eigenpairs
from unbend.linalg.signs import fix_signs
from unbend.spectral._cache import cache_key, load_eigenpairs, store_eigenpairs
from unbend.spectral._laplacian import Laplacian
from unbend.spectral._surface import Surface, make_surface

# Largest relative residual |W phi - lambda A phi| / |lambda A phi|, unless another is asked for.
_RESIDUAL = 1e-8


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The lowest eigenpairs ``W phi = lambda A phi`` of a Laplacian.

    Attributes
    ----------
    eigenvalues : (k,) ndarray of float64
        Ascending, in 1 / squared units of length; the first is exactly 0.
    eigenfunctions : (n, k) ndarray of float64
        One column each, area-orthonormal: ``Phi.T @ diag(areas) @ Phi = I``. The first is
        constant. Rows of unreferenced vertices are NaN.
    areas : (n,) ndarray of float64
        Lumped vertex areas, in squared units of length.
    laplacian : str
        Which Laplacian: ``"cotangent"`` or ``"robust"``.
    notes : tuple of str
        What was done to the input.
    """

    eigenvalues: FloatArray
    eigenfunctions: FloatArray
    areas: FloatArray
    laplacian: str
    notes: tuple[str, ...] = ()


def spectrum(
    mesh: Any,
    k: int,
    *,
    laplacian: LaplacianKind = "auto",
    areas: AreaKind = "voronoi",
    tol: float = _RESIDUAL,
    cache: bool = True,
) -> Spectrum:
    """Lowest `k` eigenvalues and eigenfunctions of the Laplace-Beltrami operator.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts. Several components are allowed: each has an
        eigenvalue 0 of its own.
    k : int
        How many, the constant eigenfunction included; at most the number of vertices in use.
    laplacian, areas : str
        See :func:`unbend.laplacian`.
    tol : float, default=1e-8
        Largest relative residual ``|W phi - lambda A phi| / |lambda A phi|``, in the norm of
        A^-1, that an eigenpair may have.
    cache : bool, default=True
        Look in the cache on disk first, and keep what was computed there. A cached spectrum
        with more eigenpairs serves a smaller `k`.

    Returns
    -------
    Spectrum

    Raises
    ------
    InputError
        If `k` is out of range.
    MeshError
        If the mesh cannot be used; the message names the vertex or face. If its computation does
        not fit into the memory that is free.
    SolverError
        If an eigenpair's residual stays larger than `tol`.

    Notes
    -----
    Signs follow one rule: an eigenfunction's area-weighted third moment is positive; where it
    vanishes (functions odd under a symmetry), its first entry of largest magnitude is.

    Examples
    --------
    >>> from unbend import spectrum
    >>> from unbend.datasets import make_sphere
    >>> spectrum(make_sphere(3), 4).eigenvalues.round(1)
    array([0., 2., 2., 2.])
    """
    surface = make_surface(mesh, laplacian=laplacian, areas=areas, connected=False)
    unit = eigenpairs(surface, k, tol=tol, cache=cache)
    expand = surface.prepared.expand
    return Spectrum(
        eigenvalues=unit.eigenvalues / surface.area,
        eigenfunctions=expand(unit.eigenfunctions / np.sqrt(surface.area)),
        areas=np.nan_to_num(expand(unit.areas * surface.area)),
        laplacian=unit.laplacian,
        notes=surface.prepared.notes,
    )


def eigenpairs(surface: Surface, k: int, *, tol: float = _RESIDUAL, cache: bool = True) -> Spectrum:
    """Lowest `k` eigenpairs of a surface at unit area, for its vertices in use; see `spectrum`."""
    operator = surface.operator
    if not 1 <= k <= surface.n_vertices:
        raise InputError(
            f"{surface.mesh.name}: asked for {k} eigenpairs, but a mesh of "
            f"{surface.n_vertices} vertices has 1 to {surface.n_vertices}"
        )
    key = cache_key(surface.mesh, operator.kind, surface.area_kind, tol) if cache else ""
    found = load_eigenpairs(key, k) if cache else None
    if found is None:
        # A basis of about 1.6 k + 75 vectors is behind k pairs, and their polishing copies them.
        check_memory(surface.mesh.name, surface.n_vertices, 4 * k + 75)
        found = solve(operator, k, tol)
        if cache:
            store_eigenpairs(key, *found)
    return Spectrum(*found, operator.areas, operator.kind)


def solve(operator: Laplacian, k: int, tol: float) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues (k,) and eigenfunctions (n, k) of a Laplacian, signs and null space fixed."""
    values, functions = smallest_eigenpairs(operator.stiffness, operator.areas, k, tol=tol)
    null = null_space(operator)[:, :k]
    values[: null.shape[1]] = 0.0
    functions[:, : null.shape[1]] = null
    return values, fix_signs(functions, operator.areas)


def null_space(operator: Laplacian) -> FloatArray:
    """Area-orthonormal functions constant on each component, (n, n_components), ones first."""
    count, label = csgraph.connected_components(operator.stiffness, directed=False)
    component_areas = np.bincount(label, operator.areas)
    # An orthogonal matrix whose first column is the constant, in units of each component.
    basis = np.eye(count)
    basis[:, 0] = np.sqrt(component_areas / component_areas.sum())
    basis, triangle = np.linalg.qr(basis)
    basis *= np.sign(triangle[0, 0])
    functions: FloatArray = (basis / np.sqrt(component_areas)[:, None])[label]
    return functions
