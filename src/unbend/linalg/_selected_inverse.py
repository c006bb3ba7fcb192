"""The diagonal of an inverse from a multifrontal factor, without solving for its columns.

A front has its supernode's own columns (1) and the rows below them (2). With X = F21 F11^-1, the
inverse B of the matrix is, on the rows of a front,

    B21 = -B22 X        B11 = F11^-1 - X^T B21

B22 is a part of what the parent's front gave, so B is computed from the root down. For Y = B A B
with a diagonal A, the fronts of A are first condensed from the leaves up. With R = A21 - X A11, a
supernode adds to its parent

    A22 - R X^T - X R^T - X A11 X^T

The derivative of X in the direction of A is X' = R F11^-1, and from the root down

    Y21 = B22 X' - Y22 X        Y11 = F11^-1 A11 F11^-1 - X'^T B22 X - X^T Y21

Importing this module imports Numba.
"""

from __future__ import annotations

import functools

import numpy as np

from unbend._compiled import compiled
from unbend._parallel import one_blas_thread, run_all
from unbend._types import FloatArray
from unbend.linalg.multifrontal import Factor, locate, place_updates, subtract_symmetric


def inverse_diagonals(found: Factor, weights: FloatArray | None = None) -> FloatArray:
    """Compute the diagonal of the inverse B of a factorised matrix and, for weights A, of B A B.

    Erisman and Tinney, CACM 18, 1975; Lin et al., "SelInv", ACM TOMS 37, 2011.
    """
    nodes = found.nodes
    widths, heights = np.diff(nodes.starts), np.diff(nodes.row_starts)
    offsets, room = place_updates(nodes)
    updates = np.empty((1 if weights is None else 2, room))
    diagonals = np.empty((len(updates), len(nodes.order)))
    front_starts = np.append(0, np.cumsum(widths * (widths + heights)))
    fronts = front_starts, np.zeros(front_starts[-1])  # untouched without weights: no memory
    *subtrees, top = nodes.parts
    with one_blas_thread():
        if weights is not None:
            own_weights = weights[nodes.order]
            condense = functools.partial(_condense, found, own_weights, fronts, offsets, updates[0])
            run_all(functools.partial(condense, *part) for part in subtrees)
            condense(*top)
        invert = functools.partial(_invert, found, fronts, offsets, updates, diagonals)
        invert(*top)
        run_all(functools.partial(invert, *part) for part in subtrees)
    return np.asarray(diagonals[:, nodes.inverse])


@compiled
def _supernode(found, fronts, i):  # type: ignore[no-untyped-def]
    """Give the inverse of the square of L of a supernode, X, and its front."""
    nodes, places, (front_starts, entries) = found.nodes, found.places, fronts
    width = nodes.starts[i + 1] - nodes.starts[i]
    below = nodes.rows[nodes.row_starts[i] : nodes.row_starts[i + 1]]
    square = found.squares[places[i, 0] : places[i + 1, 0]].reshape((width, width))
    low = found.lows[places[i, 1] : places[i + 1, 1]].reshape((below.size, width))
    front = entries[front_starts[i] : front_starts[i + 1]].reshape((width + below.size, width))
    return square, np.dot(low, square), front


@compiled
def _condense(found, weights, fronts, offsets, updates, first, last):  # type: ignore[no-untyped-def]
    """Condense A over a range of supernodes; keep A11, over R, of each front."""
    nodes = found.nodes
    where = np.empty(weights.size, np.int32)
    local = np.empty(weights.size, np.int64)
    for i in range(first, last):
        _, extension, front = _supernode(found, fronts, i)
        height, width = extension.shape
        update = updates[offsets[i] : offsets[i] + height * height].reshape((height, height))
        update[:, :] = 0.0
        for k in range(width):
            front[k, k] = weights[nodes.starts[i] + k]
        for k in range(height):
            where[nodes.rows[nodes.row_starts[i] + k]] = width + k
        for child in nodes.children[i]:
            if child >= 0:
                count, n_own = locate(nodes, child, i, where, local)
                theirs = updates[offsets[child] : offsets[child] + count * count]
                for k in range(count):
                    for j in range(min(k + 1, n_own)):
                        front[local[k], local[j]] += theirs[k * count + j]
                    for j in range(n_own, k + 1):
                        update[local[k] - width, local[j] - width] += theirs[k * count + j]
        for k in range(width):
            for j in range(k):
                front[j, k] = front[k, j]
        # What is subtracted is X H^T + H X^T with H = R + X A11 / 2.
        product = np.dot(extension, front[:width])
        pair = np.empty((2, height, 2 * width))
        for k in range(height):
            for j in range(width):
                half = front[width + k, j] - product[k, j] / 2
                pair[0, k, j], pair[0, k, width + j] = extension[k, j], half
                pair[1, k, j], pair[1, k, width + j] = half, extension[k, j]
                front[width + k, j] -= product[k, j]
        subtract_symmetric(update, pair[0], pair[1])


@compiled
def _invert(found, fronts, offsets, updates, diagonals, first, last):  # type: ignore[no-untyped-def]
    """Compute B and Y on the fronts of a range of supernodes, from the root down."""
    nodes, n_kinds = found.nodes, len(updates)
    where = np.empty(nodes.order.size, np.int32)
    local = np.empty(nodes.order.size, np.int64)
    for i in range(last - 1, first - 1, -1):
        begin = nodes.starts[i]
        square, extension, front = _supernode(found, fronts, i)
        height, width = extension.shape
        scaled = np.empty((width, width))
        for k in range(width):
            for j in range(width):
                scaled[k, j] = square[k, j] / found.pivots[begin + k]
        inverse = np.dot(square.T, scaled)
        known = updates[0, offsets[i] : offsets[i] + height * height].reshape((height, height))
        product = np.dot(known, extension)
        share = np.dot(extension.T, product)
        blocks = np.empty((n_kinds, width + height, width))
        for j in range(width):
            for k in range(width):
                blocks[0, k, j] = inverse[k, j] + share[k, j]
            for k in range(height):
                blocks[0, width + k, j] = -product[k, j]
            diagonals[0, begin + j] = blocks[0, j, j]
        if n_kinds == 2:
            slope = np.dot(front[width:], inverse)
            other = updates[1, offsets[i] : offsets[i] + height * height].reshape((height, height))
            plus, minus = np.dot(known, slope), np.dot(other, extension)
            for k in range(height):
                for j in range(width):
                    plus[k, j] -= minus[k, j]
                    blocks[1, width + k, j] = plus[k, j]
            own = np.dot(inverse, np.dot(front[:width], inverse))
            one, two = np.dot(slope.T, product), np.dot(extension.T, plus)
            for k in range(width):
                for j in range(width):
                    blocks[1, k, j] = own[k, j] - one[k, j] - two[k, j]
                diagonals[1, begin + k] = blocks[1, k, k]
        for k in range(height):
            where[nodes.rows[nodes.row_starts[i] + k]] = width + k
        for child in nodes.children[i]:
            if child >= 0:
                count, n_own = locate(nodes, child, i, where, local)
                for kind in range(n_kinds):
                    theirs = updates[kind, offsets[child] : offsets[child] + count * count]
                    whole = updates[kind, offsets[i] : offsets[i] + height * height]
                    for k in range(count):
                        for j in range(k + 1):
                            if j < n_own:
                                entry = blocks[kind, local[k], local[j]]
                            else:
                                entry = whole[(local[k] - width) * height + local[j] - width]
                            theirs[k * count + j] = theirs[j * count + k] = entry
