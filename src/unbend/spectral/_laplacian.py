"""The Laplacian of a mesh: stiffness matrix W and lumped vertex areas a."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import get_args

import numpy as np
import scipy.sparse as sp

from unbend._arrays import check_choice
from unbend._display import Brief
from unbend._memory import check_robust_memory
from unbend._parallel import run_all, slices
from unbend._types import FloatArray, IntArray, SparseMatrix
from unbend.choices import AreaKind, LaplacianKind
from unbend.errors import MeshError, SolverError, warn
from unbend.io import MeshLike, as_mesh
from unbend.mesh import FACES_AT_ONCE, Mesh, has_earlier_twin, measure_corners, measure_faces
from unbend.preparation import (
    Prepared,
    check_area,
    check_size,
    describe_seams,
    join_seams,
    prepare,
)
from unbend.spectral._assembly import assemble_stiffness, mixed_voronoi
from unbend.spectral._point_cloud import cloud_operator

# Rows may sum to this share of the largest entry; vertices may miss this share of the area.
_SUMS, _LOST = 1e-9, 1e-9
# Share of the area that the robust Laplacian may add to it before that is said.
_WIDENED = 0.01


@dataclass(frozen=True, eq=False, repr=False)
class Laplacian(Brief):
    """A discrete Laplace-Beltrami operator ``diag(areas)^-1 stiffness``.

    Attributes
    ----------
    stiffness : (n, n) sparse array of float64
        W: symmetric, positive semi-definite, rows sum to zero. It does not depend on scale.
    areas : (n,) ndarray of float64
        Lumped vertex areas, in squared units of length; zero at unreferenced vertices.
    kind : str
        ``"cotangent"`` or ``"robust"``: what ``"auto"`` chose.
    """

    stiffness: SparseMatrix
    areas: FloatArray
    kind: str


def laplacian(
    mesh: MeshLike, *, laplacian: LaplacianKind = "auto", area_kind: AreaKind = "voronoi"
) -> Laplacian:
    """Discrete Laplace-Beltrami operator of a triangle mesh or a point cloud.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts. Repeated faces count once.
    laplacian : {"auto", "cotangent", "robust"}, default="auto"
        ``"cotangent"``: ``W_ij = -(cot alpha_ij + cot beta_ij) / 2`` (Pinkall and Polthier
        1993). ``"robust"``: the tufted intrinsic Delaunay Laplacian of Sharp and Crane (2020)
        for any triangle soup; for a point cloud, one from Delaunay triangles around its points.
        ``"auto"``: robust for point clouds and where a face is degenerate or an edge
        non-manifold, cotangent otherwise.
    area_kind : {"voronoi", "barycentric"}, default="voronoi"
        Lumped areas of the cotangent Laplacian: mixed Voronoi cells (Meyer et al. 2003) or a
        third of each triangle. The robust Laplacian has its own.

    Returns
    -------
    Laplacian

    Raises
    ------
    InputError
        If `laplacian` or `area_kind` is not one of the names above.
    MeshError
        If the cotangent Laplacian is asked for where it does not exist: a point cloud, or a
        mesh with a degenerate face. If no face has an area, the points of a cloud lie on lines,
        or the mesh is too small or too large for double precision. If the robust Laplacian does
        not fit into the memory that is free.
    SolverError
        If the rows do not sum to zero, an area is negative, or some of the area is lost.

    Warns
    -----
    UnbendWarning
        If the robust Laplacian changes the area of a mesh by more than a hundredth (it widens
        triangles thinner than about 1e-5 of the mean edge), if neighbouring points of a cloud
        disagree about much of the surface, or if seams, as of a texture, cut the surface open.

    Notes
    -----
    The factor 1/2 belongs to the weights; Eq. 5 of Yang, Obaseki and Chen (2019) omits it.

    Examples
    --------
    The area of the unit square is shared among its corners:

    >>> from unbend import laplacian
    >>> square = ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> laplacian(square).areas
    array([0.25, 0.25, 0.25, 0.25])
    """
    mesh = as_mesh(mesh)
    if seams := describe_seams(join_seams(mesh)[1], joined=False):
        warn(f"{mesh.name}: {seams}")
    if laplacian == "auto":
        prepared = prepare(mesh, connected=False)
        laplacian, kept = choose_kind(laplacian, prepared), prepared.kept_faces
    else:
        kept = np.flatnonzero(~has_earlier_twin(mesh.faces))
    if len(kept) < mesh.n_faces:
        mesh = Mesh(mesh.vertices, mesh.faces[kept], name=mesh.name)
    return operator_of(mesh, kept, laplacian, area_kind)


def operator_of(
    mesh: Mesh, numbers: IntArray, laplacian: LaplacianKind, area_kind: AreaKind
) -> Laplacian:
    """Build and check the operator, not "auto", of a mesh without repeated faces.

    Messages give faces their `numbers` (m,), in the mesh that these are from.
    """
    check_choice(area_kind, "area_kind", get_args(AreaKind))
    check_choice(laplacian, "laplacian", get_args(LaplacianKind))
    operator = _robust(mesh) if laplacian == "robust" else _cotangent(mesh, numbers, area_kind)
    stiffness, areas = operator.stiffness, operator.areas
    sums = np.abs(stiffness @ np.ones(len(areas)))
    if not sums.max() <= _SUMS * np.abs(stiffness.data).max(initial=0.0):
        raise SolverError(
            f"{mesh.name}: the rows of its Laplacian sum to as much as {sums.max():.1e}, not to "
            "zero"
        )
    if not areas.min() >= 0:
        raise SolverError(f"{mesh.name}: its Laplacian has a vertex area of {areas.min():.1e}")
    if laplacian == "robust" and not mesh.is_point_cloud:
        taken, area = float(areas.sum()), measure_faces(mesh.vertices, mesh.faces)[1]
        if abs(taken - area) > _WIDENED * area:
            warn(
                f"{mesh.name}: to the robust Laplacian its area is {taken:.3g}, but its faces have "
                f"{area:.3g}: they are too thin; remesh the shape"
            )
    return operator


def choose_kind(kind: LaplacianKind, prepared: Prepared) -> LaplacianKind:
    """Turn "auto" into the Laplacian that suits a prepared mesh."""
    if kind != "auto":
        return kind
    robust = prepared.mesh.is_point_cloud or prepared.robust_needed
    return "robust" if robust else "cotangent"


def _cotangent(mesh: Mesh, numbers: IntArray, area_kind: AreaKind) -> Laplacian:
    if mesh.is_point_cloud:
        raise MeshError(f'{mesh.name}: a point cloud has no cotangent Laplacian; use "robust"')
    faces, n = mesh.faces, mesh.n_vertices
    cotangents, corner_areas = np.empty(faces.shape), np.empty(faces.shape)

    def measure(part: slice) -> float:
        """Measure the corners of some faces, and give the area of these."""
        with np.errstate(over="ignore", invalid="ignore"):
            dots, squared, double_areas = measure_corners(mesh.vertices, faces[part])
            flat = double_areas <= np.finfo(float).eps * squared.max(axis=1)
            if flat.any() and np.isfinite(squared).all():
                raise MeshError(
                    f"{mesh.name}: face {numbers[part][flat][0]} has no area, so its cotangents "
                    'do not exist; use the "robust" Laplacian'
                )
            cotangents[part] = dots / double_areas[:, None]
            corner_areas[part] = double_areas[:, None] / 6
            if area_kind == "voronoi":
                corner_areas[part] = mixed_voronoi(squared, cotangents[part], double_areas / 2)
            return float(double_areas.sum() / 2)

    area = sum(run_all(partial(measure, part) for part in slices(len(faces), FACES_AT_ONCE)))
    if not 0 < area < np.inf:
        raise MeshError(f"{mesh.name}: its area is {area:g}; give coordinates in a sensible unit")
    vertex_areas: FloatArray = np.bincount(faces.ravel(), corner_areas.ravel(), n).astype(float)
    if not abs(vertex_areas.sum() - area) <= _LOST * area:
        raise SolverError(
            f"{mesh.name}: its vertices share out an area of {vertex_areas.sum():g}, but its faces "
            f"have {area:g}"
        )
    cotangents /= 2
    return Laplacian(assemble_stiffness(faces, cotangents, n), vertex_areas, "cotangent")


def _robust(mesh: Mesh) -> Laplacian:
    import robust_laplacian

    if mesh.is_point_cloud:
        return Laplacian(*cloud_operator(mesh), "robust")
    check_robust_memory(mesh.name, mesh.n_faces)
    check_area(mesh)
    kept, corners = np.unique(mesh.faces, return_inverse=True)
    part = Mesh(mesh.vertices[kept], corners.reshape(-1, 3), name=mesh.name)
    check_size(part)
    stiffness, mass = robust_laplacian.mesh_laplacian(part.vertices, part.faces)
    stiffness, areas = sp.csr_array(stiffness), mass.diagonal()
    if part.n_vertices < mesh.n_vertices:
        every, shape = np.arange(len(kept)), (mesh.n_vertices, len(kept))
        spread = sp.csr_array((np.ones(len(kept)), (kept, every)), shape=shape)
        stiffness, areas = spread @ stiffness @ spread.T, spread @ areas
    return Laplacian(stiffness, areas, "robust")
