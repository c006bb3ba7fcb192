"""Geodesic distances: the heat method, or exact polyhedral ones."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from unbend._arrays import unit_of
from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.errors import MeshError, MissingExtraError, SolverError, warn
from unbend.mesh import (
    Mesh,
    count_non_manifold_vertices,
    find_components,
    find_edges,
    has_earlier_twin,
)
from unbend.preparation import check_size, join_seams, restrict
from unbend.spectral import delaunay_triangles

_FromVertex = Callable[[int], FloatArray]

# Shares of the largest distance by which distances may miss what must hold of them, more being
# warned of: the heat method falls short of the straight line by 5 % at most on ordinary meshes,
# which so many vertices show; exact distances change by no more than its length along an edge.
_SHORT, _SHOWING, _STEEP = 0.1, 500, 1e-6


def geodesic_solver(mesh: Mesh, *, exact: bool) -> _FromVertex:
    """Geodesic distances from any vertex of a mesh with faces, which may have several components.

    Returns a function from a vertex to the distances (n,) in the mesh's unit of length, infinite
    where no path leads. It warns, once for each component, of distances that cannot be right.
    """
    mesh, number = join_seams(mesh)
    twice = has_earlier_twin(mesh.faces)
    if twice.any():  # they add no surface
        mesh = Mesh(mesh.vertices, mesh.faces[~twice], name=mesh.name)
    of_vertex = find_components(mesh.faces, mesh.n_vertices).of_vertex

    @functools.cache
    def on_component(number: int) -> tuple[IntArray, _FromVertex]:
        part, kept, _ = restrict(mesh, of_vertex == number)
        check_size(part)
        return kept, solver_of_component(part, exact=exact)

    def one(source: int) -> FloatArray:
        source = int(number[source])
        distances = np.full(mesh.n_vertices, np.inf)
        if of_vertex[source] < 0:  # no face uses it, or only one that names a vertex twice
            distances[source] = 0.0
        else:
            kept, from_vertex = on_component(int(of_vertex[source]))
            distances[kept] = from_vertex(int(np.searchsorted(kept, source)))
        return distances[number]

    return one


def solver_of_component(mesh: Mesh, *, exact: bool) -> _FromVertex:
    """Geodesic distances from any vertex of a connected mesh, as :func:`geodesic_solver` does."""
    return _exact(mesh) if exact else _heat(mesh)


def _heat(mesh: Mesh) -> _FromVertex:
    """Heat method (Crane et al. 2013) on the robust Laplacian."""
    import potpourri3d

    if mesh.is_point_cloud:
        faces, _, first = delaunay_triangles(mesh)
        distinct, of_point = np.unique(first, return_inverse=True)
        on_surface = _heat(Mesh(mesh.vertices[distinct], of_point[faces], name=mesh.name))
        return lambda source: on_surface(int(of_point[source]))[of_point]
    solver = potpourri3d.MeshHeatMethodDistanceSolver(mesh.vertices, mesh.faces, use_robust=True)
    some = np.linspace(0, mesh.n_vertices - 1, min(_SHOWING, mesh.n_vertices)).astype(int)
    warned = False

    def one(source: int) -> FloatArray:
        nonlocal warned
        distances = np.array(solver.compute_distance(source), dtype=np.float64)
        # The method fixes distances up to a constant, and leaves it slightly off at the source.
        distances -= distances[source]
        distances = np.maximum(distances, 0.0)
        if not np.isfinite(distances.sum()):
            raise SolverError(f"{mesh.name}: the heat method gave distances that are not finite")
        straight = np.linalg.norm(mesh.vertices - mesh.vertices[source], axis=1)
        largest = max(straight.max(), distances.max(), np.finfo(float).tiny)
        short = float((straight - distances)[some].max() / largest)
        if short > _SHORT and not warned:
            warned = True
            warn(
                f"{mesh.name}: the heat method falls short of the straight line, by up to "
                f"{short:.0%} of the largest distance: its faces are too long or too uneven; use "
                "geodesic-exact, which needs a mesh, or remesh it"
            )
        # Within a few edges the method falls short.
        return np.asarray(np.maximum(distances, straight))

    return one


def _exact(mesh: Mesh) -> _FromVertex:
    """Exact geodesics of the polyhedron (Mitchell, Mount and Papadimitriou 1987)."""
    if mesh.is_point_cloud:
        raise MeshError(f"{mesh.name}: a point cloud has no exact geodesics; use geodesic")
    try:
        from pygeodesic.geodesic import PyGeodesicAlgorithmExact
    except ImportError:
        raise MissingExtraError("pygeodesic") from None
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
    # It has tolerances of its own, for shapes about 1 across.
    unit = unit_of(mesh.vertices)
    vertices = mesh.vertices / unit
    solver = PyGeodesicAlgorithmExact(vertices, mesh.faces)
    tails, heads = edges.ends.T
    lengths = np.linalg.norm(vertices[tails] - vertices[heads], axis=1)
    warned = False

    def one(source: int) -> FloatArray:
        nonlocal warned
        distances = np.array(solver.geodesicDistances(np.array([source]), None)[0], dtype=float)
        unreached = ~(distances < lengths.sum())
        if unreached.any():
            raise SolverError(
                f"{mesh.name}: exact geodesics do not reach "
                f"{plural(int(unreached.sum()), 'vertex')}, because faces have no area; use "
                "geodesic, or repair the mesh"
            )
        steps = np.abs(distances[tails] - distances[heads]) - lengths
        steep = float(steps.max() / distances.max())
        if steep > _STEEP and not warned:
            warned = True
            warn(
                f"{mesh.name}: exact geodesics change by more than the length of an edge along it, "
                f"by up to {steep:.1g} of the largest: needle triangles make them inaccurate; "
                "use geodesic, or remesh it"
            )
        return np.asarray(distances * unit)

    return one
