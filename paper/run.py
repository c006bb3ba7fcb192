"""What an experiment gets, and how its work is spread over processes and kept."""

import multiprocessing
import os
import re
import signal
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import threadpoolctl

from paper.collection import Collection
from unbend.errors import UnbendWarning
from unbend.io import atomic_write

Arrays = dict[str, np.ndarray[Any, Any]]
Key = str | int | float | bool | None


@dataclass(frozen=True)
class Run:
    """What an experiment gets.

    Attributes
    ----------
    shapes : Collection
        The shapes of TOSCA, or our own in the same layout; empty where only SCAPE is there.
    scape : Collection or None
        One person in many poses, numbered alike: SCAPE, or a figure of our own.
    quick : bool
        Whether few and small shapes shall do.
    jobs : int
        Processes at a time.
    store : Path
        Folder of finished pieces; another one for other data.
    progress : callable
        Called with what is under way.
    """

    shapes: Collection
    scape: Collection | None
    quick: bool
    jobs: int
    store: Path
    progress: Callable[[str], None]


def kept(store: Path, key: str, compute: Callable[[], Arrays]) -> Arrays:
    """Load a piece that was finished before, or compute and keep it.

    Parameters
    ----------
    store : Path
        A folder; made if it is missing.
    key : str
        Name of the piece, a file name without suffix.
    compute : callable
        Returns arrays by name; none of them holds Python objects.

    Returns
    -------
    dict of str to ndarray

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from paper.run import kept
    >>> store = Path(tempfile.mkdtemp())
    >>> kept(store, "one", lambda: {"x": np.ones(2)})["x"]
    array([1., 1.])
    >>> kept(store, "one", lambda: {"x": np.zeros(2)})["x"]
    array([1., 1.])
    """
    path = store / f"{key}.npz"
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(file)
    except Exception:  # missing, or damaged in whatever way: computed again, never trusted
        found = compute()
    store.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as stream:
        np.savez(stream, **found)  # type: ignore[arg-type]
    return {name: np.asarray(value) for name, value in found.items()}


def piece(store: Path, function: Callable[..., Arrays], *arguments: Any) -> Arrays:
    """``function(*arguments)``, kept under a name made from the function and its arguments.

    Strings, numbers and tuples of them make the name; collections and folders do not, for a store
    belongs to the data of one run. Warnings of what was done to a shape are left out.
    """
    named = [one for one in arguments if isinstance(one, Key | tuple)]
    words = "-".join([function.__name__.strip("_"), *(one for one in named if type(one) is str)])
    digest = blake2b(f"{function.__module__} {named!r}".encode(), digest_size=6).hexdigest()
    key = f"{re.sub(r'[^A-Za-z0-9_.-]+', '_', words)[:100]}-{digest}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnbendWarning)
        return kept(store, key, lambda: function(*arguments))


def everywhere(
    run: Run, function: Callable[..., Arrays], jobs: Sequence[tuple[Any, ...]]
) -> list[Arrays]:
    """Run a function on every tuple of arguments, in several processes; finished ones are kept.

    Parameters
    ----------
    run : Run
    function : callable
        Of a module's top level. Returns arrays by name. Its strings, numbers and tuples of them
        must tell its calls apart: see :func:`piece`.
    jobs : sequence of tuple
        Arguments that can be pickled.

    Returns
    -------
    list of dict
        In the order of the jobs. Ctrl-C ends the processes; what they finished stays.
    """
    found: dict[int, Arrays] = {}
    name, start = function.__name__.strip("_").replace("_", " "), perf_counter()

    def done(index: int) -> None:
        found[index] = piece(run.store, function, *jobs[index])
        run.progress(f"{name}: {len(found)} of {len(jobs)}{_left(start, len(found), len(jobs))}")

    if run.jobs == 1 or len(jobs) == 1:
        with threadpoolctl.threadpool_limits(1):
            for index in range(len(jobs)):
                done(index)
    else:
        with _processes(min(run.jobs, len(jobs))) as pool:
            waiting = {
                pool.submit(_finish, run.store, function, job): i for i, job in enumerate(jobs)
            }
            for one in as_completed(waiting):
                one.result()
                done(waiting[one])
    return [found[index] for index in range(len(jobs))]


def _left(start: float, n_done: int, n_jobs: int) -> str:
    seconds = (perf_counter() - start) / n_done * (n_jobs - n_done)
    return f", about {seconds / 60:.0f} min left" if seconds > 90 else ""


def _finish(store: Path, function: Callable[..., Arrays], job: tuple[Any, ...]) -> None:
    piece(store, function, *job)  # the parent reads it from the store: nothing large is sent


@contextmanager
def _processes(number: int) -> Iterator[ProcessPoolExecutor]:
    """End the processes with the block, at once where it fails or is interrupted."""
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(number, mp_context=context, initializer=single_thread)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - others:
            child.terminate()
        raise
    pool.shutdown()


def single_thread() -> None:
    """Begin a process: leave Ctrl-C to the parent, and the other cores to the other processes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["OMP_NUM_THREADS"] = "1"
    threadpoolctl.threadpool_limits(1)
