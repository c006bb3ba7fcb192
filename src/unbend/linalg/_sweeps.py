"""Compiled triangular solves, for a chunk of right-hand sides at once.

A solve's time is memory traffic: a chunk, stored row by row, shares that of the factor. The
innermost loops are generated as LLVM code, for Numba's own take 1.5 to 2 times as long: its
compiler cannot know that two rows do not overlap. Kernels get a chunk's width as a tuple's length.
What generates code runs while Numba compiles, where coverage does not see it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from unbend._compiled import compiled, generated

_REGISTERS = 32  # numbers that are kept in registers
MOST_AT_ONCE = 4  # rows of a product that are computed together: as many as fit, for 8 columns


def _row_vector(width: int) -> Any:
    """Give the LLVM type of a row of a chunk."""
    return ir.VectorType(ir.DoubleType(), width)


def _row_address(builder: Any, data: Any, index: Any, width: int) -> Any:  # pragma: no cover
    """Generate the address of a row of a chunk, to load it from or store it to."""
    offset = builder.mul(index, ir.Constant(index.type, width))
    return builder.bitcast(builder.gep(data, [offset]), _row_vector(width).as_pointer())


def _spread(builder: Any, entry: Any, width: int) -> Any:  # pragma: no cover
    """Generate a row that has a factor's entry in each column."""
    undefined = ir.Constant(_row_vector(width), ir.Undefined)
    first = ir.Constant(ir.IntType(32), 0)
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width)
    lone = builder.insert_element(undefined, entry, first)
    return builder.shuffle_vector(lone, undefined, everywhere)


def _subtract(rows, target, factor, source, lanes):  # type: ignore[no-untyped-def]
    """``rows[target] -= factor * rows[source]`` for a chunk of constant width."""
    rows[target] -= factor * rows[source]


@generated(_subtract)
def _subtract_row(  # type: ignore[no-untyped-def]  # pragma: no cover
    context, rows, target, factor, source, lanes
):
    count = lanes.count

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        rows, target, factor, source, _ = arguments
        data = context.make_array(signature.args[0])(context, builder, rows).data
        to = _row_address(builder, data, target, count)
        taken = builder.load(_row_address(builder, data, source, count), align=8)
        product = builder.fmul(_spread(builder, factor, count), taken, flags=("contract",))
        difference = builder.fsub(builder.load(to, align=8), product, flags=("contract",))
        builder.store(difference, to, align=8)
        return context.get_dummy_value()

    signature = types.void(rows, types.int64, types.float64, types.int64, lanes)
    return signature, generate


@compiled
def solve_chunk(starts, rows, entries, inverse_pivots, chunk, lanes):  # type: ignore[no-untyped-def]
    """Solve with L D L^T, in place; the strictly lower factor is in compressed columns."""
    n = inverse_pivots.size
    for j in range(n):
        for p in range(starts[j], starts[j + 1]):
            _subtract_row(chunk, rows[p], entries[p], j, lanes)
    for j in range(n - 1, -1, -1):
        for c in range(len(lanes)):
            chunk[j, c] *= inverse_pivots[j]
        for p in range(starts[j], starts[j + 1]):
            _subtract_row(chunk, j, entries[p], rows[p], lanes)


