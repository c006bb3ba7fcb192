"""Matches of many pairs of a collection, each in a file of its own."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from unbend._display import is_doubtful
from unbend._types import Progress, StrPath
from unbend.choices import Partial
from unbend.collection._engine import Engine, attempt_all
from unbend.collection._files import ID_DIGITS, find_file, make_folder, stem, without_file
from unbend.collection._rows import Entry, Failure, Matched
from unbend.collection._store import Store, check_outside
from unbend.correspondence import read_match, write_match
from unbend.errors import FileError, InputError, heard
from unbend.io import read_mesh, write_map, write_table
from unbend.matching import check_partial, match, prepare_spectrum
from unbend.spectral import use_cache

_SPECTRA = "spectra"  # folder of the eigenpairs beside the matches, each computed once
_NO_LIMIT = 2**30

Pair = tuple[Entry, Entry]


class Task(NamedTuple):
    """A shape to compute the spectrum of, or a pair to match."""

    entries: tuple[Entry, ...]
    out: Path  # folder of all results
    store: str  # path of the collection
    partial: Partial

    @property
    def name(self) -> str:
        return " -> ".join(one.path for one in self.entries)


def match_pairs(
    store: Store,
    named: Iterable[tuple[StrPath, StrPath]] | None,
    out: StrPath,
    partial: Partial,
    workers: Engine,
    progress: Progress | None,
) -> Matched:
    """Match pairs that have no match yet, and write a table of all; see `Collection.match`."""
    start = time.monotonic()
    check_partial(partial)
    check_outside(store.path, out)
    chosen = _chosen(store, named)
    folder = make_folder(out).absolute()  # workers elsewhere have another current folder
    before = {entry.id: entry for pair in chosen if _done(folder, pair, partial) for entry in pair}
    lost = without_file(before.values(), store.path)
    pairs = _without(lost, chosen)
    left = [pair for pair in pairs if not _done(folder, pair, partial)]
    with workers as run:
        shapes = {entry.id: entry for pair in left for entry in pair}.values()
        tasks = [Task((entry,), folder, store.path, partial) for entry in shapes]
        lost += attempt_all(run, keep_spectrum, tasks, "spectra", progress)
        tasks = [Task(pair, folder, store.path, partial) for pair in _without(lost, left)]
        failed = attempt_all(run, match_pair, tasks, "pairs", progress)
    confidences: list[float] = []
    write_table(folder / "matches.csv", _table(folder, pairs, partial, confidences))
    doubtful = sum(map(is_doubtful, confidences))
    skipped, seconds = len(pairs) - len(left), time.monotonic() - start
    return Matched(len(tasks) - len(failed), skipped, (*lost, *failed), seconds, doubtful)


def _chosen(store: Store, named: Iterable[tuple[Any, Any]] | None) -> list[Pair]:
    if named is None:
        entries = sorted(store.entries(), key=lambda entry: entry.path)
        return list(itertools.combinations(entries, 2))
    names = [tuple(pair) for pair in named]
    if wrong := [pair for pair in names if len(pair) != 2]:
        raise InputError(f"a pair is a source and a target, not {wrong[0]}")
    every = list(dict.fromkeys(itertools.chain(*names)))
    known = dict(zip(every, store.find(every), strict=True))
    return list(dict.fromkeys((known[source], known[target]) for source, target in names))


def _without(lost: Iterable[Failure], pairs: Iterable[Pair]) -> list[Pair]:
    bad = {one.path for one in lost}
    return [pair for pair in pairs if bad.isdisjoint(one.path for one in pair)]


def keep_spectrum(task: Task) -> list[str]:
    """Compute the eigenpairs that a shape's matches need, and keep them on disk."""
    with use_cache(task.out / _SPECTRA, gib=_NO_LIMIT), heard() as said:
        mesh = read_mesh(find_file(task.entries[0], task.store))
        prepare_spectrum(mesh)
    return [one.removeprefix(f"{mesh.name}: ") for one in said]


def match_pair(task: Task) -> list[str]:
    """Match two shapes and write the result."""
    with use_cache(task.out / _SPECTRA, gib=_NO_LIMIT), heard() as said:
        shapes = [read_mesh(find_file(entry, task.store)) for entry in task.entries]
        found = match(*shapes, partial=task.partial)
    source, target = task.entries
    path = task.out / file_name(source, target, task.partial)
    write_map(path.with_suffix(".csv"), found.source_to_target)
    # Last: it says that the pair is done.
    write_match(path, found, source=shapes[0], target=shapes[1])
    # The spectra told what is to be said of each shape.
    return [one for one in said if not one.startswith(tuple(f"{mesh.name}: " for mesh in shapes))]


def file_name(source: Entry, target: Entry, partial: Partial) -> str:
    """File name of a match: the stems of both files, the first digits of both ids, the choice."""
    ids = "-".join(one.id[:ID_DIGITS] for one in (source, target))
    choice = "" if partial == "auto" else f"-{partial}"
    return f"{stem(source)}-{stem(target)}-{ids}{choice}.npz"


def _done(folder: Path, pair: Pair, partial: Partial) -> bool:
    return (folder / file_name(*pair, partial)).exists()


def _table(
    folder: Path, pairs: Iterable[Pair], partial: Partial, confidences: list[float]
) -> Iterator[Iterable[Any]]:
    """Rows for each match there is, whose confidences are collected."""
    measures = "confidence", "orientation", "overlap_source", "overlap_target"
    yield "source", "target", "file", *measures
    for pair in pairs:
        if _done(folder, pair, partial):
            path = folder / file_name(*pair, partial)
            try:
                found = read_match(path)
            except FileError as error:
                again = f"{path}: remove it, and run unbend collection match again"
                raise FileError(f"cannot read {again} ({error})") from error
            confidences.append(found.confidence)
            paths = [one.path for one in pair]
            yield *paths, path.name, *(getattr(found, one) for one in measures)
