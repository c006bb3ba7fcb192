"""Files with one content are one shape, whose paths are those where it is now."""

import json
import os
import shutil
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from stones import BALL, rows_of, write_stones
from unbend import write_mesh
from unbend.collection import (
    DESCRIPTOR_VERSION,
    Added,
    Collection,
    _adding,
    _collection,
    find_file,
)
from unbend.collection._engine import Outcome
from unbend.collection._store import Store
from unbend.errors import FileError, InputError, UnbendWarning


def paths_in(collection: Collection) -> dict[str, tuple[str, ...]]:
    """Paths of all shapes, by id."""
    return {entry.id: (entry.path, *entry.also) for entry in collection}


def copied(path: str | Path, to: Path) -> str:
    return os.fspath(shutil.copyfile(path, to))


def counts(done: Added) -> tuple[int, int, int]:
    assert done.failures == ()
    return done.added, done.skipped, done.new_paths


@pytest.fixture
def pair(tmp_path: Path) -> list[str]:
    """Two folders, each with the same stone."""
    (one,) = write_stones(tmp_path / "one", 1)
    (tmp_path / "other").mkdir()
    return [str(one), copied(one, tmp_path / "other" / "copy.ply")]


@pytest.fixture
def store(tmp_path: Path) -> Collection:
    return Collection(tmp_path / "store")


def test_identical_files_are_one_shape_with_both_paths(pair: list[str], store: Collection) -> None:
    assert counts(store.add([*pair, pair[0]], workers=0)) == (1, 2, 1)
    (entry,) = store
    assert (entry.path, entry.also) == (pair[0], (pair[1],))
    assert (len(store), store.info().n_shapes, store.info().n_files) == (1, 1, 2)
    assert store.find(pair) == store.find([entry.id, entry.id]) == [entry, entry]
    assert counts(store.add(pair, workers=0)) == (0, 2, 0)


def test_added_later_they_are_one_shape_too(pair: list[str], store: Collection) -> None:
    assert counts(store.add(pair[1], workers=0)) == (1, 0, 0)
    assert counts(store.add([pair[0], *pair], workers=0)) == (0, 3, 1)
    assert list(paths_in(store).values()) == [tuple(pair)]


