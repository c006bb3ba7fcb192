"""The multifrontal factor and its sweeps, on matrices that give each kind of supernode."""

import numpy as np
import pytest
import scipy.sparse as sp

from tests.linalg.problems import laplacian, scattered
from unbend.linalg import multifrontal
from unbend.linalg._sweeps import forward
from unbend.linalg.multifrontal import _stack_updates, factor, solve

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 24, 25, 45, 61, 62, 63, 64, 65, 130])
@pytest.mark.parametrize("columns", [1, 5, 16, 17])
def test_dense_matrices_are_solved(size, columns):
    """Supernodes of every kind of width, the last one included, after which nothing comes."""
    rng = np.random.default_rng(size)
    dense = rng.standard_normal((size, size))
    dense += dense.T + 4 * size**0.5 * np.eye(size)
    found = factor(sp.csc_matrix(dense))
    rhs = rng.standard_normal((size, columns))
    np.testing.assert_allclose(dense @ solve(found, rhs), rhs, rtol=0, atol=1e-12 * size)
    assert (found.pivots > 0).all()


@pytest.mark.parametrize("size", [30, 100])
def test_chains_are_solved(size):
    """Their separators are single vertices, and there are one or two rows below each part."""
    rng = np.random.default_rng(size)
    beside = rng.uniform(-1, 1, size - 1)
    chain = sp.diags_array([beside, rng.uniform(2, 3, size), beside], offsets=[-1, 0, 1])
    shuffle = rng.permutation(size)
    matrix = sp.csc_matrix(chain.tocsr()[shuffle][:, shuffle])
    found = factor(matrix)
    heights, widths = np.diff(found.nodes.row_starts), np.diff(found.nodes.starts)
    assert ((heights == 1) & (widths > 1)).any()
    assert ((heights == 1) & (widths == 1)).any()
    rhs = rng.standard_normal((size, 2))
    np.testing.assert_allclose(matrix @ solve(found, rhs), rhs, rtol=0, atol=1e-13)


def test_a_mesh_is_solved_and_its_negative_eigenvalues_are_counted():
    stiffness, areas = laplacian(*scattered(400, 0))
    matrix = sp.csc_matrix(stiffness - 30.0 * sp.diags_array(areas))
    found = factor(matrix)
    rhs = np.random.default_rng(0).standard_normal((400, 9))
    np.testing.assert_allclose(matrix @ solve(found, rhs), rhs, rtol=0, atol=1e-10)
    assert (found.pivots < 0).sum() == (np.linalg.eigvalsh(matrix.toarray()) < 0).sum()


def test_tall_supernodes_are_worked_on_piece_by_piece(monkeypatch):
    """Uncompiled, small ones are tall enough; compiled, this is the test before once more."""
    monkeypatch.setattr(multifrontal, "_ROWS", 3)
    test_a_mesh_is_solved_and_its_negative_eigenvalues_are_counted()


@pytest.mark.parametrize("width", [8, 16])
def test_subtrees_leave_what_is_above_them_to_their_sums(width):
    """Otherwise threads would add to the same rows at once."""
    stiffness, areas = laplacian(*scattered(300, 0))
    matrix = sp.csc_matrix(stiffness + sp.diags_array(areas))
    found = factor(matrix)
    nodes = found.nodes
    *subtrees, top = nodes.parts
    below = int(nodes.starts[top[0]])
    for first, last in subtrees:
        values = np.random.default_rng(0).standard_normal((300, width))
        before, sums = values.copy(), np.zeros((300 - below, width))
        forward(found, values, sums, below, first, last, (0.0,) * width)
        own = slice(nodes.starts[first], nodes.starts[last])
        assert (values[own] != before[own]).any()
        assert (sums[:, 0] != 0).any()
        values[own] = before[own]
        np.testing.assert_array_equal(values, before)


def test_what_cannot_be_factorised_is_refused():
    with pytest.raises(ArithmeticError, match="pivot"):
        factor(sp.csc_matrix(np.array([[0.0, 1.0], [1.0, 0.0]])))


@pytest.mark.parametrize("bad", range(8))
def test_a_single_part_that_cannot_be_factorised_is_enough(bad):
    blocks = [sp.coo_array(np.ones((3, 3)) + 3 * np.eye(3))] * 8
    assert np.isfinite(factor(sp.csc_matrix(sp.block_diag(blocks))).pivots).all()
    blocks[bad] = sp.coo_array(np.ones((3, 3)))
    with pytest.raises(ArithmeticError, match="pivot"):
        factor(sp.csc_matrix(sp.block_diag(blocks)))


def test_entries_without_a_mirror_image_are_refused_or_left_alone():
    """No memory but the factor's own is touched, whatever the pattern: uncompiled, NumPy minds."""
    refused = 0
    for seed in range(20):
        crossed = sp.random_array((80, 80), density=0.03, rng=np.random.default_rng(seed))
        try:
            found = factor(sp.csc_matrix(crossed + sp.eye_array(80) * 9))
        except ArithmeticError:
            refused += 1
        else:
            assert np.isfinite(solve(found, np.ones((80, 3)))).all()
    assert refused > 0


@pytest.mark.parametrize("room", [0, 7])
def test_update_matrices_never_lie_on_one_another(room: int) -> None:
    """Each lives from its own supernode's turn to its parent's."""
    for seed in range(30):
        draw = np.random.default_rng(seed)
        n = int(draw.integers(1, 40))
        children, roots = np.full((n, 2), -1), [0]
        for i in range(1, n):  # in postorder: each takes up to two of those without a parent
            for c in range(min(int(draw.integers(0, 3)), len(roots))):
                children[i, c] = roots.pop()
            roots.append(i)
        heights = draw.integers(0, 5, n)
        depths, offsets = np.zeros((2, n), np.int64)
        end = _stack_updates(children, heights**2, depths, offsets, 0, n, room)
        depths = np.zeros(n, int)
        for i in range(n - 1, -1, -1):
            depths[children[i][children[i] >= 0]] = depths[i] + 1
        alive: set[int] = set()
        most = [0, 0]
        for i in range(n):
            alive.add(i)
            others = alive - set(children[i].tolist())
            for odd in range(2):
                lengths = [heights[j] ** 2 for j in others if depths[j] % 2 == odd]
                most[odd] = max(most[odd], sum(lengths))
            taken = [x for j in alive for x in range(offsets[j], offsets[j] + heights[j] ** 2)]
            assert len(set(taken)) == len(taken)
            assert not taken or room <= min(taken) <= max(taken) < end
            alive = others
        assert end == room + sum(most)  # and they take no more than two stacks must
