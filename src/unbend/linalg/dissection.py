"""Nested dissection: an order of elimination in which most of the work falls into dense blocks."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from unbend._compiled import compiled
from unbend._parallel import run_all
from unbend._types import IntArray

_LEVELS = 3  # of separators above the subtrees that threads share
_LEAF = 24  # vertices that are not separated any more
_WIDTH = 64  # columns of a supernode at most
_LEAST = 0.2  # share of the vertices on the smaller side of a separator, if that can be


class Supernodes(NamedTuple):
    """Columns of a factor, in m groups with the same rows below them."""

    order: Any  # (n,) int32: row of the matrix for each row of the factor
    inverse: Any  # the reverse
    starts: IntArray  # (m + 1,): group i has the columns starts[i] to starts[i + 1]
    children: IntArray  # (m, 2): groups before it whose updates go to each one; -1 for none
    row_starts: IntArray  # compressed rows below a group's own
    rows: Any  # int32, ascending
    parts: IntArray  # (p, 2): ranges of groups, independent subtrees and last what is above all


def dissect(starts: IntArray, neighbors: IntArray) -> Supernodes:
    """Order the vertices of a graph by nested dissection, and find the supernodes of the factor.

    The graph is in compressed rows, each edge in both directions. A part is separated where the
    distances from two far ends of it differ by some amount: by the amount that needs the fewest
    vertices for the size of the smaller side (after George, SIAM J. Numer. Anal. 10, 1973).
    """
    n = len(starts) - 1
    graph = starts, neighbors
    order = np.arange(n, dtype=np.int32)
    scratch = [np.zeros(n, np.int32), *np.empty((2, n), np.int32)]
    segments: list[tuple[int, int]] = [(0, n)]
    separators: list[list[tuple[int, int]]] = []
    for _ in range(_LEVELS):
        sizes = run_all(functools.partial(_halve, *graph, order, *s, *scratch) for s in segments)
        separators.append([])
        halves = []
        for (first, last), (one, other) in zip(segments, sizes, strict=True):
            own = first + one + other
            halves += [(first, first + one), (first + one, own)]
            separators[-1].append((own, last))
        segments = halves
    largest = sorted(range(len(segments)), key=lambda i: segments[i][0] - segments[i][1])
    subtrees = run_all(
        functools.partial(_subtree, *graph, order, *segments[i], *scratch) for i in largest
    )
    # The pieces of the order, and of each the first columns and the parents of its supernodes.
    pieces = [order[slice(*segments[i])] for i in largest]
    begins, parents = map(list, zip(*subtrees, strict=True))
    above = {}  # the separator over each piece

    def join(level: int, i: int) -> int:
        """Append a separator to the pieces, after what it separates; give its number there."""
        if level == _LEVELS:
            return largest.index(i)
        sides = join(level + 1, 2 * i), join(level + 1, 2 * i + 1)
        pieces.append(order[slice(*separators[level][i])])
        size = len(pieces[-1])
        count = max(1, -(-size // _WIDTH))
        begins.append(size * np.arange(count) // count)
        parents.append(np.arange(1, count + 1))
        above.update(dict.fromkeys(sides, len(pieces) - 1))
        return len(pieces) - 1

    join(0, 0)
    rows_before = np.cumsum([0, *map(len, pieces)])
    before = np.cumsum([0, *map(len, parents)])
    tree = np.concatenate([one + at for one, at in zip(parents, before[:-1], strict=True)])
    for side, separator in above.items():
        tree[before[side + 1] - 1] = before[separator]
    children = _children(tree)
    columns = np.concatenate([own + at for own, at in zip(begins, rows_before[:-1], strict=True)])
    columns = np.append(columns, n)
    order = np.concatenate(pieces)
    inverse = np.empty(n, np.int32)
    inverse[order] = np.arange(n, dtype=np.int32)
    row_starts, rows = _rows_below(*graph, order, inverse, columns, children)
    table = sp.csr_array((np.empty(len(rows), np.int8), rows, row_starts), shape=(before[-1], n))
    table.sort_indices()
    rows = table.indices.astype(np.int32)
    ends = np.append(before[: len(subtrees) + 1], before[-1])
    parts = np.column_stack([ends[:-1], ends[1:]])
    return Supernodes(order, inverse, columns, children, row_starts, rows, parts)


def _children(parents: IntArray) -> IntArray:
    """List the one or two children of each supernode; the last one has no parent."""
    result = np.full((len(parents), 2), -1)
    every = np.arange(len(parents) - 1)
    result[parents[every[::-1]], 0] = every[::-1]  # the first one is what stays
    result[parents[every], 1] = every
    result[result[:, 0] == result[:, 1], 1] = -1
    return result


def _subtree(starts: IntArray, neighbors: IntArray, *segment: Any) -> tuple[IntArray, IntArray]:
    """Dissect a segment; give its supernodes' starts in it and parents, what is below first."""
    _, first, last = segment[:3]
    size = last - first
    # Supernodes have a column each, or lie between two that have.
    found, waiting = np.empty((2 * size + 1, 2), np.int64), np.empty((size + 1, 3), np.int64)
    count = _dissect(starts, neighbors, *segment, found, waiting)
    own, above = found[:count][::-1].T
    return own - first, count - 1 - above


@compiled
def _search(starts, neighbors, label, own, queue, distance, seed):  # type: ignore[no-untyped-def]
    """Search breadth first among the vertices with a label; count what is reached."""
    queue[0], distance[seed] = seed, 0
    done, count = 0, 1
    while done < count:
        vertex = queue[done]
        for p in range(starts[vertex], starts[vertex + 1]):
            other = neighbors[p]
            if label[other] == own and distance[other] < 0:
                distance[other] = distance[vertex] + 1
                queue[count] = other
                count += 1
        done += 1
    return count


