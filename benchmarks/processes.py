"""Work in several processes, with progress on stderr."""

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any


def run_all(
    tasks: Sequence[tuple[Any, ...]],
    n_jobs: int,
    on_result: Callable[[Any], object] | None = None,
    set_up: Callable[[], object] | None = None,
) -> list[Any]:
    """Call functions, each given with its arguments, so many at a time: results in their order.

    ``on_result`` is given each as soon as it is there; ``set_up`` is called in each new process.
    """
    if n_jobs > 1:  # then each does with one thread
        os.environ.setdefault("OMP_NUM_THREADS", "1")
    with ProcessPoolExecutor(n_jobs, get_context("spawn"), set_up) as pool:
        running = [pool.submit(*task) for task in tasks]
        for done, one in enumerate(as_completed(running), start=1):
            if on_result is not None:
                on_result(one.result())
            print(f"\r{done} of {len(running)}", end="", file=sys.stderr, flush=True)
        print(file=sys.stderr)
        return [one.result() for one in running]
