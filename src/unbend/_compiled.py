"""Numba's compiler, with the options that every kernel here needs, and a cache of compiled code."""

from __future__ import annotations

import os
import pickle
import secrets
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.core.serialize import dumps
from numba.extending import intrinsic

# What kernels are compiled from: the files that import this one, and this one. They use no names
# from other files of ours, which `tests/test_layout.py` checks.
_SOURCES = b""
for _path in sorted(Path(__file__).parent.rglob("*.py")):
    with suppress(OSError):  # a dangling link, which some editors leave
        if b"_compiled import" in (_source := _path.read_bytes()):
            _SOURCES += _source


class _Cache(FunctionCache):  # type: ignore[misc]
    """A folder of compiled code, the same one that Numba would use.

    Processes that compile at the same time can leave Numba's own index naming another's code; it
    knows nothing of imported constants, and fails on a damaged file or a full disk. Here each file
    is complete: a hash of the code for one kernel and one tuple of types, and of all that it
    depends on. A file with a wrong hash is ignored and replaced.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        target_context.refresh()
        with suppress(Exception):  # a file that cannot be read or loaded is as good as none
            path, origin = self._locate(sig, target_context.codegen())
            content = path.read_bytes()
            code = content[len(origin) :]
            if content == _seal(origin, code):
                return self._impl.rebuild(target_context, pickle.loads(code))
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(Exception):  # the next process will have to compile, which is all
            if not self._impl.check_cachable(data):
                return
            path, origin = self._locate(sig, data.codegen)
            code = dumps(self._impl.reduce(data))
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
            try:
                temporary.write_bytes(_seal(origin, code))
                os.replace(temporary, path)
            finally:
                temporary.unlink(missing_ok=True)

    def _locate(self, sig: Any, codegen: Any) -> tuple[Path, bytes]:
        """Give the file for these types, and a hash of everything that its code depends on."""
        key = repr(self._index_key(sig, codegen)).encode()
        stamp = repr((numba.__version__, self._impl.locator.get_source_stamp())).encode()
        name = f"{self._impl.filename_base}-{sha256(key).hexdigest()[:16]}.nbc"
        return Path(self.cache_path, name), sha256(_SOURCES + stamp + key).digest()


def _seal(origin: bytes, code: bytes) -> bytes:
    return sha256(origin + code).digest() + code


def compiled(
    function: Callable[..., Any], fastmath: frozenset[str] = frozenset()
) -> Callable[..., Any]:
    """Compile a kernel that releases the GIL, and keep the code on disk where that is possible.

    It is compiled for the types of its arguments when it is first called with them. `fastmath` are
    liberties that LLVM may take: ``"reassoc"`` adds in whatever order is fastest.
    """
    if numba.config.DISABLE_JIT:
        return function
    made: Any = numba.njit(nogil=True, fastmath=set(fastmath))(function)
    if _SOURCES:  # without them, as in a zip file, old code could not be told from new
        with suppress(Exception):  # no usable folder costs compilations, never the result
            made._cache = _Cache(function)
    return made  # type: ignore[no-any-return]


def generated(plain: Callable[..., Any]) -> Callable[[Callable[..., Any]], Any]:
    """Make a decorator for a generator of LLVM code, to be called in kernels.

    ``plain`` does the same in NumPy. It takes the code's place where Numba's compiler is off
    (``NUMBA_DISABLE_JIT=1``): coverage then sees kernels, and NumPy checks their bounds.
    """
    return (lambda _: plain) if numba.config.DISABLE_JIT else intrinsic(prefer_literal=True)
