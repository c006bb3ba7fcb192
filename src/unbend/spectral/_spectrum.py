"""Eigenpairs of a mesh's Laplacian."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse.csgraph as csgraph

from unbend._arrays import check_whole, is_number
from unbend._display import Brief
from unbend._memory import check_memory
from unbend._parallel import one_blas_thread
from unbend._types import FloatArray, IntArray
from unbend.choices import AreaKind, LaplacianKind
from unbend.errors import InputError, SolverError
from unbend.io import MeshLike
from unbend.linalg.lanczos import measure_eigenpairs, smallest_eigenpairs, working_columns
from unbend.linalg.signs import fix_basis, fix_signs
from unbend.spectral._cache import cache_key, load_eigenpairs, store_eigenpairs
from unbend.spectral._laplacian import Laplacian
from unbend.spectral._surface import Surface, make_surface, named

_RESIDUAL = 1e-8  # the largest, relative, unless another is asked for
# Part of the name of every cached file. Raise it whenever the eigenpairs of a mesh come out
# otherwise: the Laplacian, the solver, the basis of a multiple eigenvalue, or the signs.
_VERSION = 5
# How far from orthonormal eigenfunctions may be, and residuals, as one random combination of the
# pairs shows them, may exceed the tolerance: by as many times as chance makes of many pairs.
_SKEW, _CHANCE = 1e-7, 100.0
# Neighbouring eigenvalues are equal if they differ by no more than this share of the tolerance, or
# by what rounding leaves of equal ones, relative to the larger or to the mean distance of a
# surface's eigenvalues. Eigenfunctions in their space keep to the tolerance.
_EQUAL, _ROUNDING = 0.1, 1e-11
_MEAN_DISTANCE = 4 * np.pi  # at unit area, by Weyl's law


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(Brief):
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
    mesh: MeshLike,
    n_eigenpairs: int,
    *,
    laplacian: LaplacianKind = "auto",
    area_kind: AreaKind = "voronoi",
    tolerance: float = _RESIDUAL,
) -> Spectrum:
    """Lowest `n_eigenpairs` eigenvalues and eigenfunctions of the Laplace-Beltrami operator.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts. Several components are allowed: each has an
        eigenvalue 0 of its own.
    n_eigenpairs : int
        How many, the constant eigenfunction included; at most the number of vertices in use.
    laplacian, area_kind : str
        See :func:`unbend.laplacian`.
    tolerance : float, default=1e-8
        Largest relative residual ``|W phi - lambda A phi| / |lambda A phi|``, in the norm of
        A^-1, that an eigenpair may have.

    Returns
    -------
    Spectrum

    Raises
    ------
    InputError
        If `n_eigenpairs` or `tolerance` is out of range.
    MeshError
        If the mesh cannot be used; the message names the vertex or face. If its computation does
        not fit into the memory that is free.
    SolverError
        If an eigenpair's residual stays larger than `tolerance` and what rounding explains.

    Notes
    -----
    An eigenfunction's area-weighted third moment is positive; where it vanishes (functions odd
    under a symmetry), its first entry of largest magnitude is.

    Of a multiple eigenvalue's space (on symmetric shapes), the first function is the one that
    reaches the highest value at any vertex, each next one the one that does so among those
    orthogonal to it; of several such vertices the first decides. Eigenvalues count as equal if they
    differ by less than a tenth of `tolerance`.

    Eigenpairs are kept on disk, see :func:`unbend.spectral.use_cache`; this changes no result.

    Examples
    --------
    >>> from unbend import spectrum
    >>> from unbend.datasets import make_sphere
    >>> spectrum(make_sphere(3), 4).eigenvalues.round(1)
    array([0., 2., 2., 2.])
    """
    if not is_number(tolerance) or not 0 <= tolerance < 1:
        raise InputError(f"tolerance must be at least 0 and below 1, not {tolerance!r}")
    surface = make_surface(mesh, laplacian=laplacian, area_kind=area_kind, connected=False)
    unit = eigenpairs(surface, n_eigenpairs, tolerance=tolerance)
    expand = surface.prepared.expand
    return Spectrum(
        eigenvalues=unit.eigenvalues / surface.area,
        eigenfunctions=expand(unit.eigenfunctions / np.sqrt(surface.area)),
        areas=np.nan_to_num(expand(unit.areas * surface.area)),
        laplacian=unit.laplacian,
        notes=surface.prepared.notes,
    )


def eigenpairs(surface: Surface, k: int, *, tolerance: float = _RESIDUAL) -> Spectrum:
    """Lowest `k` eigenpairs of a surface at unit area, for its vertices in use; see `spectrum`.

    They are the same whatever the cache holds: one of a few numbers is computed.
    """
    operator, n = surface.operator, surface.n_vertices
    k = wanted = check_whole(k, f"{surface.mesh.name}: the number of eigenpairs", 1, n)
    while True:
        # One more at least: the last one shows whether those before it are whole eigenspaces.
        count = next((few for few in (5, 11) if few > wanted), -(-wanted // 10) * 10 + 1)
        count = min(count, n)
        key = cache_key(surface.mesh, _VERSION, operator.kind, surface.area_kind, tolerance, count)
        found = load_eigenpairs(key)
        if found is None or _lacking(operator, *found, tolerance):
            check_memory(surface.mesh.name, n, working_columns(n, count))
            with named(surface):
                found = whole_eigenpairs(operator, count, tolerance)
            store_eigenpairs(key, *found)
        values, functions = found
        if len(values) >= k:
            first = np.ascontiguousarray(functions[:, :k])
            return Spectrum(values[:k], first, operator.areas, operator.kind)
        wanted = count * 3 // 2


@one_blas_thread()  # so that pairs are the same for any number
def whole_eigenpairs(
    operator: Laplacian, count: int, tolerance: float
) -> tuple[FloatArray, FloatArray]:
    """Of the first `count` eigenpairs at unit area, those whose spaces are known to be whole.

    That is all but the last value's, or all there are. Null space, bases and signs are fixed.
    """
    label = csgraph.connected_components(operator.stiffness, directed=False)[1]
    null = null_space(operator, label, count)
    c = null.shape[1]
    if c == count:
        return np.zeros(count), fix_signs(null, operator.areas)
    if c == 1:
        values, functions = smallest_eigenpairs(
            operator.stiffness, operator.areas, count, tol=tolerance
        )
    else:
        values, functions = _of_components(operator, label, count, tolerance)
    values[:c], functions[:, :c] = 0.0, null
    # Functions of values near 0 may have some of the null space in them.
    along = (operator.areas[:, None] * null).T @ functions
    mixed = np.flatnonzero(np.abs(along[:, c:]).max(axis=0) > _ROUNDING) + c
    functions[:, mixed] -= null @ along[:, mixed]
    functions[:, mixed] /= np.sqrt(operator.areas @ functions[:, mixed] ** 2)
    equal = max(_EQUAL * tolerance, _ROUNDING) * np.maximum(values[1:], _MEAN_DISTANCE)
    equal[:c] = -1.0  # the null space has its basis
    ends = np.flatnonzero(np.append(True, np.diff(values) > equal))
    k = int(ends[-1]) if count < len(operator.areas) else count
    functions = fix_basis(functions[:, :k], values[:k], equal[: k - 1])
    values, functions = values[:k], fix_signs(functions, operator.areas)
    if lacking := _lacking(operator, values, functions, tolerance):
        raise SolverError(f"the eigenpairs were computed, and checked: {lacking}")
    return values, functions


def _lacking(
    operator: Laplacian, values: FloatArray, functions: FloatArray, tolerance: float
) -> str:
    """Say what eigenpairs lack, with the figure; nothing if they are what they should be."""
    skew, residual = measure_eigenpairs(
        operator.stiffness, operator.areas, values, functions, tolerance
    )
    if not skew <= _SKEW:
        return f"the eigenfunctions are orthonormal but for {skew:.1e}, above {_SKEW:g}"
    if not residual <= _CHANCE * tolerance:
        return f"their residual is about {residual:.1e}, above {tolerance:g}"
    return ""


def _of_components(
    operator: Laplacian, label: IntArray, count: int, tolerance: float
) -> tuple[FloatArray, FloatArray]:
    """Lowest pairs of labelled components, each solved by itself; one 0 of each comes first.

    As many are computed of each as its area lets expect, and more until the last is high enough.
    """
    rows = np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1])
    ks = [min(6 + int(count * operator.areas[own].sum()), len(own)) for own in rows]
    found = [(np.zeros(0), np.zeros((0, 0)))] * len(rows)
    most, short = count - len(rows), list(range(len(rows)))
    while short:
        for j in short:
            stiffness, areas = operator.stiffness[rows[j]][:, rows[j]], operator.areas[rows[j]]
            found[j] = smallest_eigenpairs(stiffness, areas, ks[j], tol=tolerance)
        values = np.concatenate([own[1:] for own, _ in found])
        lowest = np.argsort(values, kind="stable")[:most]
        highest = values[lowest[-1]] if len(lowest) == most else np.inf
        short = [j for j, own in enumerate(rows) if ks[j] < len(own) and found[j][0][-1] < highest]
        for j in short:
            ks[j] = min(2 * ks[j], len(rows[j]))
    functions = np.zeros((len(label), count))
    places = [(j, column) for j, k in enumerate(ks) for column in range(1, k)]
    for i, one in enumerate(lowest, len(rows)):
        j, column = places[one]
        functions[rows[j], i] = found[j][1][:, column]
    return np.append(np.zeros(len(rows)), values[lowest]), functions


def null_space(operator: Laplacian, label: IntArray, most: int) -> FloatArray:
    """At most so many area-orthonormal functions constant on components; the first is on all."""
    count = int(label.max()) + 1
    component_areas = np.bincount(label, operator.areas)
    # Columns of an orthogonal matrix. The first is the constant, in units of each component.
    basis = np.eye(count, min(count, most))
    basis[:, 0] = np.sqrt(component_areas / component_areas.sum())
    basis = np.linalg.qr(basis)[0]
    return np.asarray((basis / np.sqrt(component_areas)[:, None])[label])
