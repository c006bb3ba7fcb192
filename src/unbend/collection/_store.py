"""The table of a collection, in LanceDB; every change is one atomic commit."""

from __future__ import annotations

import functools
import os
import re
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._parallel import n_cores
from unbend._text import quoted
from unbend._types import StrPath
from unbend.collection._descriptor import DESCRIPTOR_VERSION
from unbend.collection._rows import Entry, Hit, Info
from unbend.errors import FileError, InputError, MissingExtraError, UnbendError
from unbend.io import atomic_write, path_text

_TABLE = "shapes"
_FOLDER, _CREATING = f"{_TABLE}.lance", ".creating-"  # of the table; prefix of where it is made
# With this key, two processes that add one path at once get one row.
_KEY = {"lance-schema:unenforced-primary-key": "true"}
_SMALL = ("id", "path", "n_vertices", "n_faces", "area", "notes")  # columns of an Entry
_KEPT_VERSIONS = timedelta(minutes=15)  # of the table, which readers may still use
# After so many commits their small files are merged, for at most this share of the time.
_COMMITS_UNMERGED, _MERGING_SHARE = 200, 0.1
_ROWS_AT_ONCE = 4096
_NAMES_AT_ONCE = 256  # that one query asks for
_FORMAT = "2.0"  # of Lance's files; searches of later formats are half as fast
_PROBES = 20  # cells, of some thousand rows each, in an approximate search


