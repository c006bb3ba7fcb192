"""Lengths and areas of a mesh."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from unbend._arrays import snap
from unbend._types import FloatArray, IntArray
from unbend.mesh import Mesh, edge_ends


def mean_edge(mesh: Mesh) -> float:
    """Mean length of the sides of all faces."""
    return float(_edge_graph(mesh)[1].mean())


def along_edges(mesh: Mesh, sources: IntArray, nearest: bool = False) -> FloatArray:
    """Lengths of the shortest ways along edges: (s, n), or (n,) from the nearest source."""
    edges, lengths = _edge_graph(mesh)
    n = mesh.n_vertices
    graph = sp.csr_matrix((snap(lengths), (edges[:, 0], edges[:, 1])), shape=(n, n))
    return np.asarray(dijkstra(graph, directed=False, indices=sources, min_only=nearest))


def _edge_graph(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    edges = edge_ends(mesh.faces, mesh.n_vertices)
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
