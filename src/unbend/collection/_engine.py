"""Work on many shapes at once: in this process, in local processes, or on a Dask cluster."""

from __future__ import annotations

import functools
import itertools
import logging
import multiprocessing
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from datetime import timedelta
from multiprocessing import resource_tracker
from typing import Any, NamedTuple

from unbend._arrays import check_whole
from unbend._memory import LIMIT_VARIABLE, available_memory
from unbend._parallel import n_cores
from unbend._types import Progress
from unbend.collection._rows import Failure
from unbend.errors import InputError, MissingExtraError, UnbendError, warn

# Tasks for each thread of the cluster: one is computed while the next waits.
_TASKS_PER_THREAD = 2
_THREADS_PER_ITEM = 50  # see _plan
# Memory that a worker needs, with all its libraries loaded.
_WORKER_BYTES = 2**29
_HEARTBEAT_SECONDS = 0.5
_PATIENCE_SECONDS = 60
_DEADLY = "the worker process crashed twice, perhaps out of memory; try fewer workers"
_THREADS_OF = ("OMP", "OPENBLAS", "MKL", "NUMBA")


class Outcome(NamedTuple):
    """The value of an item, or the reason why there is none."""

    item: Any
    value: Any
    reason: str | None = None


Run = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[list[Outcome]]]
Engine = AbstractContextManager[Run]


def attempt_all(
    run: Run,
    work: Callable[[Any], Iterable[str]],
    tasks: Sequence[Any],
    noun: str,
    progress: Progress | None,
) -> list[Failure]:
    """Work on tasks that have a name, report the progress, and return the failures.

    What `work` returns are its warnings, which are issued here: workers elsewhere are not heard.
    """
    tell, done = counted(progress, noun, len(tasks)), 0
    failures: list[Failure] = []
    for outcomes in run(work, tasks):
        done += len(outcomes)
        failures += [Failure(task.name, why) for task, _, why in outcomes if why is not None]
        tell(done, 0, len(failures))
        for task, said, _ in outcomes:
            for one in said or ():
                warn(f"{task.name}: {one}")
    return failures


def counted(progress: Progress | None, noun: str, total: int) -> Callable[[int, int, int], None]:
    """Wrap a progress callback: report counts, the rate and the time left.

    The wrapper takes the number of items computed, the number skipped, and the number that failed
    among those computed. `noun` is the plural of what is counted.
    """
    start = time.monotonic()

    def tell(computed: int, skipped: int, failed: int) -> None:
        if progress is None:
            return
        done = computed + skipped
        words = [f"{done:,} of {total:,} {noun}"]
        if failed:
            words.append(f"{failed:,} failed")
        if computed:
            rate = computed / max(time.monotonic() - start, 1e-9)
            words.append(f"{rate:.3g} a second")
            if done < total:
                left = timedelta(seconds=round((total - done) / rate))
                words.append(f"{str(left).removeprefix('0:').removeprefix('0')} left")
        progress(", ".join(words), done / max(total, 1))

    return tell


@contextmanager
def engine(*, workers: int | None = None, scheduler: str | None = None) -> Iterator[Run]:
    """Workers from the first item to the end of the block; see `Collection.add` for the options.

    Yields a callable that applies a function, which workers can import, to an iterable of items. It
    gives lists of :class:`Outcome`, in any order and perhaps empty, and takes no more items than
    are worked on. An item that is None yields the results so far, for iterables that take their
    time. A worker that crashes is replaced. The items it had are tried again at the end, one at a
    time; an item whose worker crashes again is reported.
    """
    if workers is not None:
        check_whole(workers, "workers")
        if scheduler is not None:
            raise InputError("a scheduler has workers of its own; leave out workers")
    if workers == 0:
        yield _here
        return
    with ExitStack() as stack:
        start = functools.cache(lambda: stack.enter_context(_client(workers, scheduler)))
        yield functools.partial(_there, start)


