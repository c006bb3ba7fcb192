"""How much memory a computation will take, and how much there is: known before the work begins."""

from __future__ import annotations

import ctypes
import os
import sys
from contextlib import suppress
from pathlib import Path

from unbend._cgroups import control_groups
from unbend._text import gib
from unbend.errors import InputError, MeshError

# Memory that a process may take in all, in GiB, whatever the system says. Local workers share it.
LIMIT_VARIABLE = "UNBEND_MEMORY_GIB"

# Entries of the factor for each vertex of a mesh of a million, and the power of the number of
# vertices that they grow with. Measured on subdivided animals: 68 at 200,000 vertices, 80 at
# 1,040,000.
_FILL, _GROWTH = 80.0, 0.12
_VERTEX_BYTES = 1150  # of the mesh, the Laplacian and what the factorisation makes of it
_ROBUST_BYTES = 2_000  # for each face while the robust Laplacian is built; measured: 1,770 to 2,110
# What Numba takes when it is loaded, which systems of so many vertices do.
_COMPILER_BYTES, _COMPILED = 110 * 2**20, 2_000


def needed_memory(n_vertices: int, columns: int = 0) -> int:
    """Predict the bytes that factorising a Laplacian and solving with it take.

    `columns` numbers are kept for each vertex besides. About right for large meshes: within a tenth
    at a million vertices.
    """
    fill = _FILL * (n_vertices / 1e6) ** _GROWTH
    return int(n_vertices * (8 * fill + _VERTEX_BYTES + 8 * columns))


def available_memory() -> int | None:
    """Count the bytes that this process may still take, or None where that cannot be known.

    The user's word counts alone, where there is one; else the least of what the machine has left
    and of what each control group above this process allows.
    """
    limit = _user_limit()
    if limit is not None:
        return limit
    return min((size for size in (_machine(), *_group_limits()) if size is not None), default=None)


def check_memory(name: str, n_vertices: int, columns: int = 0) -> None:
    """Raise MeshError, with the figures, for a mesh whose computation will not fit in memory."""
    needed = needed_memory(n_vertices, columns)
    if n_vertices >= _COMPILED and "numba" not in sys.modules:
        needed += _COMPILER_BYTES
    _refuse_more(needed, f"{name}: {n_vertices:,} vertices need")


def check_robust_memory(name: str, n_faces: int) -> None:
    """Raise MeshError for a mesh whose robust Laplacian will not fit in memory."""
    what = f"{name}: the robust Laplacian of {n_faces:,} faces needs"
    _refuse_more(n_faces * _ROBUST_BYTES, what)


def _refuse_more(needed: int, what: str) -> None:
    there = available_memory()
    if there is not None and needed > there:
        raise MeshError(
            f"{what} about {gib(needed)} of memory and {gib(there)} are free; reduce the mesh to "
            f"fewer vertices first; if there is more, say so with --memory-limit ({LIMIT_VARIABLE})"
        )


def _machine(proc: Path = Path("/proc")) -> int | None:
    with suppress(OSError, ValueError):
        for line in (proc / "meminfo").read_text("utf-8").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    if sys.platform == "win32":
        status = _WindowsMemory(ctypes.sizeof(_WindowsMemory))
        known = ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
        return int(status.available) if known else None
    # Other systems say at least how much there is in all.
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _user_limit(proc: Path = Path("/proc")) -> int | None:
    text = os.environ.get(LIMIT_VARIABLE)
    if text is None:
        return None
    limit = 0
    with suppress(ValueError, OverflowError):
        limit = int(float(text) * 2**30)
    if limit <= 0:
        raise InputError(
            f"the memory limit (--memory-limit, {LIMIT_VARIABLE}) must be a number of GiB above 0, "
            f"not {text!r}"
        )
    return max(limit - resident_memory("self", proc), 0)


def resident_memory(process: str | int | None, proc: Path = Path("/proc")) -> int:
    """Memory that a process takes, in bytes; 0 where the system does not tell."""
    try:
        pages = int((proc / str(process) / "statm").read_text("utf-8").split()[1])
    except (OSError, ValueError, IndexError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


class _WindowsMemory(ctypes.Structure):
    """``MEMORYSTATUSEX``, as Windows fills it in."""

    _fields_ = (
        ("size", ctypes.c_uint32),
        ("load", ctypes.c_uint32),
        ("total", ctypes.c_uint64),
        ("available", ctypes.c_uint64),
        ("others", ctypes.c_uint64 * 5),
    )


def _group_limits(**places: Path) -> list[int | None]:
    """List what the limits of this process's control groups leave."""
    names = ("max", "current"), ("limit_in_bytes", "usage_in_bytes")
    groups = control_groups("memory", **places)
    return [_left(*(one / f"memory.{name}" for name in pair)) for one in groups for pair in names]


def _left(limit: Path, usage: Path) -> int | None:
    try:
        used = int(usage.read_text("utf-8"))
        # Files that are only cached give way when memory is asked for.
        for line in limit.with_name("memory.stat").read_text("utf-8").splitlines():
            if line.split()[0] == "inactive_file":
                used -= int(line.split()[1])
        return max(int(limit.read_text("utf-8")) - used, 0)
    except (OSError, ValueError, IndexError):  # no limit is "max" or no file
        return None
