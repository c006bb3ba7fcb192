"""Work on many shapes at once: in this process, in local processes, or on a Dask cluster."""

from __future__ import annotations

import atexit
import functools
import logging
import os
import queue
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

from unbend._memory import LIMIT_VARIABLE, available_memory
from unbend._parallel import n_cores
from unbend.errors import InputError, MissingExtraError, UnbendError

# Tasks given out for each thread of the cluster: one is computed, one waits beside it.
_TASKS_PER_THREAD = 2
_THREADS_PER_ITEM = 50  # see _plan
# Memory that a worker with all its libraries loaded needs to get anywhere.
_WORKER_BYTES = 2**29
_HEARTBEAT_SECONDS = 0.5
_PATIENCE_SECONDS = 60
_DEADLY = "the worker process crashed twice, perhaps out of memory; try fewer workers"
_THREADS_OF = ("OMP", "OPENBLAS", "MKL", "NUMBA")


class Outcome(NamedTuple):
    """What came of an item: a value, or the reason why there is none."""

    item: Any
    value: Any
    reason: str | None = None


Run = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[list[Outcome]]]


@contextmanager
def engine(*, workers: int | None = None, scheduler: str | None = None) -> Iterator[Run]:
    """Make workers ready for as long as the ``with`` block lasts.

    What it yields calls a function on every item, and tells what came of them as it comes. No
    more items are taken than are worked on, so that there may be any number of them; an item that
    is None only lets results pass, from an iterable that takes its time.

    A worker that dies is replaced. Items that it was given are tried once more at the end, one at
    a time: where the worker dies again, the item is the reason.

    Parameters
    ----------
    workers : int, optional
        Number of local processes; by default as many as the machine and its control groups have
        processors and memory for. 0: work in this process, which a crash then ends.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:port``, whose workers to use instead.

    Yields
    ------
    callable
        Of a function that workers can import, which raises nothing, and an iterable of items;
        gives lists of :class:`Outcome`, in any order, perhaps empty.

    Raises
    ------
    InputError
        If `workers` is negative or given beside `scheduler`, or nobody answers at that address.
    MissingExtraError
        If Dask is not installed.
    """
    if workers is not None and workers < 0:
        raise InputError(f"workers must be 0 or more, not {workers}")
    if workers is not None and scheduler is not None:
        raise InputError("a scheduler has workers of its own; leave out workers")
    if workers == 0:
        yield _here
        return
    with _client(workers, scheduler) as client:
        yield functools.partial(_there, client)


