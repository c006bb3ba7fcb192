"""Compiled solves with L D L^T for a chunk of right-hand sides at once.

A triangular solve reads the whole factor for every right-hand side, so its time is memory
traffic. Several right-hand sides side by side, row by row, share that traffic: each entry of
the factor becomes one vector operation on a row of the chunk. The vector operation is spelled
as an intrinsic because the compiler's own vectoriser gives up here (it cannot know that two
rows of one array do not overlap), which costs a factor of two.

Importing this module imports Numba; only :mod:`unbend.linalg.factorization` does, when needed.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir

from unbend.linalg._compiled import compiled, generated

_SIGNATURE = (
    "void(int64[::1], int64[::1], int32[::1], float64[::1], float64[::1],"
    " float64[:, ::1], float64[:, ::1], int64)"
)


def _subtract(rows, target, factor, source, width):  # type: ignore[no-untyped-def]
    """``rows[target] -= factor * rows[source]`` for a chunk of constant width."""
    rows[target] -= factor * rows[source]


@generated(_subtract)
def _subtract_row(
    context: Any, rows: Any, target: Any, factor: Any, source: Any, width: Any
) -> Any:  # pragma: no cover - code of a code generator, run by Numba
    count = width.literal_value
    vector = ir.VectorType(ir.DoubleType(), count)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        rows, target, factor, source, _ = arguments
        data = context.make_array(signature.args[0])(context, builder, rows).data

        def address(row: Any) -> Any:
            offset = builder.mul(row, ir.Constant(row.type, count))
            return builder.bitcast(builder.gep(data, [offset]), vector.as_pointer())

        def load(row: Any) -> Any:
            return builder.load(address(row), align=8)

        undefined = ir.Constant(vector, ir.Undefined)
        first = ir.Constant(ir.IntType(32), 0)
        everywhere = ir.Constant(ir.VectorType(ir.IntType(32), count), [0] * count)
        lone = builder.insert_element(undefined, factor, first)
        spread = builder.shuffle_vector(lone, undefined, everywhere)
        product = builder.fmul(spread, load(source), flags=("contract",))
        difference = builder.fsub(load(target), product, flags=("contract",))
        builder.store(difference, address(target), align=8)
        return context.get_dummy_value()

    numbers = numba.types
    signature = numbers.void(rows, numbers.int64, numbers.float64, numbers.int64, width)
    return signature, generate


@functools.cache
def chunk_solver(width: int) -> Callable[..., None]:
    """Compile (or load from Numba's cache) the solver for chunks of ``width`` columns.

    Parameters
    ----------
    width : int
        Number of right-hand sides worked on side by side.

    Returns
    -------
    callable
        ``solve(order, starts, rows, entries, inverse_pivots, rhs, solution, first)``: the strictly
        lower factor in compressed columns, the right-hand sides (n, r), the array the solutions
        go to, and the first column of the chunk. Releases the GIL.
    """

    def solve(
        order: Any,
        starts: Any,
        rows: Any,
        entries: Any,
        inverse_pivots: Any,
        rhs: Any,
        solution: Any,
        first: Any,
    ) -> None:
        n = order.size
        used = min(width, rhs.shape[1] - first)
        chunk = np.empty((n, width))
        for i in range(n):
            for c in range(used):
                chunk[i, c] = rhs[order[i], first + c]
            for c in range(used, width):
                chunk[i, c] = 0.0
        for j in range(n):
            for p in range(starts[j], starts[j + 1]):
                _subtract_row(chunk, rows[p], entries[p], j, width)
        for j in range(n - 1, -1, -1):
            for c in range(width):
                chunk[j, c] *= inverse_pivots[j]
            for p in range(starts[j], starts[j + 1]):
                _subtract_row(chunk, j, entries[p], rows[p], width)
        for i in range(n):
            for c in range(used):
                solution[order[i], first + c] = chunk[i, c]

    return compiled(solve, _SIGNATURE)
