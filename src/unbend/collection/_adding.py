"""Shapes from files into the store."""

from __future__ import annotations

import itertools
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from unbend._types import Progress
from unbend.collection._descriptor import DESCRIPTOR_VERSION, describe, make_basis, sample_form
from unbend.collection._engine import counted, engine
from unbend.collection._files import find_files, hashed, is_gone
from unbend.collection._rows import Added, Failure
from unbend.collection._store import Store
from unbend.io import read_mesh
from unbend.mesh import vertex_areas
from unbend.report.raster import thumbnail

# Rows are committed as they come. Commits take at most a twentieth of the time (an object store is
# slow) and are a quarter of a second apart, unless this many rows wait.
_COMMITS_SHARE, _SECONDS_BETWEEN, _MOST_ROWS = 1 / 20, 0.25, 4096
_THUMBNAIL = 96  # pixels across

File = tuple[str, str]  # path and hash


def add_files(
    store: Store,
    given: Sequence[str],
    *,
    workers: int | None,
    scheduler: str | None,
    progress: Progress | None,
) -> Added:
    """Compute and commit the rows of files that are not in the store; see `Collection.add`."""
    start = time.monotonic()
    adding = _Adding(store)
    tell = counted(progress, "shapes", sum(1 for _ in find_files(given)))

    def show() -> None:
        tell(adding.computed, adding.skipped, len(adding.failures))

    fresh = adding.fresh(given)
    first = None
    for first in fresh:
        show()
        if first is not None:
            break
    if first is not None:
        try:
            with engine(workers=workers, scheduler=scheduler) as run:
                for outcomes in run(make_row, itertools.chain([first], fresh)):
                    for file, value, reason in outcomes:
                        adding.take(file, value or Failure(file[0], reason or ""))
                    adding.commit_if_due()
                    show()
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

    def __init__(self, store: Store) -> None:
        self.added = self.skipped = self.new_paths = 0
        self.failures: list[Failure] = []
        self._store = store
        self._rows: list[dict[str, Any]] = []
        self._next = 0.0  # when the next commit is due
        self._under_way: set[str] = set()  # hashes given to workers
        self._committed: set[str] = set()  # those of them committed since the store was last asked
        self._copies: dict[str, list[str]] = {}  # paths of identical files, by hashes under way

    @property
    def computed(self) -> int:
        return self.added + len(self._rows) + len(self.failures)

    def fresh(self, given: Sequence[str]) -> Iterator[File | None]:
        """Files with new content, and None after each batch."""
        for files in hashed(find_files(given)):
            self.failures += [one for one in files if isinstance(one, Failure)]
            readable = [one for one in files if not isinstance(one, Failure)]
            self._under_way -= self._committed
            self._committed.clear()
            paths = self._store.paths_of(digest for _, digest in readable)
            self._update(readable, paths)
            for path, digest in readable:
                if digest in paths:
                    self.skipped += 1
                elif digest in self._under_way:
                    self.skipped += 1
                    self._copies.setdefault(digest, []).append(path)
                else:
                    self._under_way.add(digest)
                    yield path, digest
            yield None

    def _update(self, files: Sequence[File], paths: dict[str, list[str]]) -> None:
        """Add the paths of these files to shapes in the store, and drop paths without a file."""
        new = [
            (path, digest)
            for path, digest in dict.fromkeys(files)
            if path not in paths.get(digest, [path])
        ]
        self._store.add_paths(new)  # first, so that an interruption loses no path
        self.new_paths += len(new)
        old = {path for _, digest in files for path in paths.get(digest, [])}
        self._store.remove(sorted(filter(is_gone, old - {path for path, _ in files})))

    def take(self, file: File, value: dict[str, Any] | Failure) -> None:
        if isinstance(value, Failure):
            self._under_way.discard(file[1])
            copies = self._copies.pop(file[1], [])
            self.skipped -= len(copies)
            self.failures += [replace(value, path=path) for path in (value.path, *copies)]
            return
        self._rows.append(value)

    def commit_if_due(self) -> None:
        if time.monotonic() >= self._next or len(self._rows) >= _MOST_ROWS:
            self.commit()

    def commit(self) -> None:
        if not self._rows:
            return
        start = time.monotonic()
        rows = {row["path"]: row for row in self._rows}
        for row in self._rows:
            rows |= {path: {**row, "path": path} for path in self._copies.pop(row["id"], [])}
        self._store.commit(list(rows.values()))
        self._committed.update(row["id"] for row in self._rows)
        self.added += len(self._rows)
        self.new_paths += len(rows) - len({row["path"] for row in self._rows})
        self._rows = []
        end = time.monotonic()
        self._next = end + max(_SECONDS_BETWEEN, (end - start) / _COMMITS_SHARE)

    def finish(self) -> None:
        """Add copies that were found after their original was committed."""
        files = [(path, digest) for digest, some in self._copies.items() for path in some]
        self._update(files, self._store.paths_of(self._copies))
        self._copies = {}


def make_row(file: File) -> dict[str, Any] | Failure:
    """Read a shape and compute its columns in the store; any error becomes its failure."""
    path, digest = file
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            mesh = read_mesh(path)
            basis = make_basis(mesh)
            descriptor, form = describe(basis), sample_form(basis)
        if not (np.isfinite(descriptor).all() and np.isfinite(form).all()):
            return Failure(path, "its description is not finite; try unbend check on it")
        notes = dict.fromkeys([*mesh.notes, *(str(one.message) for one in caught)])
        return {
            "id": digest,
            "path": path,
            "n_vertices": mesh.n_vertices,
            "n_faces": mesh.n_faces,
            "area": float(vertex_areas(mesh).sum()) if mesh.n_faces else 0.0,
            "notes": "; ".join(note.removeprefix(f"{mesh.name}: ") for note in notes),
            "version": DESCRIPTOR_VERSION,
            "descriptor": descriptor,
            "form": form.astype(np.float32).ravel(),
            "thumbnail": thumbnail(mesh, _THUMBNAIL),
        }
    except Exception as error:  # of any kind: other meshes go on
        return Failure.of(path, error)
