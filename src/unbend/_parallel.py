"""Threads for work that releases the GIL."""

from __future__ import annotations

import functools
import math
import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from contextvars import copy_context
from pathlib import Path
from typing import Any

import numpy as np
import threadpoolctl

from unbend._cgroups import control_groups
from unbend._types import FloatArray

COLUMNS = 16  # of a block worked on side by side: one row of them is two cache lines
_lock = threading.Lock()  # for what follows
_pools: dict[int, ThreadPoolExecutor] = {}  # none or one, by its size
_pins: list[Any] = []


def n_threads() -> int:
    """Count the threads worth starting: ``OMP_NUM_THREADS`` if set, else the cores we may use."""
    asked = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if asked.isdecimal() and int(asked) > 0:
        return int(asked)
    return n_cores()


def n_cores() -> int:
    """Count the processors that this process is bound to, as far as its quotas allow.

    Threads beyond a control group's quota of processor time are stopped until its period ends.
    """
    bound = hasattr(os, "sched_getaffinity")
    cores = len(os.sched_getaffinity(0)) if bound else os.cpu_count() or 1
    return min(cores, _quota())


@functools.cache  # it takes longer to find than many a task
def _quota(**places: Path) -> int:
    """Count the processors whose time the tightest control group allows, rounded up."""
    least = float(os.cpu_count() or 1)
    for group in control_groups("cpu", **places):
        for names in (["cpu.max"], ["cpu.cfs_quota_us", "cpu.cfs_period_us"]):
            with suppress(OSError, ValueError, ZeroDivisionError):  # no limit: "max", -1, no file
                quota, period = " ".join((group / one).read_text("utf-8") for one in names).split()
                if int(quota) > 0:
                    least = min(least, int(quota) / int(period))
    return math.ceil(least)


def run_all(tasks: Iterable[Callable[[], Any]]) -> list[Any]:
    """Run every task, in threads where there are several tasks and several cores.

    The caller works too, and waits only for what others have begun: so tasks may call this
    themselves. An error or Ctrl-C drops the rest.
    """
    pending = deque(enumerate(tasks))
    if len(pending) == 1:
        return [pending[0][1]()]
    results = [None] * len(pending)

    def work() -> None:
        try:
            while True:
                try:
                    i, task = pending.popleft()
                except IndexError:
                    return
                results[i] = task()
        except BaseException:
            pending.clear()
            raise

    helpers = _start(work, len(pending) - 1)
    try:
        work()
    finally:
        busy = [helper for helper in helpers if not helper.cancel()]
        wait(busy)
    for helper in busy:
        helper.result()  # raises what went wrong there
    return results


def _start(work: Callable[[], None], most: int) -> list[Future[None]]:
    """Call a function in up to so many helper threads, which stay and are shared by all calls."""
    count = n_threads() - 1
    if min(count, most) < 1 or not threading.main_thread().is_alive():  # Python ends: none start
        return []
    with _lock:
        if count not in _pools:
            for pool in _pools.values():
                pool.shutdown(wait=False)
            _pools.clear()
            _pools[count] = ThreadPoolExecutor(count, "unbend")
        return [_pools[count].submit(copy_context().run, work) for _ in range(min(count, most))]


def _begin_anew() -> None:
    """Forget, in a forked process, the threads of the other one and what they were about."""
    global _lock, _pins
    _lock = threading.Lock()
    _pools.clear()
    if _pins:
        _as_controller(_pins[0].restore_original_limits)
    _pins = []


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_anew)


def in_chunks(order: Any, solve: Callable[[FloatArray], None], rhs: FloatArray) -> FloatArray:
    """Solve for a block of right-hand sides, (n, r), a chunk of columns at a time, in threads.

    A chunk has the rows of the block in a factor's order, and 8 or 16 columns; those past the last
    one are zero. Eight columns cost little more than one.
    """
    n, count = rhs.shape
    width = COLUMNS // 2 if count <= COLUMNS // 2 else COLUMNS
    solution = np.empty_like(rhs)

    def work(part: slice) -> None:
        chunk = np.zeros((n, width))
        used = part.stop - part.start
        chunk[:, :used] = rhs[order, part]
        solve(chunk)
        solution[order, part] = chunk[:, :used]

    run_all(functools.partial(work, part) for part in slices(count, COLUMNS))
    return solution


def by_columns(work: Callable[[FloatArray], FloatArray], block: FloatArray) -> FloatArray:
    """Apply a function, (n, r) to (n, r), to a chunk of columns at a time, in threads."""
    if block.ndim == 1 or block.shape[1] <= COLUMNS:
        return work(block)
    result = np.empty(block.shape)

    def at(part: slice) -> None:
        result[:, part] = work(np.ascontiguousarray(block[:, part]))

    run_all(functools.partial(at, part) for part in slices(block.shape[1], COLUMNS))
    return result


def slices(count: int, size: int) -> list[slice]:
    """Cut rows or columns into pieces of a size, for one task each."""
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Pin BLAS to one thread, in the whole process.

    Results then do not depend on the number of threads, and narrow products are faster. Several
    threads may be inside at once; the last one out restores the number that the first one found.
    """
    with _lock:
        pins = _pins  # a forked process has a list of its own
        pin = functools.partial(_blas().limit, limits=1, user_api="blas")
        pins.append(None if pins else _as_controller(pin))
    try:
        yield
    finally:
        with _lock:
            # The limit is first in the list: drop a later entry while others are inside.
            if len(pins) > 1:
                pins.pop()
            else:
                _as_controller(pins.pop().restore_original_limits)


def _as_controller(change: Callable[[], Any]) -> Any:
    """Change the number of BLAS threads, from any thread.

    threadpoolctl lets only the thread that first set OpenBLAS's number set it again, and ignores
    all others in silence, until that thread gives up control.
    """
    release = threadpoolctl.OpenBLASController.clear_controlling_thread
    release(force=True)
    changed = change()
    release(force=True)
    return changed


@functools.cache
def _blas() -> Any:
    import scipy.linalg  # noqa: F401 - loads the second BLAS, which must be found too

    return threadpoolctl.ThreadpoolController()  # slow: it looks at every loaded library
