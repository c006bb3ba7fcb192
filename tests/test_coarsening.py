"""Aggregates of vertices lie together on the surface, whatever their order."""

import sys

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from unbend.coarsening import aggregate_vertices
from unbend.datasets import make_octopus
from unbend.errors import InputError, MissingExtraError
from unbend.mesh import Mesh


def test_every_aggregate_is_connected():
    mesh = make_octopus("swimming", n_vertices=3000).mesh
    aggregates = aggregate_vertices(mesh, 200)
    assert np.array_equal(np.unique(aggregates), np.arange(aggregates.max() + 1))
    assert 150 < aggregates.max() < 260
    i, j = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    inside = aggregates[i] == aggregates[j]
    graph = sp.coo_array((np.ones(inside.sum()), (i[inside], j[inside])), shape=(3000, 3000))
    assert connected_components(graph, directed=False)[0] == aggregates.max() + 1


def test_what_is_missing_is_named(monkeypatch):
    with pytest.raises(InputError, match="point cloud"):
        aggregate_vertices(Mesh(np.eye(3)), 2)
    monkeypatch.setitem(sys.modules, "fast_simplification", None)
    with pytest.raises(MissingExtraError, match=r"unbend\[large\]"):
        aggregate_vertices(make_octopus(n_vertices=600).mesh, 100)