def _here(function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[list[Outcome]]:
    for item in items:
        yield [] if item is None else _call(function, [item])


def _there(
    start: Callable[[], Any], function: Callable[[Any], Any], items: Iterable[Any]
) -> Iterator[list[Outcome]]:
    """Work on all items; at the end one at a time on those whose worker crashed."""
    source = iter(items)
    for first in source:
        yield []  # workers take their time to start
        if first is not None:
            break
    else:
        return
    client = start()
    suspects: list[Any] = []
    deadly: list[Any] = []
    yield from _stream(client, function, itertools.chain([first], source), suspects, alone=False)
    yield from _stream(client, function, suspects, deadly, alone=True)
    yield [Outcome(item, None, _DEADLY) for item in deadly]


def _stream(
    client: Any,
    function: Callable[[Any], Any],
    items: Iterable[Any],
    suspects: list[Any],
    *,
    alone: bool,
) -> Iterator[list[Outcome]]:
    """Keep all threads busy, or only one if `alone`; collect the items whose worker crashed."""
    source = iter(items)
    pending: dict[Any, list[Any]] = {}
    finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
    room, size = (1, 1) if alone else _plan(client)
    exhausted, planned = False, time.monotonic()
    while pending or not exhausted:
        passing = False
        while not (exhausted or passing) and len(pending) < room:
            lot = []
            for item in source:
                passing = item is None
                if not passing:
                    lot.append(item)
                if passing or len(lot) == size:
                    break
            else:
                exhausted = True
            if lot:
                future = client.submit(_call, function, lot, pure=False)
                pending[future] = lot
                future.add_done_callback(finished.put)
        results: list[Outcome] = []
        patience = 0 if passing or not pending else _HEARTBEAT_SECONDS
        with suppress(queue.Empty):
            while True:
                future = finished.get(timeout=patience)
                results += _outcomes(future, pending.pop(future), suspects)
                patience = 0
        yield results
        if not alone and time.monotonic() - planned > 10 * _HEARTBEAT_SECONDS:
            (room, size), planned = _plan(client), time.monotonic()  # workers come and go


def _call(function: Callable[[Any], Any], items: list[Any]) -> list[Outcome]:
    """Work on items; any error is the reason why one has no value."""
    outcomes = []
    for item in items:
        try:
            outcomes.append(Outcome(item, function(item)))
        except Exception as error:  # of any kind: other items go on
            outcomes.append(Outcome(item, None, Failure.of("", error).reason))
    return outcomes


def _outcomes(future: Any, lot: list[Any], suspects: list[Any]) -> list[Outcome]:
    from distributed import CancelledError, KilledWorker

    try:
        # If the worker crashed before the result was fetched, Dask computes it again.
        return list(future.result())
    except KilledWorker:
        suspects += lot
        return []
    except CancelledError:
        raise UnbendError(
            "the Dask scheduler went away; what was finished is kept, and the same command goes on "
            "from there"
        ) from None
    except Exception as error:
        return [Outcome(item, None, f"{type(error).__name__}: {error}") for item in lot]


def _plan(client: Any) -> tuple[int, int]:
    """Choose the number of tasks under way, and of items in each.

    A scheduler starts some hundred tasks a second, so on large clusters a task has several items.
    """
    threads = max(sum(map(int, client.nthreads().values())), 1)
    return _TASKS_PER_THREAD * threads, 1 + threads // _THREADS_PER_ITEM


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise MissingExtraError("dask", "distributed") from None
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_PATIENCE_SECONDS // 4, set_as_default=False)
        except (OSError, TypeError, ValueError) as error:
            raise InputError(
                f"no Dask scheduler answers at {scheduler!r}: start one with dask scheduler, and "
                "give the address that it prints, as tcp://host:port"
            ) from error
        with client:
            start = f"dask worker {scheduler} --nthreads 1 starts one"
            _wait_for_workers(client, start)
            if max(client.nthreads().values()) > 1:  # threads of one share the cache's settings
                raise InputError(f"workers must have one thread each: {start}")
            yield client
        return
    if multiprocessing.current_process().daemon:
        raise InputError("a daemonic process can start no workers; use workers=0")
    count, share, memory = _local_shape(workers)
    settings = {
        # The engine itself tries again, one item at a time.
        "distributed.scheduler.allowed-failures": 0,
        # A crashed worker is replaced, however long that takes on a busy machine. By default, the
        # cluster would give up after 15 seconds.
        "distributed.deploy.lost-worker-timeout": "1 day",
        # Memory is used by the current mesh, which cannot be spilled; rows are small.
        "distributed.worker.memory.target": False,
        "distributed.worker.memory.spill": False,
        "distributed.worker.memory.pause": False,
        "distributed.worker.memory.terminate": 0.95,
    }
    with (
        dask.config.set(settings),
        _setting(share, memory),
        ExitStack() as stack,
    ):
        with _interrupted_later():
            cluster = LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                memory_limit=memory,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",  # any free port
                silence_logs=logging.CRITICAL,
                preload=[__name__],
            )
            stack.enter_context(cluster)
        client = stack.enter_context(Client(cluster, set_as_default=False))
        _wait_for_workers(client, "the machine is too busy, or out of memory")
        yield client
        with suppress(TimeoutError):  # Dask cannot stop a worker that is just starting
            client.wait_for_workers(count, timeout=_PATIENCE_SECONDS)