class Store:
    """The rows of a collection: one for each file. Files with the same content have one id."""

    def __init__(self, path: StrPath) -> None:
        # By default Lance leaves two processors idle.
        os.environ.setdefault("LANCE_CPU_THREADS", str(n_cores()))
        os.environ.setdefault("LANCEDB_LOG", "error")  # two that tidy at once are no news
        try:
            import lancedb
        except ImportError:
            raise MissingExtraError("lancedb", "dask", "distributed") from None
        self.path = path_text(path)  # perhaps the address of an object store
        self._commits, self._next_tidy = 0, 0.0
        self._connect = functools.partial(
            lancedb.connect,
            read_consistency_interval=timedelta(0),  # see commits of other processes at once
            storage_options={"new_table_data_storage_version": _FORMAT},
        )
        if "://" not in self.path:
            _check_folder(Path(self.path))
        with self._explained():
            self._table = self._open()
            if self.exists and b"parameters" not in (self.schema.metadata or {}):
                raise FileError(
                    f"the table in {self.path} is another program's; a collection is a folder of "
                    "its own: give one that is empty or does not exist"
                )

    def _open(self) -> Any:
        """Open the table; None if there is none."""
        # To connect would make the collection's folder.
        if "://" not in self.path and not os.path.exists(os.path.join(self.path, _FOLDER)):
            return None
        database = self._connect(self.path)
        return database.open_table(_TABLE) if _TABLE in database.list_tables().tables else None

    def _create(self, schema: Any) -> Any:
        """Create the table, or open what another process has created meanwhile.

        Of two that create one at once, LanceDB has the second overwrite the first's: each creates
        it elsewhere, and moves it.
        """
        if "://" in self.path:
            return self._connect(self.path).create_table(_TABLE, schema=schema, exist_ok=True)
        os.makedirs(self.path, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=self.path, prefix=_CREATING) as elsewhere:
            self._connect(elsewhere).create_table(_TABLE, schema=schema)
            with suppress(OSError):  # another one is there
                os.rename(os.path.join(elsewhere, _FOLDER), os.path.join(self.path, _FOLDER))
        return self._connect(self.path).open_table(_TABLE)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Turn errors of LanceDB, of many types, into a FileError."""
        try:
            yield
        except UnbendError:
            raise
        except (RuntimeError, ValueError, OSError) as error:
            reason = str(error).removeprefix("lance error: ").split(", /")[0]
            # The system says what else is wrong, such as a full disk; damaged ones lack files too.
            by_system = re.search(r"(os error|Errno) (?!2\b)\d", reason)
            advice = "; if it is damaged, remove its folder and add the shapes again"
            raise FileError(
                f"the collection {self.path} cannot be read or written ({reason})"
                f"{'' if by_system else advice}"
            ) from error

    @property
    def exists(self) -> bool:
        """Whether anything was ever added."""
        return self._table is not None

    def __len__(self) -> int:
        with self._explained():
            return int(self._table.count_rows()) if self.exists else 0

    def n_shapes(self) -> int:
        """Count the ids; this reads all of them."""
        import pyarrow as pa
        from pyarrow.compute import count_distinct

        ids = [batch.column("id") for batch in self.batches(["id"])]
        return int(count_distinct(pa.chunked_array(ids, pa.string())).as_py())

    def commit(self, rows: Sequence[dict[str, Any]]) -> None:
        """Add rows in one commit; a row takes the place of an earlier one of its path."""
        if not rows:
            return
        data = _arrow(rows)
        with self._explained():
            if not self.exists:
                self._table = self._create(data.schema)
            merge = self._table.merge_insert("path")
            merge.when_matched_update_all().when_not_matched_insert_all().execute(data)
        self._commits += 1
        if self._commits >= _COMMITS_UNMERGED and time.monotonic() >= self._next_tidy:
            self.tidy()

    def tidy(self) -> None:
        """Merge small files, update the indices, and remove old versions."""
        from lancedb.index import BTree

        start = time.monotonic()
        with self._explained():
            try:
                indices = self._table.list_indices()
                indexed = {column for index in indices for column in index.columns}
                for column in {"id", "path"} - indexed:
                    self._table.create_index(column, config=BTree())
                self._table.optimize(cleanup_older_than=_KEPT_VERSIONS)
            except RuntimeError as error:
                if "conflict" not in str(error):  # another process tidies
                    raise
        end = time.monotonic()
        self._commits, self._next_tidy = 0, end + (end - start) / _MERGING_SHARE

    @property
    def schema(self) -> Any:
        """Columns and their types, as Arrow's schema."""
        return self._table.schema

    @property
    def indexed(self) -> bool:
        """Whether there is an index of the descriptors."""
        with self._explained():
            return any("descriptor" in index.columns for index in self._table.list_indices())

    def info(self) -> Info:
        """Say what is in the collection; its size on disk counts old versions, too."""
        if not self.exists:
            self.check_filled()
        files = (one for one in Path(self.path).rglob("*") if one.is_file())
        return Info(
            n_shapes=self.n_shapes(),
            n_files=len(self),
            n_bytes=None if "://" in self.path else sum(one.stat().st_size for one in files),
            version=self._version(),
            descriptor_length=int(self.schema.field("descriptor").type.list_size),
            indexed=self.indexed,
        )

    def _version(self) -> str:
        """Version of the descriptors; this one where there are none."""
        rows = []
        if self.exists:
            with self._explained():
                rows = self._table.search().select(["version"]).limit(1).to_list()
        return rows[0]["version"] if rows else DESCRIPTOR_VERSION

    def check_version(self) -> None:
        """Raise InputError if the descriptors do not compare with those of this version."""
        version = self._version()
        if version != DESCRIPTOR_VERSION:
            raise InputError(
                f"the collection {self.path} has descriptors of version {version}, which do not "
                f"compare with those of this unbend, {DESCRIPTOR_VERSION}: add the shapes to a "
                "new collection"
            )

    def check_filled(self) -> None:
        """Raise FileError if there are no shapes."""
        if not len(self):
            raise FileError(
                f"there are no shapes in {self.path}: unbend collection add {quoted(self.path)} "
                "MESHES adds some"
            )

    def paths_of(self, ids: Iterable[str]) -> dict[str, list[str]]:
        """Sorted paths of the shapes that are there, by their ids."""
        paths: dict[str, list[str]] = {}
        for row in self.select(["id", "path"], among("id", ids)):
            paths.setdefault(row["id"], []).append(row["path"])
        return {one: sorted(some) for one, some in paths.items()}

    def add_paths(self, files: Sequence[tuple[str, str]]) -> None:
        """Add rows of new paths for shapes that are there, given as paths and ids."""
        if files:
            rows = self.select(self.schema.names, among("id", {digest for _, digest in files}))
            known = {row["id"]: row for row in rows}
            new = [{**known[digest], "path": path} for path, digest in files if digest in known]
            self.commit(new)

    def select(self, columns: Sequence[str], where: str | None = None) -> list[dict[str, Any]]:
        """Rows that a condition holds for, all of them at once."""
        return [row for batch in self.batches(columns, where) for row in batch.to_pylist()]

    def batches(self, columns: Sequence[str], where: str | None = None) -> Iterator[Any]:
        """Arrow batches of the rows that a condition holds for, in the order of the store."""
        if not self.exists:
            return
        with self._explained():
            query = self._table.search().select(list(columns))
            if where is not None:
                query = query.where(where)
            yield from query.to_batches(_ROWS_AT_ONCE)

    def entries(self, where: str | None = None) -> Iterator[Entry]:
        """Shapes with all their paths, in bounded memory; a condition may be on ids alone."""
        for batch in self.batches(_SMALL, where):
            rows = batch.to_pylist()
            paths = self.paths_of({row["id"] for row in rows})
            for row in rows:
                found = paths.get(row["id"], [])  # none: another process removed it just now
                if found[:1] == [row["path"]]:
                    yield Entry(**row, also=tuple(found[1:]))

    def find(self, names: Sequence[StrPath]) -> list[Entry]:
        """Entries of ids, beginnings of ids, or paths; see `Collection.find`."""
        texts = [path_text(name) for name in names]
        lots = (texts[i : i + _NAMES_AT_ONCE] for i in range(0, len(texts), _NAMES_AT_ONCE))
        return [entry for lot in lots for entry in self._find(lot)]

    def _find(self, names: Sequence[str]) -> list[Entry]:
        paths = {name: {name, os.path.abspath(name)} for name in names}
        starts = {name for name in names if re.fullmatch("[0-9a-f]{8,32}", name)}
        conditions = [among("path", set().union(*paths.values()))]
        conditions += [f"id LIKE '{name}%'" for name in sorted(starts)]
        ids = {row["id"] for row in self.select(["id"], " OR ".join(conditions))}
        entries = list(self.entries(among("id", ids)))
        by_path = {path: one for one in entries for path in (one.path, *one.also)}
        found: list[Entry] = []
        for name in names:
            some = {by_path[path] for path in paths[name] if path in by_path}
            if name in starts:
                some |= {one for one in entries if one.id.startswith(name)}
            if len(some) != 1:
                what = "may be several shapes" if some else "is not"
                raise InputError(
                    f"{name} {what} in the collection {self.path}: give a path or an id as "
                    "unbend collection list shows them"
                )
            found += some
        return found

    def remove(self, paths: Sequence[str]) -> None:
        """Remove rows in one commit; a shape that has other paths stays."""
        if paths:
            with self._explained():
                self._table.delete(among("path", paths))

    def nearest(self, descriptor: npt.NDArray[np.float32], n: int, *, index: bool) -> list[Hit]:
        """Shapes with the nearest descriptors, the nearest first."""
        limit = n
        while True:
            with self._explained():
                query = self._table.search(descriptor, vector_column_name="descriptor")
                query = query.distance_type("l2").select(["id", "_distance"]).limit(limit)
                query = query.nprobes(_PROBES) if index else query.bypass_vector_index()
                rows = query.to_list()
            apart = {row["id"]: float(np.sqrt(max(row["_distance"], 0))) for row in rows}
            if len(apart) >= n or len(rows) < limit:
                break
            limit *= 2  # several rows were of one shape
        paths = self.paths_of(list(apart)[:n])
        return [
            Hit(one, paths[one][0], distance, also=tuple(paths[one][1:]))
            for one, distance in apart.items()
            if one in paths
        ]

    def build_index(self) -> None:
        """Index the descriptors, or those added since."""
        from lancedb.index import IvfFlat

        if not self.indexed:
            with self._explained():
                self._table.create_index("descriptor", config=IvfFlat(distance_type="l2"))
        self.tidy()

    def export(self, path: StrPath) -> int:
        """Write every row to a .parquet or .csv file, a batch at a time; return how many."""
        import pyarrow as pa
        from pyarrow import csv
        from pyarrow.parquet import ParquetWriter

        count = 0
        with atomic_write(path) as file:
            if Path(path).suffix.lower() == ".parquet":
                with ParquetWriter(file, self.schema) as writer:
                    for batch in self.batches(self.schema.names):
                        writer.write_batch(batch)
                        count += len(batch)
                return count
            for batch in self.batches([*_SMALL, "version", "descriptor"]):
                columns = dict(zip(batch.schema.names, batch.columns, strict=True))
                flat = columns.pop("descriptor").flatten().to_numpy().reshape(len(batch), -1)
                columns |= {f"descriptor_{i}": column for i, column in enumerate(flat.T)}
                csv.write_csv(pa.table(columns), file, csv.WriteOptions(include_header=not count))
                count += len(batch)
        return count


