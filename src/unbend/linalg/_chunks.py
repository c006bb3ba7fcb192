"""Right-hand sides side by side, row by row: what compiled solves have in common."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from unbend._compiled import BLOCK, INTS, kernel


@kernel(INTS, BLOCK, "int64", BLOCK, "int64", "int64")
def load(order, rhs, first, chunk, top, bottom):  # type: ignore[no-untyped-def]
    """Put a range of a chunk's rows together.

    From the right-hand sides (n, r), in the factor's order, from column ``first`` on; columns past
    the last one are zero.
    """
    width = chunk.shape[1]
    used = min(width, rhs.shape[1] - first)
    for i in range(top, bottom):
        for c in range(used):
            chunk[i, c] = rhs[order[i], first + c]
        for c in range(used, width):
            chunk[i, c] = 0.0


@kernel(INTS, BLOCK, "int64", BLOCK, "int64", "int64")
def unload(order, chunk, first, solution, top, bottom):  # type: ignore[no-untyped-def]
    """Put a range of a chunk's rows where they belong in the solution (n, r)."""
    used = min(chunk.shape[1], solution.shape[1] - first)
    for i in range(top, bottom):
        for c in range(used):
            solution[order[i], first + c] = chunk[i, c]


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
