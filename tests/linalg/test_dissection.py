"""Nested dissection against the structure of a dense factor."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.linalg.problems import laplacian, scattered
from unbend.linalg.dissection import _halve, dissect


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
    checked(sp.csr_array(half + half.T + sp.eye_array(n)))


@pytest.mark.kernels
@pytest.mark.parametrize("size", [24, 25, 64, 65, 130])
def test_what_cannot_be_cut_is_a_row_of_supernodes(size):
    """Eight cliques make eight subtrees, each of as many supernodes of one width as it takes."""
    nodes = checked(sp.csr_array(sp.block_diag([sp.coo_array(np.ones((size, size)))] * 8)))
    count = -(-size // 64)
    for first, last in nodes.parts[:-1]:
        widths = np.diff(nodes.starts)[first:last]
        assert len(widths) == count
        assert widths.max() - widths.min() <= 1
        assert np.diff(nodes.row_starts)[last - 1] == 0


def checked(matrix):
    """Supernodes of a matrix, which must have room for all of its factor."""
    nodes, n = dissect(*pattern(matrix)), matrix.shape[0]
    assert np.array_equal(np.sort(nodes.order), np.arange(n))
    assert nodes.starts[0] == 0
    assert nodes.starts[-1] == n
    assert (np.diff(nodes.starts) >= 0).all()
    assert np.array_equal(nodes.inverse[nodes.order], np.arange(n))
    assert nodes.children.shape == (len(nodes.starts) - 1, 2)
    assert nodes.children.min() >= -1
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
    return nodes


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
    sizes = [nodes.starts[last] - nodes.starts[first] for first, last in subtrees]
    assert sizes == sorted(sizes, reverse=True)


def test_a_narrow_separator_is_one_supernode():
    """Seven of them lie above the eight subtrees of a chain, a vertex each."""
    nodes = dissect(*pattern(chains(500)))
    first, last = nodes.parts[-1]
    assert np.diff(nodes.starts)[first:last].tolist() == [1] * 7


def chains(*sizes):
    """Paths, one after the other."""
    n = sum(sizes)
    joined = np.ones(n - 1)
    joined[np.cumsum(sizes)[:-1] - 1] = 0
    return sp.diags_array([joined, np.ones(n), joined], offsets=[-1, 0, 1]).tocsr()


def grid(rows, columns):
    """Neighbours in rows and columns."""
    one, other = (sp.eye_array(size) for size in (rows, columns))
    found = sp.csr_array(sp.kron(chains(rows), other) + sp.kron(one, chains(columns)))
    found.eliminate_zeros()
    return found


def halves(matrix, seed=None, before=0):
    """Sizes of sides and separator, which are checked: the sides have no edge between them."""
    matrix = sp.csr_array(matrix)
    matrix.eliminate_zeros()
    n = matrix.shape[0]
    order = np.arange(n, dtype=np.int32)
    if seed is not None:
        order[before:] = before + np.random.default_rng(seed).permutation(n - before)
    label = np.zeros(n, np.int32)
    label[before:] = before
    near, far = np.empty((2, n), np.int32)
    one, other = _halve(*pattern(matrix), order, before, n, label, near, far)
    assert sorted(order.tolist()) == list(range(n))
    assert (order[:before] < before).all()
    assert (label[:before] == 0).all()
    left, right, cut = np.split(order[before:], [one, one + other])
    assert matrix[left][:, right].nnz == 0
    if one + other:
        assert (label[left] == before).all()
        assert (label[right] == before + one).all()
        assert (label[cut] == -1).all()
    return one, other, n - before - one - other


@pytest.mark.kernels
@pytest.mark.parametrize("seed", [None, 0, 1, 2])
def test_simple_graphs_are_cut_in_their_middle(seed):
    assert halves(chains(41), seed) == (20, 20, 1)
    assert sorted(halves(chains(40), seed)) == [1, 19, 20]
    assert halves(chains(3), seed) == (1, 1, 1)
    assert halves(grid(7, 15), seed) == (49, 49, 7)
    assert halves(grid(2, 30), seed)[2] == 2
    assert min(halves(grid(2, 30), seed)[:2]) >= 28
    assert sorted(halves(grid(5, 5), seed)) == [5, 10, 10]
    for size in (1, 2, 5):  # nothing can be cut where all are neighbours
        assert halves(np.ones((size, size)), seed) == (0, 0, size)
    before = sp.block_diag([grid(3, 3), grid(7, 15)])  # a segment that others lie before
    assert halves(before, seed, before=9) == (49, 49, 7)
    joined = sp.lil_array(before)
    joined[8, 9] = joined[9, 8] = 1  # and are neighbours of
    assert halves(joined, seed, before=9) == (49, 49, 7)


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("sizes", "expected"),
    [
        ((1, 1), (1, 1, 0)),
        ((10, 20, 30), (30, 30, 0)),
        ((30, 20, 10), (30, 30, 0)),
        ((10, 30, 20), (40, 20, 0)),
        ((5, 5, 5, 5, 5), (10, 15, 0)),
        ((1, 50), (1, 50, 0)),
        ((50, 1, 1), (50, 2, 0)),
        ((10, 10, 80), (20, 80, 0)),
    ],
)
def test_pieces_go_whole_to_the_side_that_needs_them(sizes, expected):
    """Of the ways to cut their row, the first that is nearest to its middle."""
    assert halves(chains(*sizes)) == expected


@pytest.mark.kernels
def test_a_separator_has_a_fifth_of_the_vertices_on_either_side():
    """If that can be: the last edges of a tail need fewer vertices, and divide nothing."""
    for tail, expected in ((4, None), (30, 1)):
        block = grid(8, 8)
        both = sp.lil_array(sp.block_diag([block, chains(tail)]))
        both[63, 64] = both[64, 63] = 1
        for seed in range(3):
            one, other, cut = halves(both, seed)
            assert min(one, other) >= 0.2 * (64 + tail)
            assert cut == expected or cut > 3


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("rows", "columns", "height", "fill"), [(1, 1000, 2, 11), (24, 24, 30, 23), (5, 100, 12, 16)]
)
def test_simple_graphs_fill_little(rows, columns, height, fill):
    """Parts down to 24 vertices; separators as wide as the graph is narrow, two beside a part."""
    nodes = checked(grid(rows, columns))
    widths, heights = np.diff(nodes.starts), np.diff(nodes.row_starts)
    assert widths.max() <= 24
    assert heights.max() <= height
    assert (widths * (widths + 1) / 2 + widths * heights).sum() < fill * rows * columns


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