def test_a_copy_that_comes_after_its_twin_was_committed_is_kept(
    pair: list[str], store: Collection, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within one lot of files, of which the store is asked before any is committed."""
    monkeypatch.setattr(_adding, "_SECONDS_BETWEEN", 0)
    monkeypatch.setattr(_adding, "_COMMITS_SHARE", np.inf)
    (third,) = write_stones(Path(pair[0]).parent, 2)[1:]
    assert counts(store.add([pair[0], third, pair[1]], workers=0)) == (2, 1, 1)
    assert sorted(paths_in(store).values()) == [tuple(pair), (str(third),)]


def test_a_bad_file_fails_under_each_of_its_names(tmp_path: Path, store: Collection) -> None:
    for name in ("one.off", "other.off"):
        (tmp_path / name).write_text("OFF\n1 0 0\n")
    done = store.add([tmp_path / "one.off", tmp_path / "other.off"], workers=0)
    assert [Path(one.path).name for one in done.failures] == ["one.off", "other.off"]
    assert (done.added, done.skipped, done.new_paths) == (0, 0, 0)


def test_a_twin_under_a_wrong_suffix_fails_alone(
    pair: list[str], tmp_path: Path, store: Collection
) -> None:
    wrong = copied(pair[0], tmp_path / "a.obj")  # before the others
    for added in (1, 0):
        done = store.add(tmp_path, workers=0)
        assert [one.path for one in done.failures] == [wrong]
        assert done.added == added
        assert list(paths_in(store).values()) == [tuple(pair)]


def test_the_twin_of_a_file_that_kills_its_worker_fails_too(
    pair: list[str], store: Collection, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def deadly(**options):
        yield lambda work, items: [[Outcome(item, None, "it died") for item in items if item]]

    monkeypatch.setattr(_collection, "engine", deadly)
    done = store.add(pair)
    assert [(one.path, one.reason) for one in done.failures] == [(path, "it died") for path in pair]


def test_what_is_there_by_content_is_not_computed_again(own: Collection, tmp_path: Path) -> None:
    first, *_ = rows_of(own)
    copies = [copied(first["path"], tmp_path / name) for name in ("one.ply", "two.ply")]
    done = own.add([*copies, Path(first["path"]).parent], workers=0)
    assert counts(done) == (0, 10, 2)
    (entry,) = own.find([copies[1]])
    assert {entry.path, *entry.also} == {first["path"], *copies}
    own.remove([first["id"]])
    assert len(own) == 7
    assert counts(own.add([*copies, first["path"], copies[0]], workers=0)) == (1, 3, 2)
    assert len(own) == 8


def test_a_file_that_changed_takes_its_own_place(tmp_path: Path, store: Collection) -> None:
    (path,) = write_stones(tmp_path / "shapes", 1)
    store.add(path, workers=0)
    write_mesh(path, (2 * BALL.vertices, BALL.faces))
    assert counts(store.add(path, workers=0)) == (1, 0, 0)
    (entry,) = store
    np.testing.assert_allclose(entry.area, 4 * 4 * np.pi, rtol=0.05)


def test_a_file_that_changed_into_a_bad_one_loses_its_place(
    pair: list[str], store: Collection
) -> None:
    (third,) = write_stones(Path(pair[0]).parent, 2)[1:]
    store.add(pair, workers=0)
    for path in pair:
        Path(path).write_text("ply\nnothing more")
    done = store.add([*pair, third], workers=0)
    assert [one.path for one in done.failures] == pair
    assert list(paths_in(store).values()) == [(str(third),)]


def test_a_copy_that_changed_leaves_the_other_its_shape(pair: list[str], store: Collection) -> None:
    store.add(pair, workers=0)
    write_mesh(pair[1], (2 * BALL.vertices, BALL.faces))
    assert counts(store.add(pair, workers=0)) == (1, 1, 0)
    assert sorted(paths_in(store).values()) == [(path,) for path in pair]


def test_a_file_that_changes_before_it_is_read_is_not_kept_as_what_it_was(
    tmp_path: Path, store: Collection
) -> None:
    one, other = write_stones(tmp_path / "stones", 2)
    was = copied(other, tmp_path / "was.ply")

    def progress(_: str, share: float) -> None:
        if share:  # the first is described, and both are hashed
            copied(one, other)

    (failure,) = store.add([one, other], workers=0, progress=progress).failures
    assert (failure.path, "changed" in failure.reason) == (str(other), True)
    assert counts(store.add([other, was], workers=0)) == (1, 1, 1)


def test_files_that_changed_places_have_the_rows_of_what_they_are(
    tmp_path: Path, store: Collection
) -> None:
    """What each has now is known, from the other; still its row is of what it had."""
    one, other = map(str, write_stones(tmp_path / "shapes", 2))
    store.add([one, other], workers=0)
    before = paths_in(store)
    swapped = Path(one).read_bytes()
    shutil.copyfile(other, one)
    Path(other).write_bytes(swapped)
    assert counts(store.add([one, other, one], workers=0)) == (0, 3, 2)
    assert paths_in(store) == {
        entry: (other if path == one else one,) for entry, (path,) in before.items()
    }
    assert counts(store.add([one, other], workers=0)) == (0, 2, 0)


def test_a_folder_that_was_moved_is_brought_up_to_date(tmp_path: Path, store: Collection) -> None:
    here = write_stones(tmp_path / "stones", 2)[0].parent
    store.add(here, workers=0)
    ids = {entry.id for entry in store}
    away = here.rename(tmp_path / "away")
    with pytest.raises(FileError, match="there is no such file"):
        find_file(next(iter(store)), store.path)
    assert counts(store.add(away, workers=0)) == (0, 2, 2)
    assert {entry.id for entry in store} == ids
    for entry in store:
        assert entry.also == ()
        assert find_file(entry, store.path) == entry.path == str(away / Path(entry.path).name)
    hits = store.search(away / "stone01.ply")
    assert {hit.path for hit in hits} == {str(one) for one in away.iterdir()}


def test_a_path_that_went_away_is_dropped_whenever_its_twin_is_added(
    pair: list[str], store: Collection
) -> None:
    store.add(pair, workers=0)
    os.remove(pair[0])
    assert find_file(next(iter(store)), store.path) == pair[1]
    assert counts(store.add(pair[1], workers=0)) == (0, 1, 0)
    assert list(paths_in(store).values()) == [(pair[1],)]


@pytest.mark.parametrize("step", ["add_paths", "remove"])
def test_interrupted_anywhere_it_loses_nothing_and_goes_on(
    pair: list[str], store: Collection, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    store.add(pair[0], workers=0)
    os.remove(pair[0])

    def interrupted(*given: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Store, step, interrupted)
        with pytest.raises(KeyboardInterrupt):
            store.add(pair[1], workers=0)
    assert len(store) == 1
    assert pair[0] in next(iter(paths_in(store).values()))
    store.add(pair[1], workers=0)
    assert list(paths_in(store).values()) == [(pair[1],)]


def test_one_path_can_be_removed_or_the_whole_shape(pair: list[str], store: Collection) -> None:
    store.add(pair, workers=0)
    (whole,) = store
    for name in (pair[1], Path(pair[1])):
        (removed,) = store.remove([name, str(name)])
        assert (removed.id, removed.path, removed.also) == (whole.id, pair[1], ())
        assert list(paths_in(store).values()) == [(pair[0],)]
        store.add(pair[1], workers=0)
    assert store.remove([whole.id]) == [whole]
    assert len(store) == 0


def test_files_that_are_gone_can_be_dropped(pair: list[str], store: Collection) -> None:
    assert store.missing() == []
    store.add(pair, workers=0)
    os.remove(pair[1])
    assert store.missing() == [pair[1]]
    store.remove(store.missing())
    assert list(paths_in(store).values()) == [(pair[0],)]
    os.remove(pair[0])
    with pytest.raises(FileError, match="is a disk not mounted"):
        store.missing()


def test_a_search_counts_shapes_not_files(filled: Collection, own: Collection, tmp_path) -> None:
    paths = sorted(entry.path for entry in own)
    copies = [copied(paths[4], tmp_path / f"copy{i}.ply") for i in range(5)]
    own.add(copies, workers=0)
    for n in (1, 3, 8):
        found, plain = (one.search(paths[4], n) for one in (own, filled))
        assert [hit.id for hit in found] == [hit.id for hit in plain]
    assert {found[0].path, *found[0].also} == {paths[4], *copies}
    entries, table = own.distances()
    assert len(entries) == 8
    assert sorted(table.ravel()) == sorted(filled.distances()[1].ravel())


def test_a_search_tells_which_files_of_those_found_hold_others_now(
    tmp_path: Path, store: Collection
) -> None:
    paths = write_stones(tmp_path / "stones", 3)
    store.add(paths, workers=0)
    for path, data in zip(paths, [one.read_bytes() for one in paths[::-1]], strict=True):
        path.write_bytes(data)
    with pytest.warns(UnbendWarning, match="stone0.*and 1 other file changed after being added"):
        store.search(paths[0], 3)
    store.add(paths, workers=0)
    assert store.search(paths[0], 3)[0].path == str(paths[0])


def test_a_shape_is_matched_from_whatever_file_there_is(tmp_path: Path, store: Collection) -> None:
    one, other = write_stones(tmp_path / "stones", 2)
    copy = copied(one, tmp_path / "zcopy.ply")
    store.add([one, other, copy], workers=0)
    one.write_text("something else")
    done = store.match(None, tmp_path / "matches", workers=0)
    assert (done.matched, done.failures) == (1, ())
    told = f"{one} changed after being added: run unbend"
    with pytest.warns(UnbendWarning, match=told):
        hits = store.search(other, 2, by_match=True)
    assert all(np.isfinite(hit.energy) for hit in hits)
    os.remove(copy)
    gone = rf"{copy} \(there is no such file\): run unbend coll"
    with pytest.warns(UnbendWarning, match=told), pytest.warns(UnbendWarning, match=gone):
        hits = store.search(other, 2, by_match=True)
    assert [np.isfinite(hit.energy) for hit in hits] == [True, False]


# What a collection was before a shape had several paths: a row, with one path, for each content.
# Rows had canonical forms, too.
def write_old_store(folder: Path, rows: list[dict]) -> None:
    def fixed(name: str) -> pa.DataType:
        return pa.list_(pa.float32(), len(rows[0][name]))

    key = {"lance-schema:unenforced-primary-key": "true"}
    parameters = {"descriptor": DESCRIPTOR_VERSION, "form_points": 256, "form_components": 3}
    rows = [{**row, "form": np.zeros(768, dtype=np.float32)} for row in rows]
    schema = pa.schema(
        [
            ("id", pa.string()),
            pa.field("path", pa.string(), nullable=False, metadata=key),
            ("n_vertices", pa.int64()),
            ("n_faces", pa.int64()),
            ("area", pa.float64()),
            ("notes", pa.string()),
            ("version", pa.string()),
            ("descriptor", fixed("descriptor")),
            ("form", fixed("form")),
            ("thumbnail", pa.binary()),
        ],
        metadata={"parameters": json.dumps(parameters)},
    )
    import lancedb

    options = {"new_table_data_storage_version": "2.0"}
    database = lancedb.connect(str(folder), storage_options=options)
    database.create_table("shapes", pa.Table.from_pylist(rows, schema=schema))


def test_a_store_of_an_earlier_version_is_read_and_goes_on(
    filled: Collection, tmp_path: Path
) -> None:
    rows = rows_of(filled)
    write_old_store(tmp_path / "store", rows)
    old = Collection(tmp_path / "store")
    assert sorted(old, key=lambda one: one.path) == sorted(filled, key=lambda one: one.path)
    np.testing.assert_array_equal(old.distances()[1], filled.distances()[1])
    assert old.search(rows[3]["path"], 2) == filled.search(rows[3]["path"], 2)
    copy = copied(rows[3]["path"], tmp_path / "copy.ply")
    write_mesh(tmp_path / "new.ply", (BALL.vertices**3, BALL.faces))
    paths = [copy, *(row["path"] for row in rows), tmp_path / "new.ply"]
    assert counts(old.add(paths, workers=0)) == (1, 9, 1)
    (entry,) = old.find([copy])
    assert {entry.path, *entry.also} == {copy, rows[3]["path"]}
    assert len(old) == 9
    assert old.search(tmp_path / "new.ply", 1)[0].path == str(tmp_path / "new.ply")
    assert old.export(tmp_path / "all.parquet") == 10


def test_names_that_are_beginnings_of_two_ids_are_refused(own: Collection) -> None:
    rows = rows_of(own)[:2]
    own._store.commit([{**row, "id": f"{i}" * 32, "path": f"/{i}"} for i, row in enumerate(rows)])
    own._store.commit([{**rows[0], "id": "0" * 31 + "1", "path": "/2"}])
    with pytest.raises(InputError, match="may be several shapes"):
        own.find(["0" * 8])
    assert own.find(["1" * 8])[0].path == "/1"
