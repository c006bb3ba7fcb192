"""The table: what is committed is there for all, small files are merged, searches are exact."""

import os
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path
from threading import Barrier
from typing import Any

import numpy as np
import pytest

from unbend.collection import _store
from unbend.collection._store import Store
from unbend.errors import FileError


def rows(*names: str) -> list[dict[str, Any]]:
    """Rows that only differ in path, id and descriptor."""
    chance = np.random.default_rng(len(names))
    return [
        {
            "id": f"id of {name}",
            "path": name,
            "n_vertices": 4,
            "n_faces": 4,
            "area": 1.0,
            "notes": "",
            "version": "1",
            "descriptor": np.float32(chance.normal(size=8)),
            "thumbnail": b"",
        }
        for name in names
    ]


def test_what_another_has_open_is_seen_with_every_change(tmp_path: Path) -> None:
    one = Store(tmp_path / "store")
    one.commit(rows("first"))
    other = Store(tmp_path / "store")
    assert len(other) == 1
    one.commit(rows("second", "third"))
    assert len(other) == 3
    one.remove(["second"])
    assert {row["path"] for row in other.select(["path"])} == {"first", "third"}


def test_two_may_make_one_table(tmp_path: Path) -> None:
    one, other = (Store(tmp_path / "store") for _ in range(2))
    one.commit(rows("first"))
    other.commit(rows("first", "second"))
    assert len(one) == len(other) == 2


def test_what_was_left_of_its_making_is_none_yet(tmp_path: Path) -> None:
    (tmp_path / "store" / ".creating-1" / "shapes.lance").mkdir(parents=True)
    store = Store(tmp_path / "store")
    assert not store.exists
    store.commit(rows("first"))
    assert len(Store(tmp_path / "store")) == 1


def test_those_that_create_it_at_once_keep_all_rows(tmp_path: Path) -> None:
    """Each finds none, and none overwrites what another one has written."""
    stores = [Store(tmp_path / "store") for _ in range(3)]
    for name, store in zip("abc", stores, strict=True):
        store.commit(rows(name))
    assert len(stores[0]) == 3
    assert sorted(path.name for path in (tmp_path / "store").iterdir()) == ["shapes.lance"]
    barrier = Barrier(4)

    def work(number: int) -> None:
        store = Store(tmp_path / "other")
        barrier.wait()
        store.commit(rows(f"{number}"))

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(work, range(4)))
    assert len(Store(tmp_path / "other")) == 4


def test_its_size_is_that_of_its_files(tmp_path: Path) -> None:
    store = Store(tmp_path / "store")
    store.commit(rows("first"))
    files = [one for one in (tmp_path / "store").rglob("*") if one.is_file()]
    assert store.info().n_bytes == sum(len(one.read_bytes()) for one in files)


def test_nobody_knows_the_size_of_an_object_store() -> None:
    store = Store("memory://store")
    store.commit(rows("first"))
    assert len(store) == 1
    assert store.info().n_bytes is None


def test_old_versions_make_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path / "store")
    for name in ("first", "second", "third"):
        store.commit(rows(name))
    before = store.info().n_bytes
    store.tidy()  # none is old yet: someone may be reading one
    assert store.info().n_bytes > before
    monkeypatch.setattr(_store, "_KEPT_VERSIONS", timedelta(milliseconds=1))
    store.tidy()
    assert len(list((tmp_path / "store" / "shapes.lance" / "data").iterdir())) == 1
    assert len(store) == 3


@pytest.mark.parametrize("told", ["Retryable commit conflict for version 3", "no space is left"])
def test_merging_gives_way_to_another_but_hides_no_other_trouble(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, told: str
) -> None:
    store = Store(tmp_path / "store")
    store.commit(rows("first"))

    def fail(**options: object) -> None:
        raise RuntimeError(f"lance error: {told}, /somewhere/in/lance.rs:12")

    monkeypatch.setattr(store._table, "optimize", fail)
    if "conflict" in told:
        store.tidy()
    else:
        with pytest.raises(FileError, match=r"cannot be read or written \(no space is left\)"):
            store.tidy()


def test_two_that_merge_at_once_say_nothing(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def work(number: int) -> None:
        store = Store(tmp_path / "store")
        for i in range(8):
            store.commit(rows(f"{number}, {i}"))
            store.tidy()

    with ThreadPoolExecutor() as pool:
        list(pool.map(work, range(3)))
    assert len(Store(tmp_path / "store")) == 24
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("code", [2, 28])
def test_only_what_may_be_damaged_is_to_be_removed(tmp_path: Path, code: int) -> None:
    with pytest.raises(FileError) as told, Store(tmp_path / "store")._explained():
        raise RuntimeError(f"lance error: LanceError(IO): {os.strerror(code)} (os error {code})")
    assert ("remove its folder" in str(told.value)) == (code == 2)


def test_an_index_has_all_rows(tmp_path: Path) -> None:
    store = Store(tmp_path / "store")
    store.commit(rows(*map(str, range(300))))
    store.tidy()
    assert not store.indexed  # only what rows are named by
    for n in (300, 600):
        store.build_index()
        assert store.indexed
        (name,) = (
            index.name for index in store._table.list_indices() if "descriptor" in index.columns
        )
        found = store._table.index_stats(name)
        assert (found.num_indexed_rows, found.num_unindexed_rows) == (n, 0)
        store.commit(rows(*map(str, range(600))))


def test_only_an_approximate_search_leaves_cells_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from lancedb.index import IvfFlat

    monkeypatch.setattr(_store, "_PROBES", 1)
    store = Store(tmp_path / "store")
    store.commit(rows(*map(str, range(300))))
    store._table.create_index("descriptor", config=IvfFlat(num_partitions=30))
    query = np.ones(8, dtype=np.float32)
    assert len(store.nearest(query, 300, index=False)) == 300
    assert 0 < len(store.nearest(query, 300, index=True)) < 150
