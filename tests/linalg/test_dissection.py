"""Nested dissection against the structure of a dense factor."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.linalg.problems import laplacian, scattered
from unbend.linalg.dissection import dissect


def pattern(matrix):
    matrix = sp.csr_array(matrix)
    return matrix.indptr.astype(np.int64), matrix.indices.astype(np.int32)


def below(nodes, i):
    return nodes.rows[nodes.row_starts[i] : nodes.row_starts[i + 1]]


def filled(matrix):
    """Where the factor of a matrix has entries, found by elimination."""
    there = matrix.toarray() != 0
    for j in range(len(there)):
        rows = j + 1 + np.flatnonzero(there[j + 1 :, j])
        there[np.ix_(rows, rows)] = True
    return np.tril(there)


@pytest.mark.kernels
@settings(max_examples=100, deadline=None)
@given(n=st.integers(1, 150), degree=st.floats(0, 6), seed=st.integers(0, 10**6))
def test_supernodes_hold_the_factor(n, degree, seed):
    rng = np.random.default_rng(seed)
    half = sp.random_array((n, n), density=min(degree / n, 1), rng=rng)
    matrix = sp.csr_array(half + half.T + sp.eye_array(n))
    nodes = dissect(*pattern(matrix))
    assert np.array_equal(np.sort(nodes.order), np.arange(n))
    assert nodes.starts[0] == 0
    assert nodes.starts[-1] == n
    assert (np.diff(nodes.starts) >= 0).all()
    stored = np.zeros((n, n), bool)
    for i in range(len(nodes.children)):
        own = np.arange(nodes.starts[i], nodes.starts[i + 1])
        rows = below(nodes, i)
        assert (np.diff(rows) > 0).all()
        assert (rows >= nodes.starts[i + 1]).all()
        stored[np.ix_(np.concatenate([own, rows]), own)] = True
        for child in nodes.children[i]:
            assert child < i
            if child >= 0:  # what a child's update touches is in its parent's front
                assert np.isin(below(nodes, child), np.concatenate([own, rows])).all()
    needed = filled(matrix[np.ix_(nodes.order, nodes.order)])
    assert not (needed & ~stored).any()
    has_parent = np.zeros(len(nodes.children), int)
    np.add.at(has_parent, nodes.children[nodes.children >= 0], 1)
    assert (has_parent[:-1] == 1).all()
    assert has_parent[-1] == 0


def test_subtrees_have_nothing_to_do_with_each_other():
    stiffness, _ = laplacian(*scattered(3000, 0))
    nodes = dissect(*pattern(stiffness))
    *subtrees, top = nodes.parts
    assert len(subtrees) == 8
    assert top[1] == len(nodes.children)
    for first, last in subtrees:
        rows = nodes.rows[nodes.row_starts[first] : nodes.row_starts[last]]
        inside = rows < nodes.starts[last]
        assert (rows[~inside] >= nodes.starts[top[0]]).all()
        assert nodes.starts[last] - nodes.starts[first] < 0.3 * 3000


def test_fill_grows_as_it_should():
    """Entries of the factor of a planar mesh: about n log n."""
    entries = []
    for n in (2_000, 32_000):
        stiffness, _ = laplacian(*scattered(n, 1))
        nodes = dissect(*pattern(stiffness))
        widths, heights = np.diff(nodes.starts), np.diff(nodes.row_starts)
        assert widths.max() <= 64
        entries.append((widths * (widths + 1) / 2 + widths * heights).sum() / n)
    assert entries[1] < 60  # minimum degree: 23, with no dense blocks
    assert entries[1] < 1.6 * entries[0]
