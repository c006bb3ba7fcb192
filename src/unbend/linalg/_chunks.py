"""Right-hand sides side by side, row by row: what compiled solves have in common."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from llvmlite import ir

from unbend._compiled import BLOCK, INTS, kernel


@functools.cache
def moves(width: int) -> tuple[Callable[..., None], Callable[..., None]]:
    """Compile (or load from Numba's cache) the ways into a chunk of ``width`` columns and out.

    Parameters
    ----------
    width : int
        Number of right-hand sides worked on side by side.

    Returns
    -------
    load, unload : callables
        ``load(order, rhs, first, chunk, top, bottom)`` puts a range of the chunk's rows together
        from the right-hand sides (n, r), in the factor's order, from column ``first`` on; columns
        past the last one are zero. ``unload(order, chunk, first, solution, top, bottom)`` puts
        rows of the chunk where they belong in the solution. They release the GIL.
    """

    def load(order: Any, rhs: Any, first: Any, chunk: Any, top: Any, bottom: Any) -> None:
        used = min(width, rhs.shape[1] - first)
        for i in range(top, bottom):
            for c in range(used):
                chunk[i, c] = rhs[order[i], first + c]
            for c in range(used, width):
                chunk[i, c] = 0.0

    def unload(order: Any, chunk: Any, first: Any, solution: Any, top: Any, bottom: Any) -> None:
        used = min(width, solution.shape[1] - first)
        for i in range(top, bottom):
            for c in range(used):
                solution[order[i], first + c] = chunk[i, c]

    moved = kernel(INTS, BLOCK, "int64", BLOCK, "int64", "int64")
    return moved(load), moved(unload)


def row_vector(width: int) -> Any:
    """Give the LLVM type of a row of a chunk."""
    return ir.VectorType(ir.DoubleType(), width)


def row_address(
    builder: Any, data: Any, index: Any, width: int
) -> Any:  # pragma: no cover - generates code while Numba compiles
    """Generate the address of a row of a chunk, to load it from or store it to."""
    offset = builder.mul(index, ir.Constant(index.type, width))
    return builder.bitcast(builder.gep(data, [offset]), row_vector(width).as_pointer())


def spread(
    builder: Any, entry: Any, width: int
) -> Any:  # pragma: no cover - generates code while Numba compiles
    """Generate a row that has a factor's entry in each column."""
    undefined = ir.Constant(row_vector(width), ir.Undefined)
    first = ir.Constant(ir.IntType(32), 0)
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width)
    lone = builder.insert_element(undefined, entry, first)
    return builder.shuffle_vector(lone, undefined, everywhere)