def among(column: str, values: Iterable[str]) -> str:
    """Condition that a column has one of some values."""
    quoted = ", ".join("'" + value.replace("'", "''") + "'" for value in values)
    return f"{column} IN ({quoted})" if quoted else "false"


def check_outside(store: str, out: StrPath) -> None:
    """Raise FileError for an output inside a collection's folder, which holds nothing else."""
    if "://" not in store:
        folder, place = Path(os.path.realpath(store)), Path(os.path.realpath(out))
        if place.is_relative_to(folder):
            raise FileError(
                f"cannot write {out}: the folder {store} is the collection's alone; write elsewhere"
            )


def _check_folder(path: Path) -> None:
    try:
        inside = [name for name in os.listdir(path) if not name.startswith(_CREATING)]
    except FileNotFoundError:
        return
    except NotADirectoryError:
        raise FileError(f"{path} is a file; a collection is a folder of its own") from None
    except OSError as error:
        raise FileError(f"cannot read the collection {path}: {error.strerror or error}") from error
    if inside and _FOLDER not in inside:
        raise FileError(
            f"the folder {path} holds other things; a collection is a folder of its own: give "
            "one that is empty or does not exist"
        )


def _arrow(rows: Sequence[dict[str, Any]]) -> Any:
    import pyarrow as pa

    schema = pa.schema(
        [
            ("id", pa.string()),
            pa.field("path", pa.string(), nullable=False, metadata=_KEY),
            ("n_vertices", pa.int64()),
            ("n_faces", pa.int64()),
            ("area", pa.float64()),
            ("notes", pa.string()),
            ("version", pa.string()),
            ("descriptor", pa.list_(pa.float32(), len(rows[0]["descriptor"]))),
            ("thumbnail", pa.binary()),
        ],
        metadata={"parameters": DESCRIPTOR_VERSION},
    )
    return pa.Table.from_pylist(list(rows), schema=schema)