def _sums_of_products(  # type: ignore[no-untyped-def]
    entries, start, across, along, source, first, count, target, to, lanes
):
    """Compute a few rows of the product of a part of a matrix with rows of a chunk.

    ``target[to + i] = sum_k entries[start + i across + k along] source[first + k]`` for k below
    ``count``.
    """
    i, k = np.ogrid[: _REGISTERS // len(lanes), :count]
    rows = entries[start + i * across + k * along] @ source[first : first + count]
    target[to : to + len(rows)] = rows


@generated(_sums_of_products)
def _products(  # type: ignore[no-untyped-def]  # pragma: no cover
    context, entries, start, across, along, source, first, count, target, to, lanes
):
    width = lanes.count
    vector, integer = _row_vector(width), ir.IntType(64)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        def pointer(i: int) -> Any:
            return context.make_array(signature.args[i])(context, builder, arguments[i]).data

        _, start, across, along, _, first, count, _, to, _ = arguments
        entries, source, target = pointer(0), pointer(4), pointer(7)
        zero, none = ir.Constant(integer, 0), ir.Constant(vector, [0.0] * width)
        before = builder.block
        loop = builder.append_basic_block("loop")
        after = builder.append_basic_block("after")
        builder.cbranch(builder.icmp_signed(">", count, zero), loop, after)
        builder.position_at_end(loop)
        k, place = builder.phi(integer), builder.phi(integer)
        sums = [builder.phi(vector) for _ in range(_REGISTERS // width)]
        values = builder.load(_row_address(builder, source, builder.add(first, k), width), align=8)
        spot, grown = place, []
        for one in sums:
            entry = _spread(builder, builder.load(builder.gep(entries, [spot])), width)
            product = builder.fmul(entry, values, flags=("contract",))
            grown.append(builder.fadd(one, product, flags=("contract",)))
            spot = builder.add(spot, across)
        following = builder.add(k, ir.Constant(integer, 1))
        steps = [(k, zero, following), (place, start, builder.add(place, along))]
        builder.cbranch(builder.icmp_signed("<", following, count), loop, after)
        builder.position_at_end(after)
        results = [builder.phi(vector) for _ in sums]
        steps += zip(sums + results, [none] * 2 * len(sums), grown * 2, strict=True)
        for phi, initial, later in steps:
            phi.add_incoming(initial, before)
            phi.add_incoming(later, loop)
        for i, result in enumerate(results):
            row = builder.add(to, ir.Constant(integer, i))
            builder.store(result, _row_address(builder, target, row, width), align=8)
        return context.get_dummy_value()

    number = types.int64
    arguments = entries, number, number, number, source, number, number, target, number, lanes
    return types.void(*arguments), generate


@compiled
def forward(found, values, above, below, first, last, lanes):  # type: ignore[no-untyped-def]
    """Solve with L for a range of supernodes; rows from ``below`` on are those of ``above``."""
    nodes, width = found.nodes, len(lanes)
    at_once = _REGISTERS // width
    own = np.empty((found.widest + MOST_AT_ONCE, width))
    sums = np.empty((found.tallest + MOST_AT_ONCE, width))
    for i in range(first, last):
        begin, at = nodes.starts[i], nodes.row_starts[i]
        size, height = nodes.starts[i + 1] - begin, nodes.row_starts[i + 1] - at
        square, low = found.places[i]
        for k in range(0, size, at_once):
            count = min(k + at_once, size)
            _products(
                *(found.squares, square + k * size, size, 1, values, begin, count, own, k, lanes)
            )
        for k in range(size):
            for c in range(width):
                values[begin + k, c] = own[k, c]
        for k in range(0, height, at_once):
            _products(found.lows, low + k * size, size, 1, own, 0, size, sums, k, lanes)
        for k in range(height):
            row = nodes.rows[at + k]
            if row < below:
                for c in range(width):
                    values[row, c] -= sums[k, c]
            else:
                for c in range(width):
                    above[row - below, c] -= sums[k, c]


@compiled
def backward(found, values, first, last, lanes):  # type: ignore[no-untyped-def]
    """Solve with D and L^T for a range of supernodes."""
    nodes, width = found.nodes, len(lanes)
    at_once = _REGISTERS // width
    own = np.empty((found.widest, width))
    sums = np.empty((found.widest + MOST_AT_ONCE, width))
    known = np.empty((found.tallest, width))
    for i in range(last - 1, first - 1, -1):
        begin, at = nodes.starts[i], nodes.row_starts[i]
        size, height = nodes.starts[i + 1] - begin, nodes.row_starts[i + 1] - at
        square, low = found.places[i]
        for k in range(height):
            for c in range(width):
                known[k, c] = values[nodes.rows[at + k], c]
        for k in range(0, size, at_once):
            _products(found.lows, low + k, 1, size, known, 0, height, sums, k, lanes)
        for k in range(size):
            inverse = 1 / found.pivots[begin + k]
            for c in range(width):
                own[k, c] = values[begin + k, c] * inverse - sums[k, c]
        for k in range(0, size, at_once):
            start, count = square + k * size + k, size - k
            _products(found.squares, start, 1, size, own, k, count, sums, k, lanes)
        for k in range(size):
            for c in range(width):
                values[begin + k, c] = sums[k, c]
