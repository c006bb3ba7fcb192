"""Threads for work that releases the GIL."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor


def n_threads() -> int:
    """Count the threads worth starting: ``OMP_NUM_THREADS`` if set, else the cores we may use.

    Returns
    -------
    int
        At least 1.

    Examples
    --------
    >>> from unbend.linalg._threads import n_threads
    >>> n_threads() >= 1
    True
    """
    asked = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    if asked.isdigit() and int(asked) > 0:
        return int(asked)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_all(tasks: Iterable[Callable[[], object]]) -> None:
    """Run every task, in threads where there are several tasks and several cores.

    The threads live for this call only: a lasting pool would be dead, and its callers stuck,
    in a forked process. Ctrl-C drops the tasks that have not begun.

    Parameters
    ----------
    tasks : iterable of callables without arguments

    Examples
    --------
    >>> from unbend.linalg._threads import run_all
    >>> seen = set()
    >>> run_all([lambda: seen.add(1), lambda: seen.add(2)])
    >>> sorted(seen)
    [1, 2]
    """
    pending = list(tasks)
    workers = min(n_threads(), len(pending))
    if workers <= 1:
        for task in pending:
            task()
        return
    with ThreadPoolExecutor(workers) as pool:
        for _ in pool.map(lambda task: task(), pending):
            pass
