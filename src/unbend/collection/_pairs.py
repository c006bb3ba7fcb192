"""Matches of many pairs of a collection, each in a file of its own."""

from __future__ import annotations

import functools
import itertools
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

from unbend._types import Progress
from unbend.collection._engine import attempt_all, engine
from unbend.collection._files import find_file, make_folder, stem
from unbend.collection._rows import Entry, Failure, Matched
from unbend.collection._store import Store, check_outside
from unbend.correspondence import read_match, write_match
from unbend.errors import InputError
from unbend.io import read_mesh, write_map, write_table
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

    @property
    def name(self) -> str:
        return " -> ".join(one.path for one in self.entries)


def match_pairs(
    store: Store,
    named: Iterable[tuple[str | os.PathLike[str], str | os.PathLike[str]]] | None,
    out: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Matched:
    """Match pairs of shapes that have no match yet, and write a table of all.

    See `Collection.match`.
    """
    start = time.monotonic()
    check_outside(store.path, out)
    pairs, n_pairs = _chosen(store, named)
    folder = make_folder(out)
    left = {entry.id: entry for pair in pairs() if not _done(folder, pair) for entry in pair}
    skipped = sum(1 for pair in pairs() if _done(folder, pair))
    failures: list[Failure] = []
    matched = 0
    if left:
        with engine(workers=workers, scheduler=scheduler) as run:
            shapes = (Task((entry,), str(folder), store.path) for entry in left.values())
            spectra = attempt_all(run, keep_spectrum, shapes, len(left), "spectra", progress)
            failures += filter(None, spectra)
            bad = {one.path for one in failures}
            tasks = (
                Task(pair, str(folder), store.path)
                for pair in pairs()
                if not _done(folder, pair) and bad.isdisjoint(one.path for one in pair)
            )
            total = n_pairs - skipped
            for failure in attempt_all(run, match_pair, tasks, total, "pairs", progress):
                if failure is None:
                    matched += 1
                else:
                    failures.append(failure)
    write_table(folder / _TABLE, _table(folder, pairs()))
    return Matched(matched, skipped, tuple(failures), time.monotonic() - start)


def _chosen(
    store: Store, named: Iterable[tuple[Any, Any]] | None
) -> tuple[Callable[[], Iterator[Pair]], int]:
    """Give the pairs anew at each call, and their number."""
    if named is None:
        entries = sorted(store.entries(), key=lambda entry: entry.path)
        n = len(entries)
        return functools.partial(itertools.combinations, entries, 2), n * (n - 1) // 2
    names = [tuple(pair) for pair in named]
    if wrong := [pair for pair in names if len(pair) != 2]:
        raise InputError(f"a pair is a source and a target, not {wrong[0]}")
    known = {name: store.find(name) for name in dict.fromkeys(itertools.chain(*names))}
    chosen = list(dict.fromkeys((known[source], known[target]) for source, target in names))
    return lambda: iter(chosen), len(chosen)


def keep_spectrum(task: Task) -> None:
    """Compute the eigenpairs that a shape's matches need, and keep them on disk."""
    with _spectra(task):
        prepare_spectrum(_read(task.entries[0], task.store))


def match_pair(task: Task) -> None:
    """Match two shapes and write the result."""
    source, target = task.entries
    with _spectra(task):
        found = match(_read(source, task.store), _read(target, task.store))
    path = Path(task.out, file_name(source, target))
    write_map(path.with_suffix(".csv"), found.source_to_target)
    write_match(path, found)  # last: it says that the pair is done


def _spectra(task: Task) -> AbstractContextManager[None]:
    return use_cache(Path(task.out, _SPECTRA), gib=_NO_LIMIT)


def file_name(source: Entry, target: Entry) -> str:
    """File name of a match: the stems of both files, and the first digits of both ids."""
    return f"{stem(source)}-{stem(target)}-{source.id[:8]}-{target.id[:8]}.npz"


def _read(entry: Entry, store: str) -> Mesh:
    return read_mesh(find_file(entry, store))


def _done(folder: Path, pair: Pair) -> bool:
    return (folder / file_name(*pair)).exists()


def _table(folder: Path, pairs: Iterator[Pair]) -> Iterator[Sequence[Any]]:
    """Rows for each match there is."""
    measures = "confidence", "orientation", "overlap_source", "overlap_target"
    yield "source", "target", "file", *measures
    for pair in itertools.filterfalse(lambda pair: not _done(folder, pair), pairs):
        found = read_match(folder / file_name(*pair))
        values = (getattr(found, name) for name in measures)
        yield *(one.path for one in pair), file_name(*pair), *values
