"""Shapes from files into the store."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from unbend._types import Progress
from unbend.collection._descriptor import DESCRIPTOR_VERSION, descriptor
from unbend.collection._engine import Engine, Outcome, counted
from unbend.collection._files import File, find_files, hash_file, hashed, is_gone, warn_of_others
from unbend.collection._rows import Added, Failure
from unbend.collection._store import Store, among
from unbend.errors import FileError, MeshError, heard
from unbend.io import read_mesh
from unbend.mesh import vertex_areas
from unbend.report.raster import thumbnail

# Rows are committed as they come, but commits take at most this share of the time (an object store
# is slow) and are so many seconds apart, unless this many rows wait.
_COMMITS_SHARE, _SECONDS_BETWEEN, _MOST_ROWS = 1 / 20, 0.25, 4096
_THUMBNAIL = 96  # pixels across


def add_files(
    store: Store, given: Sequence[str], workers: Engine, progress: Progress | None
) -> Added:
    """Compute and commit the rows of files that are not in the store; see `Collection.add`."""
    start = time.monotonic()
    warn_of_others(given)
    adding = _Adding(store, counted(progress, "shapes", sum(1 for _ in find_files(given))))
    adding.take([])  # tells how many there are
    try:
        with workers as run:
            for outcomes in run(make_row, adding.fresh(given)):
                adding.take(outcomes)
    finally:  # an interrupted run keeps what is finished too
        adding.commit()
    adding.finish()
    if adding.added or adding.new_paths:
        store.tidy()
    failures = tuple(sorted(adding.failures, key=lambda one: one.path))
    seconds = time.monotonic() - start
    return Added(adding.added, adding.skipped, adding.new_paths, failures, seconds)


class _Adding:
    """The state of adding: counts, failures, and rows that wait to be committed."""

    def __init__(self, store: Store, tell: Callable[[int, int, int], None]) -> None:
        self.added = self.skipped = self.new_paths = 0
        self.failures: list[Failure] = []
        self._store, self._tell = store, tell
        self._rows: list[dict[str, Any]] = []
        self._next = 0.0  # when the next commit is due
        self._given: set[File] = set()  # what workers were given, see _kind
        self._bad: dict[File, Failure] = {}  # by these
        self._copies: list[File] = []  # other files like these

    def fresh(self, given: Sequence[str]) -> Iterator[File | None]:
        """Files with new content, and None after each batch."""
        for files, failures in hashed(map(os.path.abspath, find_files(given))):
            self.failures += failures
            known = self._update(files)
            for file in files:
                if _kind(file) in known:
                    self.skipped += 1
                elif _kind(file) in self._given:
                    self.skipped += 1
                    self._copies.append(file)
                else:
                    self._given.add(_kind(file))
                    yield file
            yield None

    def _update(self, files: Sequence[File]) -> set[File]:
        """Update the paths of shapes in the store that are in these files; return their kinds."""
        paths = self._store.paths_of({digest for _, digest in files})
        known = {_kind((path, digest)) for digest, some in paths.items() for path in some}
        new = [
            (path, digest)
            for path, digest in dict.fromkeys(files)
            if _kind((path, digest)) in known and path not in paths[digest]
        ]
        self._store.add_paths(new)  # first, so that an interruption loses no path
        self.new_paths += len(new)
        old = {path for _, digest in files for path in paths.get(digest, [])}
        self._store.remove(sorted(filter(is_gone, old - {path for path, _ in files})))
        return known

    def take(self, outcomes: list[Outcome]) -> None:
        """Keep rows and failures, commit if it is time, and tell how far it is."""
        self._rows += [one.value for one in outcomes if one.reason is None]
        bad = {_kind(file): Failure(file[0], why) for file, _, why in outcomes if why is not None}
        self._bad |= bad
        if bad:
            self._fail(list(bad.values()))
        if time.monotonic() >= self._next or len(self._rows) >= _MOST_ROWS:
            self.commit()
        computed = self.added + len(self._rows) + len(self.failures)
        self._tell(computed, self.skipped, len(self.failures))

    def _fail(self, bad: Sequence[Failure]) -> None:
        """Keep failures, and no rows of what these files were before."""
        self.failures += bad
        old = self._store.select(["path"], among("path", [one.path for one in bad]))
        self._store.remove([row["path"] for row in old])

    def commit(self) -> None:
        if not self._rows:
            return
        start = time.monotonic()
        self._store.commit(list({row["path"]: row for row in self._rows}.values()))
        self.added += len(self._rows)
        self._rows = []
        end = time.monotonic()
        self._next = end + max(_SECONDS_BETWEEN, (end - start) / _COMMITS_SHARE)

    def finish(self) -> None:
        """Add the paths of copies, or let them fail as their original did."""
        for i in range(0, len(self._copies), _MOST_ROWS):
            some = self._copies[i : i + _MOST_ROWS]
            self._update([file for file in some if _kind(file) not in self._bad])
            failed = [file for file in some if _kind(file) in self._bad]
            bad = [replace(self._bad[_kind(file)], path=file[0]) for file in failed]
            self._fail(bad)
            self.skipped -= len(bad)


def _kind(file: File) -> File:
    """Suffix and hash: the same bytes are read otherwise, or not at all, under another suffix."""
    path, digest = file
    return os.path.splitext(path)[1].lower(), digest


def make_row(file: File) -> dict[str, Any]:
    """Read a shape and compute its columns in the store."""
    path, digest = file
    with heard() as said:
        mesh = read_mesh(path)
        if hash_file(path) != file:  # it was hashed some hundred files ago
            raise FileError("it has changed since this command began; add it again")
        vector = descriptor(mesh)
    if not np.isfinite(vector).all():
        raise MeshError("its descriptor is not finite; try unbend check on it")
    notes = dict.fromkeys([*mesh.notes, *said])
    return {
        "id": digest,
        "path": path,
        "n_vertices": mesh.n_vertices,
        "n_faces": mesh.n_faces,
        "area": float(vertex_areas(mesh).sum()) if mesh.n_faces else 0.0,
        "notes": "; ".join(note.removeprefix(f"{mesh.name}: ") for note in notes),
        "version": DESCRIPTOR_VERSION,
        "descriptor": vector,
        "thumbnail": thumbnail(mesh, _THUMBNAIL),
    }
