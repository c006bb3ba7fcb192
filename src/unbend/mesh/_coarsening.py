"""Which vertices of a mesh a coarser one puts together."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from unbend._arrays import snap
from unbend._types import IntArray
from unbend.errors import InputError
from unbend.mesh._mesh import Mesh
from unbend.mesh._topology import find_edges


def aggregate_vertices(mesh: Mesh, n_coarse: int, random_state: int = 0) -> IntArray:
    """Put each vertex together with the one of some that is nearest along the edges.

    Vertices that are put together are connected on the surface: a leg never joins the leg beside
    it, however near.

    Parameters
    ----------
    mesh : Mesh
        Connected.
    n_coarse : int
        Number of vertices to gather around, at most as many as there are.
    random_state : int, default=0
        Seed of their choice.

    Returns
    -------
    (n,) ndarray of int64
        Number of the coarse vertex, from 0 to ``n_coarse - 1``, each in use.

    Raises
    ------
    InputError
        If the mesh is a point cloud.

    Examples
    --------
    >>> from unbend.mesh import aggregate_vertices
    >>> from unbend.datasets import make_sphere
    >>> aggregates = aggregate_vertices(make_sphere(4), 300)
    >>> len(aggregates), int(aggregates.max())
    (2562, 299)
    """
    if mesh.is_point_cloud:
        raise InputError(f"{mesh.name}: n_coarse needs faces, and this is a point cloud")
    n = mesh.n_vertices
    ends = find_edges(mesh.faces, n).ends
    lengths = np.linalg.norm(mesh.vertices[ends[:, 0]] - mesh.vertices[ends[:, 1]], axis=1)
    graph = sp.csr_array((np.maximum(snap(lengths), np.finfo(float).tiny), ends.T), shape=(n, n))
    chosen = np.random.default_rng(random_state).choice(n, n_coarse, replace=False)
    nearest = dijkstra(
        graph, directed=False, indices=chosen, return_predecessors=True, min_only=True
    )[2]
    result: IntArray = np.unique(nearest, return_inverse=True)[1].astype(np.int64)
    return result
