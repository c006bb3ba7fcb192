"""Compiled triangular sweeps with a multifrontal factor, for a chunk of right-hand sides at once.

A sweep reads the whole factor for every right-hand side, so its time is memory traffic. Several
right-hand sides side by side, row by row, share that traffic: an entry of the factor meets a row
of the chunk. The loop that this leads to is spelled as an intrinsic because the compiler's own
vectoriser does not keep rows of the result in registers.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir

from unbend._compiled import BLOCK, FLOATS, INTS, LONGS, PAIRS, generated, kernel
from unbend.linalg._chunks import row_address, row_vector, spread

PANEL = 4  # columns of the factor that are stored together


def _sums_of_products(  # type: ignore[no-untyped-def]
    entries,
    start,
    across,
    within,
    along,
    source,
    first,
    step,
    count,
    target,
    to,
    n_rows,
    unrolled,
    width,
):
    """Rows of the product of a piece of a matrix with rows of a chunk.

    ``target[to + i] = sum_kq entries[start + i across + q within + k along] source[first + k step
    + q]`` for i below ``n_rows``, k below ``count`` and q below ``unrolled``.
    """
    i, k, q = np.ogrid[:n_rows, :count, :unrolled]
    piece = entries[start + i * across + q * within + k * along]
    target[to : to + n_rows] = np.einsum("ikq,jkqc->ic", piece, source[first + k * step + q])


@generated(_sums_of_products)
def _products(
    context: Any,
    entries: Any,
    start: Any,
    across: Any,
    within: Any,
    along: Any,
    source: Any,
    first: Any,
    step: Any,
    count: Any,
    target: Any,
    to: Any,
    n_rows: Any,
    unrolled: Any,
    width: Any,
) -> Any:  # pragma: no cover - code of a code generator, run by Numba
    n_sums, steps, n_columns = (
        n_rows.literal_value,
        unrolled.literal_value,
        width.literal_value,
    )
    vector = row_vector(n_columns)
    integer = ir.IntType(64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        entries, start, across, within, along, source, first, step, count, target, to = arguments[
            :11
        ]
        types = signature.args
        factor = context.make_array(types[0])(context, builder, entries).data
        chunk = context.make_array(types[5])(context, builder, source).data
        result = context.make_array(types[9])(context, builder, target).data

        def number(value: int) -> Any:
            return ir.Constant(integer, value)

        def address(data: Any, index: Any) -> Any:
            return row_address(builder, data, index, n_columns)

        before = builder.block
        loop = builder.append_basic_block("loop")
        after = builder.append_basic_block("after")
        builder.cbranch(builder.icmp_signed(">", count, number(0)), loop, after)
        builder.position_at_end(loop)
        k, place = builder.phi(integer), builder.phi(integer)
        sums = [builder.phi(vector) for _ in range(n_sums)]
        grown: list[Any] = list(sums)
        for q in range(steps):
            index = builder.add(builder.mul(k, step), number(q))
            values = builder.load(address(chunk, builder.add(first, index)), align=8)
            spot = builder.add(place, builder.mul(within, number(q)))
            for i in range(n_sums):
                entry = builder.load(builder.gep(factor, [spot]))
                product = builder.fmul(
                    spread(builder, entry, n_columns), values, flags=("contract",)
                )
                grown[i] = builder.fadd(grown[i], product, flags=("contract",))
                spot = builder.add(spot, across)
        following = builder.add(k, number(1))
        k.add_incoming(number(0), before)
        k.add_incoming(following, loop)
        place.add_incoming(start, before)
        place.add_incoming(builder.add(place, along), loop)
        builder.cbranch(builder.icmp_signed("<", following, count), loop, after)
        builder.position_at_end(after)
        zero = ir.Constant(vector, [0.0] * n_columns)
        results = [builder.phi(vector) for _ in range(n_sums)]
        for i in range(n_sums):
            sums[i].add_incoming(zero, before)
            sums[i].add_incoming(grown[i], loop)
            results[i].add_incoming(zero, before)
            results[i].add_incoming(grown[i], loop)
        for i in range(n_sums):
            builder.store(results[i], address(result, builder.add(to, number(i))), align=8)
        return context.get_dummy_value()

    long = numba.types.int64
    return numba.types.void(
        *(entries, long, long, long, long, source, long, long, long, target, long),
        *(n_rows, unrolled, width),
    ), generate


@functools.cache
def sweeps(width: int) -> tuple[Callable[..., None], Callable[..., None]]:
    """Compile (or load from Numba's cache) the sweeps for chunks of ``width`` columns.

    Parameters
    ----------
    width : int
        Number of right-hand sides worked on side by side.

    Returns
    -------
    forward, backward : callables
        The solves with L, and with D and L^T, for a range of supernodes. They release the GIL.
    """
    rows_at_once = min(PANEL, 32 // width)  # as many as fit into registers

    def forward(
        most: Any,
        begins: Any,
        row_starts: Any,
        rows: Any,
        places: Any,
        squares: Any,
        panels: Any,
        values: Any,
        above: Any,
        below: Any,
        first: Any,
        last: Any,
    ) -> None:
        widest, tallest = most
        own = np.zeros((widest + PANEL, width))
        sums = np.empty((tallest + PANEL, width))
        for i in range(first, last):
            begin, at = begins[i], row_starts[i]
            size, height = begins[i + 1] - begin, row_starts[i + 1] - at
            for k in range(0, size, rows_at_once):
                _products(
                    squares,
                    places[i, 0] + k * size,
                    size,
                    0,
                    1,
                    values,
                    begin,
                    1,
                    min(k + rows_at_once, size),
                    own,
                    k,
                    rows_at_once,
                    1,
                    width,
                )
            for k in range(size):
                for c in range(width):
                    values[begin + k, c] = own[k, c]
            for k in range(size, size + PANEL):  # of a last panel that is not full
                for c in range(width):
                    own[k, c] = 0.0
            for k in range(0, height, rows_at_once):
                _products(
                    panels,
                    places[i, 1] + k * PANEL,
                    PANEL,
                    1,
                    PANEL * height,
                    own,
                    0,
                    PANEL,
                    (size + PANEL - 1) // PANEL,
                    sums,
                    k,
                    rows_at_once,
                    PANEL,
                    width,
                )
            for k in range(height):
                row = rows[at + k]
                if row < below:
                    for c in range(width):
                        values[row, c] -= sums[k, c]
                else:
                    for c in range(width):
                        above[row - below, c] -= sums[k, c]

    def backward(
        most: Any,
        begins: Any,
        row_starts: Any,
        rows: Any,
        places: Any,
        squares: Any,
        panels: Any,
        pivots: Any,
        values: Any,
        first: Any,
        last: Any,
    ) -> None:
        widest, tallest = most
        own = np.empty((widest + PANEL, width))
        sums = np.empty((widest + PANEL, width))
        known = np.empty((tallest, width))
        for i in range(last - 1, first - 1, -1):
            begin, at = begins[i], row_starts[i]
            size, height = begins[i + 1] - begin, row_starts[i + 1] - at
            for k in range(height):
                for c in range(width):
                    known[k, c] = values[rows[at + k], c]
            for k in range((size - 1) // rows_at_once * rows_at_once, -1, -rows_at_once):
                _products(
                    panels,
                    places[i, 1] + k // PANEL * PANEL * height + k % PANEL + (height - 1) * PANEL,
                    1,
                    0,
                    -PANEL,
                    known,
                    height - 1,
                    -1,
                    height,
                    sums,
                    k,
                    rows_at_once,
                    1,
                    width,
                )
            for k in range(size):
                inverse = 1 / pivots[begin + k]
                for c in range(width):
                    own[k, c] = values[begin + k, c] * inverse - sums[k, c]
            for k in range((size - 1) // rows_at_once * rows_at_once, -1, -rows_at_once):
                _products(
                    squares,
                    places[i, 0] + k * size + k,
                    1,
                    0,
                    size,
                    own,
                    k,
                    1,
                    size - k,
                    sums,
                    k,
                    rows_at_once,
                    1,
                    width,
                )
            for k in range(size):
                for c in range(width):
                    values[begin + k, c] = sums[k, c]

    tree = ("UniTuple(int64, 2)", LONGS, LONGS, INTS, PAIRS, FLOATS, FLOATS)
    ranges = ("int64", "int64")
    return (
        kernel(*tree, BLOCK, BLOCK, "int64", *ranges)(forward),
        kernel(*tree, FLOATS, BLOCK, *ranges)(backward),
    )
