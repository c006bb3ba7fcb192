"""L D L^T by the multifrontal method: dense blocks, subtrees in threads, no pivoting.

The columns of a supernode are eliminated in a dense front, and what that does to later rows, the
update matrix, is added to its parent's front. Kept for each supernode are D, the inverse of its
square of L, and the rows below in panels of four columns, in which both sweeps of a solve read
memory from end to end.

Importing this module imports Numba; only :mod:`unbend.linalg.factorization` does, when needed.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from unbend._compiled import FLOATS, INTS, LONGS, PAIRS, kernel
from unbend._parallel import chunk_width, one_blas_thread, run_all
from unbend._types import FloatArray, IntArray, SparseMatrix
from unbend.linalg._chunks import load, unload
from unbend.linalg._sweeps import PANEL, sweeps
from unbend.linalg.dissection import Supernodes, dissect

_ROWS = 128  # of an update matrix computed at once: half of it is never needed


class Factor(NamedTuple):
    """P A P^T = L D L^T.

    Attributes
    ----------
    nodes : Supernodes
    most : tuple of int
        Most columns of a supernode, and most rows below one.
    pivots : (n,) ndarray of float64
        D.
    places : (m + 1, 2) ndarray of int64
        Where each supernode's entries start in the two arrays that follow.
    squares, panels : ndarrays of float64
        Inverses of the squares of L, in rows; the rows below, in panels.
    """

    nodes: Supernodes
    most: tuple[int, int]
    pivots: FloatArray
    places: IntArray
    squares: FloatArray
    panels: FloatArray


def factor(matrix: SparseMatrix) -> Factor:
    """Factorise a symmetric matrix.

    Parameters
    ----------
    matrix : (n, n) sparse matrix of float64 in compressed columns
        Both halves are stored.

    Returns
    -------
    Factor

    Raises
    ------
    ArithmeticError
        At a pivot that is zero or not finite, or at an entry that has no mirror image.

    References
    ----------
    Duff and Reid, "The multifrontal solution of indefinite sparse symmetric linear equations", ACM
    TOMS 9, 1983.

    Examples
    --------
    >>> import numpy as np, scipy.sparse as sp
    >>> from unbend.linalg.multifrontal import factor, solve
    >>> found = factor(sp.csc_matrix([[2.0, 1.0], [1.0, 3.0]]))
    >>> bool(np.allclose(solve(found, np.array([[3.0], [4.0]])), 1.0))
    True
    """
    graph = matrix.indptr.astype(np.int64), matrix.indices.astype(np.int32)
    nodes = dissect(*graph)
    n = len(nodes.order)
    widths, heights = np.diff(nodes.starts), np.diff(nodes.row_starts)
    sizes = np.column_stack([widths**2, -(-widths // PANEL) * PANEL * heights])
    places = np.concatenate([np.zeros((1, 2), np.int64), np.cumsum(sizes, axis=0)])
    # Sweeps take PANEL rows at once. Those past the last row are read too, and not used.
    n_squares, n_panels = places[-1] + (PANEL - 1) * max(widths.max(), PANEL)
    squares, panels = np.zeros(n_squares), np.zeros(n_panels)
    pivots = np.empty(n)
    offsets, room = place_updates(nodes)
    most = int(widths.max()), int(heights.max())
    work = (
        most,
        *graph,
        matrix.data,
        *nodes[:-1],
        pivots,
        places,
        squares,
        panels,
        offsets,
        np.empty(room),
    )
    *subtrees, top = nodes.parts
    with one_blas_thread():
        good = run_all(functools.partial(_eliminate, *work, *part) for part in subtrees)
    if not (all(good) and _eliminate(*work, *top)):
        raise ArithmeticError("a pivot that is zero or not finite, or a matrix not symmetric")
    return Factor(nodes, most, pivots, places, squares, panels)


def place_updates(nodes: Supernodes) -> tuple[IntArray, int]:
    """Place all update matrices in one array: where each starts, and how long the array is."""
    heights = np.diff(nodes.row_starts)
    depths, offsets = np.zeros(len(heights), np.int64), np.empty(len(heights), np.int64)
    room = 0
    for part in reversed(nodes.parts):
        room = _stack_updates(nodes.children, heights, depths, offsets, *part, room)
    return offsets, room


def solve(found: Factor, rhs: FloatArray) -> FloatArray:
    """Solve for a block of right-hand sides, (n, r) to (n, r)."""
    count = rhs.shape[1]
    solution = np.empty_like(rhs)
    width = chunk_width(count)
    run_all(
        functools.partial(_solve_chunk, found, rhs, solution, first, width)
        for first in range(0, count, width)
    )
    return solution


def _solve_chunk(
    found: Factor, rhs: FloatArray, solution: FloatArray, first: int, width: int
) -> None:
    nodes = found.nodes
    forward, backward = sweeps(width)
    *subtrees, top = nodes.parts
    below = int(nodes.starts[top[0]])  # rows that belong to subtrees
    values = np.empty((len(nodes.order), width))
    # A subtree adds to its own rows and, apart from the others, to those above all of them.
    above = np.zeros((len(subtrees), len(values) - below, width))
    work = (
        *(found.most, nodes.starts, nodes.row_starts, nodes.rows),
        *(found.places, found.squares, found.panels),
    )

    def down(part: tuple[int, int], sums: FloatArray) -> None:
        load(nodes.order, rhs, first, values, *nodes.starts[list(part)])
        forward(*work, values, sums, below, *part)

    def up(part: tuple[int, int]) -> None:
        backward(*work, found.pivots, values, *part)
        unload(nodes.order, values, first, solution, *nodes.starts[list(part)])

    load(nodes.order, rhs, first, values, below, len(values))
    run_all(functools.partial(down, *one) for one in zip(subtrees, above, strict=True))
    values[below:] += above.sum(axis=0)
    forward(*work, values, values[below:], below, *top)
    backward(*work, found.pivots, values, *top)
    unload(nodes.order, values, first, solution, below, len(values))
    run_all(functools.partial(up, part) for part in subtrees)


@kernel(PAIRS, LONGS, LONGS, LONGS, "int64", "int64", "int64")
def _stack_updates(children, heights, depths, offsets, first, last, room):  # type: ignore[no-untyped-def]
    """Place the update matrices of a range of supernodes in two stacks; give where they end.

    Those of even depth are in one, those of odd depth in the other: when a supernode's own is put
    on one, its children's, which it takes up, are the last on the other.
    """
    for i in range(last - 1, first - 1, -1):
        for c in range(2):
            if children[i, c] >= 0:
                depths[children[i, c]] = depths[i] + 1
    used = np.zeros(2, np.int64)
    most = np.zeros(2, np.int64)
    for is_last in range(2):
        used[0], used[1] = room, room + most[0]
        for i in range(first, last):
            mine = depths[i] % 2
            for c in range(2):
                if children[i, c] >= first:
                    used[1 - mine] -= heights[children[i, c]] ** 2
            offsets[i] = used[mine]
            used[mine] += heights[i] ** 2
            if is_last == 0:
                most[mine] = max(most[mine], used[mine] - room)
    return room + most[0] + most[1]


@kernel(
    *("UniTuple(int64, 2)", LONGS, INTS, FLOATS),
    *(INTS, INTS, LONGS, PAIRS, LONGS, INTS),
    *(FLOATS, PAIRS, FLOATS, FLOATS, LONGS, FLOATS),
    *("int64", "int64"),
)
def _eliminate(  # type: ignore[no-untyped-def]
    most,
    starts,
    indices,
    entries,
    order,
    inverse,
    begins,
    children,
    row_starts,
    rows,
    pivots,
    places,
    squares,
    panels,
    offsets,
    updates,
    first,
    last,
):
    """Eliminate a range of supernodes; tell whether every pivot was good."""
    widest, tallest = most
    front = np.empty((widest, widest))
    column = np.empty(widest)
    two_rooms = np.empty((2, widest * tallest))
    local = np.empty(widest + tallest, np.int64)
    where = np.empty(order.size, np.int32)  # of a row below in the front
    for i in range(first, last):
        begin, end, at = begins[i], begins[i + 1], row_starts[i]
        width, height = end - begin, row_starts[i + 1] - at
        low = two_rooms[0, : height * width].reshape((height, width))
        update = updates[offsets[i] : offsets[i] + height * height].reshape((height, height))
        front[:width, :width] = 0.0
        low[:, :] = 0.0
        update[:, :] = 0.0
        for k in range(height):
            where[rows[at + k]] = k
        for j in range(begin, end):
            for p in range(starts[order[j]], starts[order[j] + 1]):
                row = inverse[indices[p]]
                if row >= end:
                    low[where[row], j - begin] += entries[p]
                elif row >= j:
                    front[row - begin, j - begin] += entries[p]
        for c in range(2):
            child = children[i, c]
            if child >= 0:
                child_at = row_starts[child]
                count = row_starts[child + 1] - child_at
                offset = offsets[child]
                theirs = updates[offset : offset + count * count].reshape((count, count))
                n_own = 0
                for k in range(count):
                    row = rows[child_at + k]
                    if row < begin:  # an entry without its mirror image
                        return False
                    n_own += row < end
                    local[k] = row - begin if row < end else where[row]
                for k in range(n_own):
                    for j in range(k + 1):
                        front[local[k], local[j]] += theirs[k, j]
                for k in range(n_own, count):
                    for j in range(n_own):
                        low[local[k], local[j]] += theirs[k, j]
                    for j in range(n_own, k + 1):
                        update[local[k], local[j]] += theirs[k, j]
        for j in range(width):
            pivot = front[j, j]
            if pivot == 0.0 or not np.isfinite(pivot):
                return False
            pivots[begin + j] = pivot
            for k in range(j + 1, width):
                column[k] = front[k, j]
            for k in range(j + 1, width):
                share = column[k] / pivot
                front[k, j] = share
                for m in range(j + 1, k + 1):
                    front[k, m] -= share * column[m]
        square = squares[places[i, 0] : places[i + 1, 0]].reshape((width, width))
        for k in range(width):
            square[k, k] = 1.0
            for j in range(k):
                share = front[k, j]
                for m in range(j + 1):
                    square[k, m] -= share * square[j, m]
        if height > 0 and width > 0:
            scaled = two_rooms[1, : height * width].reshape((height, width))
            np.dot(low, square.T, scaled)
            panel = panels[places[i, 1] : places[i + 1, 1]]
            for k in range(height):
                for j in range(width):
                    low[k, j] = scaled[k, j] / pivots[begin + j]
                    panel[j // PANEL * height * PANEL + k * PANEL + j % PANEL] = low[k, j]
            for top in range(0, height, _ROWS):
                bottom = min(top + _ROWS, height)
                product = np.dot(scaled[top:bottom], low[:bottom].T)
                for k in range(top, bottom):
                    for j in range(k + 1):
                        update[k, j] -= product[k - top, j]
    return True
