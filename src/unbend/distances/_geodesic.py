"""Geodesic distances: the heat method, or exact polyhedral ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from unbend._types import FloatArray, IntArray
from unbend.distances._metric import Metric
from unbend.errors import MeshError, MissingExtraError
from unbend.mesh import Mesh
from unbend.spectral import Surface


def geodesic_metric(surface: Surface, *, exact: bool) -> Metric:
    """Geodesic distance on a surface, at unit area."""
    one = _exact(surface.mesh) if exact else _heat(surface.mesh)
    scale = 1 / np.sqrt(surface.area)

    def from_sources(sources: IntArray) -> FloatArray:
        rows: FloatArray = np.stack([one(int(source)) for source in sources]) * scale
        return rows

    def between(samples: IntArray) -> FloatArray:
        rows = from_sources(samples)[:, samples]
        return (rows + rows.T) / 2  # the heat method is symmetric only in the limit

    return Metric(from_sources, between)


def _heat(mesh: Mesh) -> Callable[[int], FloatArray]:
    """Heat method (Crane et al. 2013) on the robust Laplacian."""
    import potpourri3d

    if mesh.is_point_cloud:
        solver = potpourri3d.PointCloudHeatSolver(mesh.vertices)
    else:
        solver = potpourri3d.MeshHeatMethodDistanceSolver(
            mesh.vertices, mesh.faces, use_robust=True
        )

    def one(source: int) -> FloatArray:
        distances = np.array(solver.compute_distance(source), dtype=np.float64)
        # The method fixes distances up to a constant, and leaves it slightly off at the source.
        distances -= distances[source]
        return np.maximum(distances, 0.0)

    return one


def _exact(mesh: Mesh) -> Callable[[int], FloatArray]:
    """Exact geodesics of the polyhedron (Mitchell, Mount and Papadimitriou 1987)."""
    if mesh.is_point_cloud:
        raise MeshError(f"{mesh.name}: a point cloud has no exact geodesics; use geodesic")
    try:
        from pygeodesic.geodesic import PyGeodesicAlgorithmExact
    except ImportError:
        raise MissingExtraError("pygeodesic", "exact") from None
    solver = PyGeodesicAlgorithmExact(mesh.vertices, mesh.faces)

    def one(source: int) -> FloatArray:
        distances, _ = solver.geodesicDistances(np.array([source]), None)
        return np.array(distances, dtype=np.float64)

    return one
