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

from unbend._compiled import BLOCK, FLOATS, INTS, LONGS, generated, kernel
from unbend.linalg._chunks import row_address, spread


def _subtract(rows, target, factor, source, width):  # type: ignore[no-untyped-def]
    """``rows[target] -= factor * rows[source]`` for a chunk of constant width."""
    rows[target] -= factor * rows[source]


@generated(_subtract)
def _subtract_row(
    context: Any, rows: Any, target: Any, factor: Any, source: Any, width: Any
) -> Any:  # pragma: no cover - code of a code generator, run by Numba
    count = width.literal_value

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        rows, target, factor, source, _ = arguments
        data = context.make_array(signature.args[0])(context, builder, rows).data

        to = row_address(builder, data, target, count)
        taken = builder.load(row_address(builder, data, source, count), align=8)
        product = builder.fmul(spread(builder, factor, count), taken, flags=("contract",))
        difference = builder.fsub(builder.load(to, align=8), product, flags=("contract",))
        builder.store(difference, to, align=8)
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
        ``solve(starts, rows, entries, inverse_pivots, chunk)``: the strictly lower factor in
        compressed columns, and the right-hand sides, which become the solutions. Releases the GIL.
    """

    def solve(starts: Any, rows: Any, entries: Any, inverse_pivots: Any, chunk: Any) -> None:
        n = inverse_pivots.size
        for j in range(n):
            for p in range(starts[j], starts[j + 1]):
                _subtract_row(chunk, rows[p], entries[p], j, width)
        for j in range(n - 1, -1, -1):
            for c in range(width):
                chunk[j, c] *= inverse_pivots[j]
            for p in range(starts[j], starts[j + 1]):
                _subtract_row(chunk, j, entries[p], rows[p], width)

    return kernel(LONGS, INTS, FLOATS, FLOATS, BLOCK)(solve)
