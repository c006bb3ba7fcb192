"""L D L^T by the multifrontal method: dense blocks, subtrees in threads, no pivoting.

The columns of a supernode are eliminated in a dense front, and what that does to later rows, the
update matrix, is added to its parent's front. Importing this module imports Numba.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from unbend._compiled import compiled
from unbend._parallel import in_chunks, one_blas_thread, run_all
from unbend._types import FloatArray, IntArray, SparseMatrix
from unbend.linalg._sweeps import MOST_AT_ONCE, backward, forward
from unbend.linalg.dissection import Supernodes, dissect

_ROWS = 128  # of a symmetric product computed at once: half of it is never needed


class Factor(NamedTuple):
    """P A P^T = L D L^T."""

    nodes: Supernodes
    widest: int  # most columns of a supernode
    tallest: int  # most rows below one
    pivots: FloatArray  # D
    places: IntArray  # (m + 1, 2): where each supernode's entries start in the two arrays below
    squares: FloatArray  # the inverse of the square of L of each supernode
    lows: FloatArray  # the rows of L below


def factor(matrix: SparseMatrix) -> Factor:
    """Factorise a symmetric matrix in compressed columns, of which both halves are stored.

    Duff and Reid, ACM TOMS 9, 1983. Raises ArithmeticError at a pivot that is zero or not finite.
    """
    starts, indices = matrix.indptr.astype(np.int64), matrix.indices.astype(np.int32)
    nodes = dissect(starts, indices)
    widths, heights = np.diff(nodes.starts), np.diff(nodes.row_starts)
    sizes = np.column_stack([widths**2, widths * heights])
    places = np.concatenate([np.zeros((1, 2), np.int64), np.cumsum(sizes, axis=0)])
    widest = int(widths.max())
    # Sweeps take several rows at once. Those past the last row are read too, and not used.
    squares, lows = (np.zeros(size + MOST_AT_ONCE * widest) for size in places[-1])
    pivots = np.empty(len(nodes.order))
    found = Factor(nodes, widest, int(heights.max()), pivots, places, squares, lows)
    offsets, room = place_updates(nodes)
    graph = starts, indices, matrix.data
    eliminate = functools.partial(_eliminate, graph, found, offsets, np.empty(room))
    *subtrees, top = nodes.parts
    with one_blas_thread():
        good = run_all(functools.partial(eliminate, *part) for part in subtrees)
    if not (all(good) and eliminate(*top)):
        raise ArithmeticError("a pivot that is zero or not finite, or a matrix not symmetric")
    return found


def place_updates(nodes: Supernodes) -> tuple[IntArray, int]:
    """Place all update matrices in one array: where each starts, and how long the array is."""
    offsets, depths = np.zeros((2, len(nodes.children)), np.int64)
    sizes = np.diff(nodes.row_starts) ** 2
    room = 0
    for part in reversed(nodes.parts):
        room = _stack_updates(nodes.children, sizes, depths, offsets, *part, room)
    return offsets, room


def solve(found: Factor, rhs: FloatArray) -> FloatArray:
    """Solve for a block of right-hand sides, (n, r) to (n, r)."""
    return in_chunks(found.nodes.order, functools.partial(_solve_chunk, found), rhs)


def _solve_chunk(found: Factor, values: FloatArray) -> None:
    lanes = (0.0,) * values.shape[1]
    *subtrees, top = found.nodes.parts
    below = int(found.nodes.starts[top[0]])  # rows that belong to subtrees
    # A subtree adds to its own rows and, apart from the others, to those above all of them.
    above = np.zeros((len(subtrees), len(values) - below, values.shape[1]))
    run_all(
        functools.partial(forward, found, values, sums, below, *part, lanes)
        for part, sums in zip(subtrees, above, strict=True)
    )
    values[below:] += above.sum(axis=0)
    forward(found, values, values[below:], below, *top, lanes)
    backward(found, values, *top, lanes)
    run_all(functools.partial(backward, found, values, *part, lanes) for part in subtrees)


@compiled
def _stack_updates(children, sizes, depths, offsets, first, last, room):  # type: ignore[no-untyped-def]
    """Place the update matrices of a range of supernodes in two stacks; give where they end.

    Even depths are in one, odd ones in the other: a supernode's children are the last on the other.
    """
    for i in range(last - 1, first - 1, -1):
        for c in range(2):
            if children[i, c] >= 0:
                depths[children[i, c]] = depths[i] + 1
    used, most = np.zeros(2, np.int64), np.zeros(2, np.int64)
    for is_last in range(2):
        used[0], used[1] = room, room + most[0]
        for i in range(first, last):
            mine = depths[i] % 2
            for c in range(2):
                if children[i, c] >= first:
                    used[1 - mine] -= sizes[children[i, c]]
            offsets[i] = used[mine]
            used[mine] += sizes[i]
            if is_last == 0:
                most[mine] = max(most[mine], used[mine] - room)
    return room + most[0] + most[1]


@compiled
def locate(nodes, child, parent, where, local):  # type: ignore[no-untyped-def]
    """Find a child's rows in its parent's front: among its own columns, or where they are below.

    Count them, and those among the columns; -1 for an entry without its mirror image.
    """
    begin, end = nodes.starts[parent], nodes.starts[parent + 1]
    theirs = nodes.rows[nodes.row_starts[child] : nodes.row_starts[child + 1]]
    n_own = 0
    for k in range(theirs.size):
        if theirs[k] < begin:
            return theirs.size, -1
        n_own += theirs[k] < end
        local[k] = theirs[k] - begin if theirs[k] < end else where[theirs[k]]
    return theirs.size, n_own


@compiled
def subtract_symmetric(matrix, left, right):  # type: ignore[no-untyped-def]
    """Subtract ``left @ right.T``, which is symmetric, from the lower half of a matrix."""
    for top in range(0, len(matrix), _ROWS):
        bottom = min(top + _ROWS, len(matrix))
        product = np.dot(left[top:bottom], right[:bottom].T)
        for k in range(top, bottom):
            for j in range(k + 1):
                matrix[k, j] -= product[k - top, j]


@compiled
def _eliminate(graph, found, offsets, updates, first, last):  # type: ignore[no-untyped-def]
    """Eliminate a range of supernodes; tell whether every pivot was good."""
    starts, indices, entries = graph
    nodes, pivots, places = found.nodes, found.pivots, found.places
    order, inverse, rows = nodes.order, nodes.inverse, nodes.rows
    front = np.empty((found.widest, found.widest))
    column = np.empty(found.widest)
    room = np.empty(found.widest * found.tallest)
    local = np.empty(found.widest + found.tallest, np.int64)
    where = np.empty(order.size, np.int32)  # of a row below in the front
    for i in range(first, last):
        begin, end, at = nodes.starts[i], nodes.starts[i + 1], nodes.row_starts[i]
        width, height = end - begin, nodes.row_starts[i + 1] - at
        square = found.squares[places[i, 0] : places[i + 1, 0]].reshape((width, width))
        low = found.lows[places[i, 1] : places[i + 1, 1]].reshape((height, width))
        update = updates[offsets[i] : offsets[i] + height * height].reshape((height, height))
        front[:width, :width] = 0.0
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
        for child in nodes.children[i]:
            if child >= 0:
                count, n_own = locate(nodes, child, i, where, local)
                if n_own < 0:
                    return False
                offset = offsets[child]
                theirs = updates[offset : offset + count * count].reshape((count, count))
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
        for k in range(width):
            square[k, k] = 1.0
            for j in range(k):
                share = front[k, j]
                for m in range(j + 1):
                    square[k, m] -= share * square[j, m]
        if height > 0 and width > 0:
            scaled = room[: height * width].reshape((height, width))
            np.dot(low, square.T, scaled)
            for k in range(height):
                for j in range(width):
                    low[k, j] = scaled[k, j] / pivots[begin + j]
            subtract_symmetric(update, scaled, low)
    return True
