"""A process that runs one job at a time, so that jobs can be cancelled and survived."""

from __future__ import annotations

import functools
import json
import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from unbend._memory import LIMIT_VARIABLE, resident_memory
from unbend._types import Progress
from unbend.errors import UnbendError, heard

_SECONDS_BETWEEN_CHECKS = 0.2
_SECONDS_BETWEEN_REPORTS = 0.1


class Worker:
    """Run jobs in another process, which is replaced as soon as it ends.

    Jobs and answers are JSON: nothing that a job has read is unpickled here. A job that will need
    more than so many bytes of memory is refused, and one that takes more is ended, where the system
    tells what a process takes.
    """

    def __init__(self, memory: int) -> None:
        self._memory = memory
        self._lock = threading.Lock()
        self._closed = False
        self._start()

    def begin(self) -> Callable[[dict[str, Any], Progress], dict[str, Any]]:
        """Return what runs one job: cancelled from now on, it gives {}."""
        with self._lock:
            return functools.partial(self._run, self._process, self._pipe)

    def _run(
        self, process: Any, pipe: Connection, job: dict[str, Any], progress: Progress
    ) -> dict[str, Any]:
        """Run a job to its end: give its result, ``{"error": sentence}``, or {} if cancelled."""
        trouble = ""
        try:
            pipe.send_bytes(json.dumps(job).encode())
            while True:
                if resident_memory(process.pid) > self._memory:
                    trouble = "this needs more memory than there is: reduce the shape first"
                    process.kill()
                if not pipe.poll(_SECONDS_BETWEEN_CHECKS):
                    continue
                answer: dict[str, Any] = json.loads(pipe.recv_bytes())
                if "stage" not in answer:
                    return answer
                progress(answer["stage"], answer["share"])
        except (EOFError, OSError):
            with self._lock:
                if process is not self._process or self._closed:
                    return {}
                process.join()
                self._start()
            ended = f"the computation ended unexpectedly (exit code {process.exitcode})"
            again = "nothing else was lost: try again, or with a reduced shape"
            return {"error": trouble or f"{ended}; {again}"}

    def cancel(self) -> None:
        """End the process, and with it the job that it runs."""
        with self._lock:
            self._end()
            self._start()

    def close(self) -> None:
        with self._lock:
            self._closed = True
            self._end()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(theirs, self._memory), daemon=True)
        self._process.start()
        theirs.close()

    def _end(self) -> None:
        self._process.kill()
        self._process.join()


def _work(pipe: Connection, memory: int) -> None:
    """Run the jobs that come through the pipe until its other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.environ[LIMIT_VARIABLE] = str(memory / 2**30)
    warnings.simplefilter("ignore")  # but ours, which are heard
    from unbend.app._jobs import run

    last = 0.0

    def progress(stage: str, share: float) -> None:
        nonlocal last
        if time.monotonic() - last > _SECONDS_BETWEEN_REPORTS:
            last = time.monotonic()
            pipe.send_bytes(json.dumps({"stage": stage, "share": share}).encode())

    while True:
        try:
            job = json.loads(pipe.recv_bytes())
        except EOFError:
            return
        last = 0.0
        pipe.send_bytes(json.dumps(_answer(run, job, progress)).encode())


def _answer(run: Any, job: dict[str, Any], progress: Progress) -> dict[str, Any]:
    """Call a function, and turn what it raises into a sentence."""
    try:
        with heard() as said:
            found: dict[str, Any] = run(job, progress)
    except UnbendError as error:
        return {"error": str(error)}
    except MemoryError:
        return {"error": "there is too little memory: reduce the shape to fewer vertices first"}
    except Exception as error:  # a bug of ours; the session goes on
        return {"error": f"unbend failed ({type(error).__name__}: {error}); please report this"}
    return found | {"warnings": said}


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
