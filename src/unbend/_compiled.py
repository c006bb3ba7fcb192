"""Numba's compiler, with the options that every kernel here needs."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numba
from numba.extending import intrinsic

# Types of arrays that kernels are compiled for.
INTS, LONGS, FLOATS = "int32[::1]", "int64[::1]", "float64[::1]"
PAIRS, BLOCK = "int64[:, ::1]", "float64[:, ::1]"


def compiled(
    function: Callable[..., Any],
    signature: str | None = None,
    fastmath: frozenset[str] = frozenset(),
) -> Callable[..., Any]:
    """Compile a kernel that releases the GIL, and keep the code on disk where that is possible.

    Parameters
    ----------
    function : callable
        Written in what Numba understands.
    signature : str, optional
        Types to compile for at once; by default it is compiled when first called.
    fastmath : frozenset of str
        Liberties that LLVM may take: ``"reassoc"`` adds in whatever order is fastest.

    Returns
    -------
    callable
    """
    signatures = [] if signature is None else [signature]
    options: dict[str, Any] = {"nogil": True, "fastmath": set(fastmath)}
    try:
        kernel: Callable[..., Any] = numba.njit(*signatures, **options, cache=True)(function)
    except Exception:  # no usable cache folder costs compilations, never the result
        kernel = numba.njit(*signatures, **options)(function)
    return kernel


def kernel(*types: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make a decorator that compiles for arguments of these types at once."""
    return functools.partial(compiled, signature=f"({', '.join(types)})")


def generated(plain: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make a decorator for a generator of LLVM code, to be called in kernels.

    Parameters
    ----------
    plain : callable
        The same in NumPy. It says what the code does, and takes its place where Numba's compiler
        is off (``NUMBA_DISABLE_JIT=1``): coverage then sees kernels, and NumPy minds their bounds.

    Returns
    -------
    callable
    """

    def choose(generator: Callable[..., Any]) -> Callable[..., Any]:
        if numba.config.DISABLE_JIT:
            return plain
        made: Callable[..., Any] = intrinsic(prefer_literal=True)(generator)
        return made

    return choose