@contextmanager
def _interrupted_later() -> Iterator[None]:
    """Let Ctrl-C wait; processes that start here, which would print tracebacks, never hear it."""
    heard: list[int] = []
    handler = signal.getsignal(signal.SIGINT)
    # A blocked signal may reach another thread, such as a notebook's, and still interrupt this one.
    waits = callable(handler) and threading.current_thread() is threading.main_thread()
    blocks = hasattr(signal, "pthread_sigmask")  # not on Windows
    if waits:
        signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    if blocks:
        resource_tracker.ensure_running()  # to start it later would unblock the signal
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        if blocks:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if waits:
            signal.signal(signal.SIGINT, handler)
        if heard:
            signal.raise_signal(signal.SIGINT)


def dask_setup(worker: Any) -> None:
    """Ignore Ctrl-C, which the parent handles; Dask calls this in each worker as it starts."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _wait_for_workers(client: Any, hint: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_PATIENCE_SECONDS)
    except TimeoutError:
        raise UnbendError(f"no Dask worker came in {_PATIENCE_SECONDS} seconds: {hint}") from None


def _local_shape(workers: int | None) -> tuple[int, int, int]:
    """Choose the number of workers for this machine, and threads and bytes of each."""
    cores, free = n_cores(), available_memory() or 2**33
    count = workers or max(min(cores, free // _WORKER_BYTES), 1)
    return count, max(cores // count, 1), free // count


@contextmanager
def _setting(share: int, memory: int) -> Iterator[None]:
    """Environment of processes started meanwhile: their threads and memory.

    Libraries read the number of threads as they are loaded. Without ``__file__`` and ``__spec__``
    of the main module, the processes do not run the user's script again.
    """
    names: dict[str, Any] = vars(sys.modules["__main__"])
    main = {name: names.pop(name) for name in {"__file__", "__spec__"} & names.keys()}
    names["__spec__"] = None
    before = dict(os.environ)
    os.environ.update({f"{one}_NUM_THREADS": str(share) for one in _THREADS_OF})
    if LIMIT_VARIABLE in os.environ:
        os.environ[LIMIT_VARIABLE] = str(memory / 2**30)
    try:
        yield
    finally:
        names.update(main)
        for name in set(os.environ) - set(before):  # Dask adds some of its own
            del os.environ[name]
        os.environ.update(before)
