"""Aggregates of vertices lie together on the surface, whatever their order."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import connected_components, shortest_path

from unbend.datasets import make_octopus
from unbend.errors import InputError
from unbend.mesh import Mesh, aggregate_vertices

OCTOPUS = make_octopus("swimming", n_vertices=3000).mesh


@given(n_coarse=st.integers(1, 3000), seed=st.integers(0, 100))
def test_every_aggregate_is_connected(n_coarse, seed):
    aggregates = aggregate_vertices(OCTOPUS, n_coarse, seed)
    assert np.array_equal(np.unique(aggregates), np.arange(n_coarse))
    i, j = OCTOPUS.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    inside = aggregates[i] == aggregates[j]
    graph = sp.coo_array((np.ones(inside.sum()), (i[inside], j[inside])), shape=(3000, 3000))
    assert connected_components(graph, directed=False)[0] == n_coarse


def test_a_point_cloud_is_refused():
    with pytest.raises(InputError, match="point cloud"):
        aggregate_vertices(Mesh(np.eye(3)), 2)


def test_each_vertex_goes_to_the_nearest_along_edges():
    n = OCTOPUS.n_vertices
    i, j = OCTOPUS.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    lengths = np.linalg.norm(OCTOPUS.vertices[i] - OCTOPUS.vertices[j], axis=1)
    centres = np.sort(np.random.default_rng(0).choice(n, 40, replace=False))
    graph = sp.coo_array((lengths / 2, (i, j)), shape=(n, n)).tocsr()  # each edge is met twice
    ways = shortest_path(graph + graph.T, indices=centres) / 2
    mine = ways[aggregate_vertices(OCTOPUS, 40), np.arange(n)]
    np.testing.assert_allclose(mine, ways.min(axis=0), rtol=1e-6)
