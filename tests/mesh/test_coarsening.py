"""Aggregates of vertices lie together on the surface, whatever their order."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import connected_components

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