def _here(function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[list[Outcome]]:
    for item in items:
        yield [] if item is None else [Outcome(item, function(item))]


def _there(
    client: Any, function: Callable[[Any], Any], items: Iterable[Any]
) -> Iterator[list[Outcome]]:
    suspects: list[Any] = []
    yield from _stream(client, function, items, suspects, alone=False)
    again: list[Any] = []
    yield from _stream(client, function, suspects, again, alone=True)
    yield [Outcome(item, None, _DEADLY) for item in again]


def _stream(
    client: Any,
    function: Callable[[Any], Any],
    items: Iterable[Any],
    suspects: list[Any],
    *,
    alone: bool,
) -> Iterator[list[Outcome]]:
    """Keep all threads busy, or with `alone` one; collect the items whose worker died."""
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
        for future in _arrived(finished, 0 if passing or not pending else _HEARTBEAT_SECONDS):
            results += _outcomes(future, pending.pop(future), suspects)
        yield results
        if not alone and time.monotonic() - planned > 10 * _HEARTBEAT_SECONDS:
            (room, size), planned = _plan(client), time.monotonic()  # workers come and go


def _call(function: Callable[[Any], Any], items: list[Any]) -> list[Any]:
    return [function(item) for item in items]


def _outcomes(future: Any, lot: list[Any], suspects: list[Any]) -> list[Outcome]:
    from distributed import CancelledError, KilledWorker

    try:
        # Where the worker died before this was fetched, it is worked out anew, which may fail.
        values = future.result()
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
    return [Outcome(item, value) for item, value in zip(lot, values, strict=True)]


def _arrived(finished: queue.SimpleQueue[Any], patience: float) -> list[Any]:
    """Whatever is in a queue, after waiting a while for the first."""
    found = []
    try:
        found.append(finished.get(timeout=patience) if patience else finished.get_nowait())
        while True:
            found.append(finished.get_nowait())
    except queue.Empty:
        return found


def _plan(client: Any) -> tuple[int, int]:
    """Choose how many tasks are under way, and how many items each has.

    A scheduler can give out some hundred tasks a second: where there are many threads, each takes
    several items at once.
    """
    threads = max(sum(map(int, client.nthreads().values())), 1)
    return _TASKS_PER_THREAD * threads, 1 + threads // _THREADS_PER_ITEM


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    try:
        import dask
        from distributed import Client
    except ImportError:
        raise MissingExtraError("dask", "distributed") from None
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_PATIENCE_SECONDS // 4, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(
                f"no Dask scheduler answers at {scheduler!r}: start one with dask scheduler, and "
                "give the address that it prints, as tcp://host:port"
            ) from error
        with client:
            _wait_for_workers(client, f"dask worker {scheduler} starts one")
            yield client
        return
    count, share, memory = _local_shape(workers)
    settings = {
        # The engine tries again by itself, apart from others that only stood beside.
        "distributed.scheduler.allowed-failures": 0,
        # A worker that died is replaced, however long a busy machine takes to start another:
        # after the 15 seconds that are the default, the cluster would give it up for good.
        "distributed.deploy.lost-worker-timeout": "1 day",
        # Rows are small: what grows is what the mesh at hand takes, which cannot be spilled.
        "distributed.worker.memory.target": False,
        "distributed.worker.memory.spill": False,
        "distributed.worker.memory.pause": False,
        "distributed.worker.memory.terminate": 0.95,
    }
    with (
        dask.config.set(settings),
        _setting(share, memory),
        _local_cluster(
            n_workers=count,
            threads_per_worker=1,
            memory_limit=memory,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # whichever is free
            silence_logs=logging.CRITICAL,
            preload=[__name__],
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        _wait_for_workers(client, "the machine is too busy, or out of memory")
        yield client
        with suppress(TimeoutError):  # Dask cannot end a worker that is only just starting again
            client.wait_for_workers(count, timeout=_PATIENCE_SECONDS)


def _local_cluster(**options: Any) -> Any:
    from distributed import LocalCluster
    from distributed.deploy import spec

    try:
        return LocalCluster(**options)
    except KeyboardInterrupt:
        # At exit Dask would complain of a cluster half made, whose processes end with this one.
        atexit.unregister(spec.close_clusters)
        raise


def dask_setup(worker: Any) -> None:
    """Leave Ctrl-C to the parent, which ends its workers; Dask calls this in each as it starts."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _wait_for_workers(client: Any, hint: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_PATIENCE_SECONDS)
    except TimeoutError:
        raise UnbendError(f"no Dask worker came in {_PATIENCE_SECONDS} seconds: {hint}") from None


def _local_shape(workers: int | None) -> tuple[int, int, int]:
    """Workers, threads of each, and bytes of each, that this machine has room for."""
    cores, free = n_cores(), available_memory() or 2**33
    count = workers or max(min(cores, free // _WORKER_BYTES), 1)
    return count, max(cores // count, 1), free // count


@contextmanager
def _setting(share: int, memory: int) -> Iterator[None]:
    """Put things as processes started meanwhile shall find them, and back in the end.

    They are held to their share of threads, which libraries read as they are loaded, and of the
    memory that the user allows, if that was said; and they do
    not run the user's script again, of which they need nothing.
    """
    names: dict[str, Any] = vars(sys.modules["__main__"])
    hidden: list[str] = [name for name in ("__file__", "__spec__") if name in names]
    main = {name: names.pop(name) for name in hidden}
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