@compiled
def _halve(starts, neighbors, order, first, last, label, near, far):  # type: ignore[no-untyped-def]
    """Reorder a segment into side, side and separator; give the sizes of the sides.

    The vertices of a segment, and they alone, are labelled with where it starts.
    """
    part = order[first:last]
    size = part.size
    if size < 2:
        return 0, 0
    queue = np.empty(size, np.int32)
    for vertex in part:
        near[vertex] = far[vertex] = -1
    count = _search(starts, neighbors, label, first, queue, near, part[0])
    if count < size:  # several pieces: whole ones go to either side
        best = count
        for vertex in part:
            if near[vertex] < 0:
                count += _search(starts, neighbors, label, first, queue[count:], near, vertex)
                if count < size and abs(2 * count - size) < abs(2 * best - size):
                    best = count
        for i in range(size):
            part[i] = queue[i]
            if i >= best:
                label[queue[i]] = first + best
        return best, size - best
    seed = queue[size - 1]
    for vertex in part:
        near[vertex] = -1
    _search(starts, neighbors, label, first, queue, near, seed)
    end = queue[size - 1]
    _search(starts, neighbors, label, first, queue, far, end)
    reach = near[end]
    # For each level: vertices under it, at or over it beside one under it, and the reverse.
    changes = np.zeros((2 * reach + 3, 3), np.int64)
    for vertex in part:
        near[vertex] += reach - far[vertex]
    for vertex in part:
        height = near[vertex]
        least, most = height, height
        for p in range(starts[vertex], starts[vertex + 1]):
            other = neighbors[p]
            if label[other] == first:
                least = min(least, near[other])
                most = max(most, near[other])
        changes[height + 1, 0] += 1
        changes[least + 1, 1] += 1
        changes[height + 1, 1] -= 1
        changes[height + 1, 2] += 1
        changes[most + 1, 2] -= 1
    best_cost, level, cut_side = np.inf, 0, 0
    n_under, n_upper, n_lower = 0, 0, 0
    for trial in range(1, 2 * reach + 1):
        n_under += changes[trial, 0]
        n_upper += changes[trial, 1]
        n_lower += changes[trial, 2]
        for side in range(2):
            cut = n_lower if side == 0 else n_upper
            one = n_under if side == 1 else n_under - cut
            smaller = min(one, size - one - cut)
            if smaller > 0:
                cost = cut / smaller + (size if smaller < _LEAST * size else 0)
                if cost < best_cost:
                    best_cost, level, cut_side = cost, trial, side
    if level == 0:
        return 0, 0
    n_sides = np.zeros(3, np.int64)
    for i in range(size):
        vertex = part[i]
        is_over = near[vertex] >= level
        far[vertex] = is_over
        if is_over == cut_side:
            for p in range(starts[vertex], starts[vertex + 1]):
                other = neighbors[p]
                if label[other] == first and (near[other] >= level) != is_over:
                    far[vertex] = 2
                    break
        queue[i] = vertex
        n_sides[far[vertex]] += 1
    places = np.zeros(3, np.int64)
    places[1], places[2] = n_sides[0], n_sides[0] + n_sides[1]
    for i in range(size):
        vertex = queue[i]
        side = far[vertex]
        part[places[side]] = vertex
        places[side] += 1
        label[vertex] = -1 if side == 2 else first + side * n_sides[0]
    return n_sides[0], n_sides[1]


@compiled
def _dissect(starts, neighbors, order, first, last, label, near, far, found, waiting):  # type: ignore[no-untyped-def]
    """Reorder a segment down to its leaves; give its supernodes, what is above first.

    A row of what is found is a supernode's first column and, if any, the one above it.
    """
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = first, last, -1
    n_waiting, count = 1, 0
    while n_waiting > 0:
        n_waiting -= 1
        low, high, parent = waiting[n_waiting, 0], waiting[n_waiting, 1], waiting[n_waiting, 2]
        one, other = 0, 0
        if high - low > _LEAF:
            one, other = _halve(starts, neighbors, order, low, high, label, near, far)
        own = low + one + other
        n_pieces = max(1, (high - own + _WIDTH - 1) // _WIDTH)
        for piece in range(n_pieces - 1, -1, -1):
            found[count, 0], found[count, 1] = own + (high - own) * piece // n_pieces, parent
            parent = count
            count += 1
        if one + other > 0:
            for begin, end in ((low, low + one), (low + one, own)):
                waiting[n_waiting, 0], waiting[n_waiting, 1] = begin, end
                waiting[n_waiting, 2] = parent
                n_waiting += 1
    return count


@compiled
def _rows_below(starts, neighbors, order, inverse, begins, children):  # type: ignore[no-untyped-def]
    """Rows below each supernode's own: those of its columns' neighbours and of its children."""
    n, count = order.size, begins.size - 1
    row_starts = np.zeros(count + 1, np.int64)
    rows = np.empty(4 * n, np.int32)
    seen = np.full(n, -1, np.int32)
    at = 0
    for i in range(count):
        end = begins[i + 1]
        if at + n > rows.size:
            longer = np.empty(3 * rows.size, np.int32)
            for p in range(at):
                longer[p] = rows[p]
            rows = longer
        for j in range(begins[i], end):
            for p in range(starts[order[j]], starts[order[j] + 1]):
                row = inverse[neighbors[p]]
                if row >= end and seen[row] != i:
                    seen[row] = i
                    rows[at] = row
                    at += 1
        for child in children[i]:
            if child >= 0:
                for p in range(row_starts[child], row_starts[child + 1]):
                    row = rows[p]
                    if row >= end and seen[row] != i:
                        seen[row] = i
                        rows[at] = row
                        at += 1
        row_starts[i + 1] = at
    return row_starts, rows[:at]
