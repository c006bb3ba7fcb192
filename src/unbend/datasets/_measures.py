"""Lengths, areas and normals of a mesh."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from unbend._types import FloatArray, IntArray
from unbend.mesh import Mesh


def mean_edge(mesh: Mesh) -> float:
    """Mean length of the sides of all faces."""
    return float(_edge_graph(mesh)[1].mean())


def along_edges(mesh: Mesh, sources: IntArray, nearest: bool = False) -> FloatArray:
    """Lengths of the shortest ways along edges: (s, n), or (n,) from the nearest source."""
    edges, lengths = _edge_graph(mesh)
    n = mesh.n_vertices
    graph = sp.csr_matrix((lengths, (edges[:, 0], edges[:, 1])), shape=(n, n))
    return np.asarray(dijkstra(graph, directed=False, indices=sources, min_only=nearest))


def _edge_graph(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    edges = np.unique(np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    return edges, lengths


def area(mesh: Mesh) -> float:
    """Area of all faces."""
    return float(np.linalg.norm(face_normals(mesh), axis=1).sum()) / 2


def face_normals(mesh: Mesh) -> FloatArray:
    """Measure the normals of the faces, (m, 3): as long as twice their area."""
    corners = mesh.vertices[mesh.faces]
    normals: FloatArray = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals


def vertex_normals(mesh: Mesh) -> FloatArray:
    """Measure unit normals at the vertices, (n, 3), from those of their faces by area."""
    normals = np.zeros_like(mesh.vertices)
    for i in range(3):
        np.add.at(normals, mesh.faces[:, i], face_normals(mesh))
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))
