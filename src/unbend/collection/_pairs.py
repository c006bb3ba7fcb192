"""Matches of many pairs of a collection, each in a file of its own."""

from __future__ import annotations

import itertools
import os
import re
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from unbend._types import Progress
from unbend.collection._engine import Run, engine
from unbend.collection._files import find_file, make_folder
from unbend.collection._progress import counted
from unbend.collection._rows import Entry, Failure, Matched
from unbend.correspondence import read_match, write_match
from unbend.errors import UnbendWarning
from unbend.io import read_mesh, write_table
from unbend.matching import match, prepare_spectrum
from unbend.mesh import Mesh
from unbend.spectral import use_cache

_SPECTRA = "spectra"  # folder of the eigenpairs beside the matches, each computed once
_TABLE = "matches.csv"
_NO_LIMIT = 2**30

Pair = tuple[Entry, Entry]


class Task(NamedTuple):
    """A shape to compute the spectrum of, or a pair to match."""

    entries: tuple[Entry, ...]
    out: str  # folder of all results
    store: str  # path of the collection


def match_pairs(
    pairs: Callable[[], Iterator[Pair]],
    n_pairs: int,
    out: str | os.PathLike[str],
    *,
    store: str,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Matched:
    """Match pairs of shapes that have no match yet, and write a table of all.

    See `Collection.match`. `pairs` gives the pairs anew at each call; `store` is the path of the
    collection.
    """
    start = time.monotonic()
    folder = make_folder(out)
    left = {entry.id: entry for pair in pairs() if not _done(folder, pair) for entry in pair}
    skipped = sum(1 for pair in pairs() if _done(folder, pair))
    failures: list[Failure] = []
    matched = 0
    if left:
        with engine(workers=workers, scheduler=scheduler) as run:
            tell = counted(progress, "spectra", len(left))
            shapes = (Task((entry,), str(folder), store) for entry in left.values())
            failures += filter(None, _each(run, keep_spectrum, shapes, tell))
            bad = {one.path for one in failures}
            tasks = (
                Task(pair, str(folder), store)
                for pair in pairs()
                if not _done(folder, pair) and bad.isdisjoint(one.path for one in pair)
            )
            tell = counted(progress, "pairs", n_pairs - skipped)
            for failure in _each(run, match_pair, tasks, tell):
                if failure is None:
                    matched += 1
                else:
                    failures.append(failure)
    write_table(folder / _TABLE, _table(folder, pairs()))
    return Matched(matched, skipped, tuple(failures), time.monotonic() - start)


def _each(
    run: Run,
    function: Callable[[Task], Failure | None],
    tasks: Iterator[Task],
    tell: Callable[[int, int, int], None],
) -> Iterator[Failure | None]:
    done = failed = 0
    for outcomes in run(function, tasks):
        for task, failure, reason in outcomes:
            if reason is not None:
                failure = Failure(_name(task.entries), reason)
            done, failed = done + 1, failed + (failure is not None)
            yield failure
        tell(done, 0, failed)


def keep_spectrum(task: Task) -> Failure | None:
    """Compute the eigenpairs that a shape's matches need, and keep them on disk."""
    return _tried(task, lambda: prepare_spectrum(_read(task.entries[0], task.store)))


def match_pair(task: Task) -> Failure | None:
    """Match two shapes and write the result."""
    source, target = task.entries

    def work() -> None:
        found = match(_read(source, task.store), _read(target, task.store))
        write_match(Path(task.out, file_name(source, target)), found)

    return _tried(task, work)


def _tried(task: Task, work: Callable[[], None]) -> Failure | None:
    try:
        with use_cache(Path(task.out, _SPECTRA), gib=_NO_LIMIT), warnings.catch_warnings():
            warnings.simplefilter("ignore", UnbendWarning)  # of pieces that go along, say
            work()
    except Exception as error:  # of any kind: other pairs go on
        return Failure.of(_name(task.entries), error)
    return None


def _name(entries: Sequence[Entry]) -> str:
    return " -> ".join(one.path for one in entries)


def file_name(source: Entry, target: Entry) -> str:
    """File name of a match: the stems of both files, and the first digits of both ids."""
    stems = [re.sub(r"[^\w.-]", "_", Path(one.path).stem)[:60] for one in (source, target)]
    return f"{stems[0]}-{stems[1]}-{source.id[:8]}-{target.id[:8]}.npz"


def _read(entry: Entry, store: str) -> Mesh:
    return read_mesh(find_file(entry, store))


def _done(folder: Path, pair: Pair) -> bool:
    return (folder / file_name(*pair)).exists()


def _table(folder: Path, pairs: Iterator[Pair]) -> Iterator[Sequence[Any]]:
    """Rows for each match there is."""
    yield "source", "target", "file", "confidence", "orientation", "residual"
    for pair in itertools.filterfalse(lambda pair: not _done(folder, pair), pairs):
        found = read_match(folder / file_name(*pair))
        values = found.confidence, found.orientation, found.residual
        yield *(one.path for one in pair), file_name(*pair), *values
