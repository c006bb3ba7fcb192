"""Geodesic distances: the heat method, or exact polyhedral ones."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.distances._metric import Metric
from unbend.errors import MeshError, MissingExtraError
from unbend.mesh import (
    Mesh,
    count_non_manifold_vertices,
    find_components,
    find_edges,
    has_earlier_twin,
)
from unbend.preparation import restrict
from unbend.spectral import Surface

_FromVertex = Callable[[int], FloatArray]


def geodesic_metric(surface: Surface, *, exact: bool) -> Metric:
    """Geodesic distance on a surface, at unit area."""
    one = (_exact if exact else _heat)(surface.mesh)
    scale = 1 / np.sqrt(surface.area)

    def from_sources(sources: IntArray) -> FloatArray:
        rows: FloatArray = np.stack([one(int(source)) for source in sources]) * scale
        return rows

    def between(samples: IntArray) -> FloatArray:
        rows = from_sources(samples)[:, samples]
        return (rows + rows.T) / 2  # the heat method is symmetric only in the limit

    return Metric(from_sources, between)


def geodesic_solver(mesh: Mesh, *, exact: bool) -> _FromVertex:
    """Geodesic distances from any vertex of a mesh, which may have several components.

    Parameters
    ----------
    mesh : Mesh
        With faces.
    exact : bool
        Exact polyhedral distances, or those of the heat method.

    Returns
    -------
    callable
        A vertex to the distances (n,) from it to all vertices, in the mesh's unit of length:
        infinite where no path leads.

    Examples
    --------
    >>> from unbend import Mesh
    >>> from unbend.distances import geodesic_solver
    >>> corner = Mesh([[0, 0, 0], [3, 0, 0], [0, 4, 0], [9, 9, 9]], [[0, 1, 2]])
    >>> geodesic_solver(corner, exact=True)(1)
    array([ 3.,  0.,  5., inf])
    """
    twice = has_earlier_twin(mesh.faces)
    if twice.any():  # they add no surface
        mesh = Mesh(mesh.vertices, mesh.faces[~twice], name=mesh.name)
    of_vertex = find_components(mesh.faces, mesh.n_vertices).of_vertex
    make = _exact if exact else _heat

    @functools.cache
    def on_component(number: int) -> tuple[IntArray, _FromVertex]:
        part, kept, _ = restrict(mesh, of_vertex == number)
        return kept, make(part)

    def one(source: int) -> FloatArray:
        distances = np.full(mesh.n_vertices, np.inf)
        if of_vertex[source] < 0:  # no face uses it
            distances[source] = 0.0
        else:
            kept, from_vertex = on_component(int(of_vertex[source]))
            distances[kept] = from_vertex(int(np.searchsorted(kept, source)))
        return distances

    return one


def _heat(mesh: Mesh) -> _FromVertex:
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


def _exact(mesh: Mesh) -> _FromVertex:
    """Exact geodesics of the polyhedron (Mitchell, Mount and Papadimitriou 1987)."""
    if mesh.is_point_cloud:
        raise MeshError(f"{mesh.name}: a point cloud has no exact geodesics; use geodesic")
    try:
        from pygeodesic.geodesic import PyGeodesicAlgorithmExact
    except ImportError:
        raise MissingExtraError("pygeodesic", "exact") from None
    # The solver reads beyond its arrays where an edge has a third face, and finds no path through
    # a vertex where two sheets touch.
    edges = find_edges(mesh.faces, mesh.n_vertices)
    n_crowded = int((edges.n_faces > 2).sum())
    n_touching = count_non_manifold_vertices(mesh.faces, edges)
    if n_crowded or n_touching:
        what = plural(n_crowded or n_touching, f"non-manifold {'edge' if n_crowded else 'vertex'}")
        raise MeshError(
            f"{mesh.name}: {what}, across which exact geodesics are not defined; use geodesic"
        )
    solver = PyGeodesicAlgorithmExact(mesh.vertices, mesh.faces)

    def one(source: int) -> FloatArray:
        distances, _ = solver.geodesicDistances(np.array([source]), None)
        return np.array(distances, dtype=np.float64)

    return one
