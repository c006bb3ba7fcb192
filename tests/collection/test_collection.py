"""A collection: what is added is found, once, whatever happened on the way."""

import csv
import math
import os
import pickle
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from logging import CRITICAL
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from stones import BALL, rows_of, write_stones
from unbend import Mesh, read_mesh, write_mesh
from unbend.collection import Collection, Failure, Hit, _collection, _ranking, _store, descriptor
from unbend.collection._engine import Outcome
from unbend.errors import FileError, InputError, MeshError, MissingExtraError, UnbendWarning


def assert_same_rows(one: Collection, other: Collection) -> None:
    """Rows are equal but for rounding, which hangs on the number of threads."""
    left, right = rows_of(one), rows_of(other)
    assert [row["path"] for row in left] == [row["path"] for row in right]
    for mine, theirs in zip(left, right, strict=True):
        for name in ("id", "n_vertices", "n_faces", "area", "notes", "version"):
            assert mine[name] == theirs[name]
        np.testing.assert_allclose(mine["descriptor"], theirs["descriptor"], atol=1e-4)


def test_it_begins_empty_and_leaves_no_trace(tmp_path: Path) -> None:
    collection = Collection(tmp_path / "new")
    assert (len(collection), list(collection), collection.exists) == (0, [], False)
    assert not (tmp_path / "new").exists()
    for use in (
        lambda: collection.search(BALL),
        collection.distances,
        collection.info,
        lambda: collection.export(tmp_path / "all.csv"),
    ):
        with pytest.raises(FileError, match="there are no shapes in"):
            use()


def test_it_shows_where_it_is_and_how_large(filled: Collection) -> None:
    assert repr(filled) == f"Collection({filled.path!r}, 8 shapes)"
    assert repr(pickle.loads(pickle.dumps(filled))) == repr(filled)


def test_a_shape_finds_itself_then_those_like_it(filled: Collection, stones: Path) -> None:
    rows = rows_of(filled)
    vectors = np.array([row["descriptor"] for row in rows])
    for i in (0, 7):
        apart = np.linalg.norm(vectors - vectors[i], axis=1)
        hits = filled.search(stones / f"stone{i:02}.ply", 8)
        assert hits[0].path == rows[i]["path"]
        assert [hit.path for hit in hits] == [rows[j]["path"] for j in np.argsort(apart)]
        np.testing.assert_allclose([hit.distance for hit in hits], np.sort(apart), atol=1e-3)
    np.testing.assert_allclose(vectors[0], descriptor(stones / "stone00.ply"), atol=1e-4)


def test_bad_files_stop_nothing_and_are_named(tmp_path: Path) -> None:
    bad = tmp_path / "bad"
    write_stones(bad, 1)
    (bad / "torn.ply").write_bytes(b"ply\nnothing more")
    (bad / "empty.off").write_bytes(b"")
    write_mesh(bad / "line.obj", (np.outer([0, 1, 2], [1, 1, 1]), [[0, 1, 2]]))
    (bad / ".hidden.ply").write_bytes(b"not looked at")
    collection = Collection(tmp_path / "store")
    done = collection.add([bad, tmp_path / "nowhere.ply", f"{tmp_path}/*.stl"], workers=0)
    assert done.added == len(collection) == 1
    reasons = {Path(one.path).name: one.reason for one in done.failures}
    assert set(reasons) == {"torn.ply", "empty.off", "line.obj", "nowhere.ply", "*.stl"}
    assert reasons["nowhere.ply"] == "there is no such file"
    assert "degenerate" in reasons["line.obj"]
    assert all("\n" not in reason for reason in reasons.values())


def test_a_file_that_kills_its_worker_is_named_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (path,) = write_stones(tmp_path / "shapes", 1)

    @contextmanager
    def deadly(**options):
        yield lambda function, items: ([Outcome(item, None, "it died")] for item in items if item)

    monkeypatch.setattr(_collection, "engine", deadly)
    done = Collection(tmp_path / "store").add(path)
    assert (done.added, done.failures) == (0, (Failure(str(path), "it died"),))


def test_workers_are_those_asked_for(
    filled: Collection, stones: Path, tmp_path: Path, asked: dict[str, object]
) -> None:
    where = {"workers": 3, "scheduler": "tcp://somewhere:8786"}
    template, pair = stones / "stone00.ply", (stones / "stone00.ply", stones / "stone01.ply")
    for use in (
        lambda: Collection(tmp_path / "store").add(stones, **where),
        lambda: filled.match(None, tmp_path / "matches", **where),
        lambda: filled.match([pair], tmp_path / "matches", **where),
        lambda: filled.register(template, tmp_path / "out", **where),
    ):
        asked.clear()
        with suppress(FileError):  # what is registered cannot be read, for nothing was done
            use()
        assert asked == where


def test_open_and_torn_shapes_in_pieces_are_welcome(tmp_path: Path) -> None:
    half = BALL.faces[BALL.vertices[BALL.faces].mean(axis=1)[:, 2] > 0]
    box = [[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)]
    sides = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]]
    shapes = {
        "bowl": (BALL.vertices, half),
        "box": (np.array(box, dtype=float), sides),
        "pair": (
            np.concatenate([BALL.vertices, BALL.vertices + 5]),
            np.concatenate([BALL.faces, BALL.faces + BALL.n_vertices]),
        ),
        "points": (BALL.vertices, np.empty((0, 3), dtype=int)),
    }
    for name, shape in shapes.items():
        write_mesh(tmp_path / f"{name}.ply", Mesh(*shape))
    collection = Collection(tmp_path / "store")
    assert collection.add(tmp_path, workers=0).failures == ()
    assert [Path(row["path"]).stem for row in rows_of(collection)] == sorted(shapes)
    hits = collection.search(tmp_path / "box.ply", 2)
    assert Path(hits[0].path).stem == "box"


def test_matches_rank_again_and_what_cannot_be_matched_comes_last(
    tmp_path: Path, moebius_strip: Mesh
) -> None:
    (path,) = write_stones(tmp_path, 8)[7:]
    write_mesh(tmp_path / "strip.ply", moebius_strip)
    vertices = read_mesh(path).vertices
    both = np.concatenate([vertices, 0.01 * vertices])
    write_mesh(tmp_path / "with_dust.ply", (both, [*BALL.faces, *(BALL.faces + len(vertices))]))
    collection = Collection(tmp_path / "store")
    collection.add([path, tmp_path / "strip.ply", tmp_path / "with_dust.ply"], workers=0)
    told = []
    hits = collection.search(
        path, 3, by_match=True, progress=lambda stage, share: told.append((stage, share))
    )
    assert ("matching 2 of 3", 1 / 3) in told
    assert {Path(hit.path).stem for hit in hits[:2]} == {"stone07", "with_dust"}
    np.testing.assert_allclose([hit.energy for hit in hits], [0, 0, np.inf], atol=0.01)
    strip = tmp_path / "strip.ply"
    with pytest.warns(UnbendWarning, match="none could be matched, .* descriptors: strip.ply"):
        again = collection.search(strip, by_match=True)
    assert [hit.id for hit in again] == [hit.id for hit in collection.search(strip)]


def test_matches_rank_by_their_best_energy_then_by_distance(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    energies = {"a": 0.3, "b": 0.1, "c": None, "d": 0.1}

    def match(query, path):
        assert query is BALL
        if energies[path] is None:
            raise MeshError("it cannot be matched")
        return SimpleNamespace(
            hypotheses=[SimpleNamespace(energy=energies[path] + i) for i in (0, 1)]
        )

    monkeypatch.setattr(_ranking, "find_file", lambda hit, store: hit.path)
    monkeypatch.setattr(_ranking, "read_mesh", lambda path: path)
    monkeypatch.setattr(_ranking, "match", match)
    told = []
    hits = [Hit(path=path, id=path, distance=4 - i) for i, path in enumerate("abcd")]
    found = _ranking.rank_by_match(BALL, hits, "store", lambda *at: told.append(at))
    assert [hit.path for hit in found] == ["d", "b", "a", "c"]
    assert [hit.energy for hit in found] == [0.1, 0.1, 0.3, math.inf]
    assert told == [(f"matching {i + 1} of 4", i / 4) for i in range(4)]


def test_an_index_finds_what_looking_at_all_finds(
    filled: Collection, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_collection, "_LEAST_INDEXED", 300)
    rows = rows_of(filled)
    chance = np.random.default_rng(0)
    many = Collection(tmp_path / "store")
    for start in (0, 300):
        some = [
            {
                **rows[i % 8],
                "id": f"{start + i:032x}",
                "path": f"/nowhere/{start + i}",
                "descriptor": np.float32(chance.normal(size=len(rows[0]["descriptor"]))),
            }
            for i in range(300)
        ]
        many._store.commit([*some, *rows])
        exact, near = (many.search(rows[5]["path"], 5, index=index) for index in (False, True))
        assert near[0].path == exact[0].path == rows[5]["path"]
        assert len({hit.id for hit in near} & {hit.id for hit in exact}) >= 4
        assert many.info().indexed


def test_only_a_large_collection_gets_an_index_and_only_where_asked(
    own: Collection, stones: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = stones / "stone05.ply"
    for least, asked in ((9, {"index": True}), (8, {}), (8, {"index": True})):
        monkeypatch.setattr(_collection, "_LEAST_INDEXED", least)
        assert not own.info().indexed
        assert own.search(path, 1, **asked)[0].path == str(path)
    assert own.info().indexed


def test_twice_as_many_as_asked_for_are_matched(
    filled: Collection, stones: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_collection, "rank_by_match", lambda query, hits, *rest: hits[::-1])
    path = stones / "stone05.ply"
    best = filled.search(path, 8)
    assert filled.search(path, 4, by_match=True) == best[:3:-1]


def test_distances_are_those_of_the_descriptors(filled: Collection) -> None:
    entries, table = filled.distances()
    assert [entry.path for entry in entries] == sorted(entry.path for entry in filled)
    vectors = np.array([row["descriptor"] for row in rows_of(filled)])
    np.testing.assert_allclose(table, np.linalg.norm(vectors[:, None] - vectors, axis=2), atol=1e-6)


def test_a_table_too_large_is_refused(filled: Collection, monkeypatch: pytest.MonkeyPatch) -> None:
    tables = 3 * 8 * 8**2  # so many bytes have three numbers for each pair
    monkeypatch.setattr(_ranking, "available_memory", lambda: tables)
    assert filled.distances()[1].shape == (8, 8)
    monkeypatch.setattr(_ranking, "available_memory", lambda: tables - 1)
    with pytest.raises(InputError, match="all pairs of 8 shapes need"):
        filled.distances()


def test_shapes_are_found_by_path_or_id_and_removed(own: Collection) -> None:
    first, second, *_ = sorted(own, key=lambda entry: entry.path)
    assert own.find([first.path, second.id[:8]]) == [first, second]
    assert own.find(first.path) == own.find(Path(first.path)) == [first]
    with pytest.raises(InputError, match="is not in the collection"):
        own.remove([first.id, "it's not there"])
    assert len(own) == 8
    assert own.remove(first.id) == [first]
    assert first.path not in {entry.path for entry in own}
    assert Path(first.path).exists()


def test_many_names_need_few_queries(own: Collection, monkeypatch: pytest.MonkeyPatch) -> None:
    entries = list(own) * 150
    names = [(one.path, one.id, one.id[:8])[i % 3] for i, one in enumerate(entries)]
    batches, queries = own._store.batches, []

    def counted(*given: object) -> object:
        queries.append(given)
        return batches(*given)

    monkeypatch.setattr(own._store, "batches", counted)
    assert own.find(names) == entries
    assert len(queries) < 0.02 * len(names)
    assert own.remove(iter(names[:6])) == entries[:6]


def test_what_another_process_removes_meanwhile_is_not_there(
    own: Collection, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second, *_ = sorted(own, key=lambda entry: entry.path)

    def remove_after(name: str, id: str) -> None:
        before = getattr(own._store, name)

        def after(*given, **more):
            found = before(*given, **more)
            monkeypatch.undo()
            own.remove([id])
            return found

        monkeypatch.setattr(own._store, name, after)

    remove_after("select", first.id)
    with pytest.raises(InputError, match="is not in the collection"):
        own.find([first.id])
    remove_after("find", second.id)
    with pytest.raises(InputError, match="is not in the collection"):
        own.thumbnail(second.id)


def test_a_thumbnail_is_a_picture_of_the_shape(filled: Collection, tmp_path: Path) -> None:
    from matplotlib.image import imread

    entry = next(iter(filled))
    (tmp_path / "thumbnail.png").write_bytes(filled.thumbnail(entry.id))
    picture = imread(tmp_path / "thumbnail.png")
    rows, columns, channels = picture.shape
    assert max(rows, columns) in range(90, 100)
    assert channels == 4
    assert picture[0, 0, 3] == 0  # nothing in the corner of a stone's picture
    assert picture[rows // 2, columns // 2, 3] == 1


def test_export_keeps_every_number(filled: Collection, tmp_path: Path) -> None:
    from pyarrow.parquet import read_table

    assert filled.export(tmp_path / "all.parquet") == filled.export(tmp_path / "all.csv") == 8
    kept = {row["id"]: row for row in rows_of(filled)}
    assert {row["id"]: row for row in read_table(tmp_path / "all.parquet").to_pylist()} == kept
    with open(tmp_path / "all.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 8
    for row in rows:
        expected = kept[row["id"]]["descriptor"]
        vector = [float(row[f"descriptor_{i}"]) for i in range(len(expected))]
        np.testing.assert_allclose(vector, expected, rtol=1e-6)
        assert row["path"] == kept[row["id"]]["path"]
    with pytest.raises(FileError, match="unknown suffix"):
        filled.export(tmp_path / "all.json")


def test_mistakes(filled: Collection, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="n must be a whole number"):
        filled.search(BALL, 0)
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="is a file"):
        Collection(tmp_path / "file")
    with pytest.raises(FileError, match="holds other things"):
        Collection(tmp_path)
    import lancedb

    lancedb.connect(tmp_path / "foreign").create_table("shapes", [{"id": "x", "vector": [1.0]}])
    with pytest.raises(FileError, match="foreign is another program's; a collection is a folder"):
        Collection(tmp_path / "foreign")
    monkeypatch.setattr(_store, "DESCRIPTOR_VERSION", "another")
    for use in (lambda: filled.add(tmp_path), lambda: filled.search(BALL), filled.distances):
        with pytest.raises(InputError, match="do not compare with those of this unbend, another"):
            use()
    assert filled.export(tmp_path / "all.csv") == 8  # which compares nothing
    monkeypatch.setitem(sys.modules, "lancedb", None)
    with pytest.raises(MissingExtraError, match="pip install lancedb dask distributed"):
        Collection(tmp_path / "store")


def test_commits_pile_up_only_so_far(
    filled: Collection, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_store, "_COMMITS_UNMERGED", 4)
    store = Collection(tmp_path / "store")._store
    for i, row in enumerate(rows_of(filled)):
        store.commit([row])
        assert len(store) == i + 1
    assert len(list((tmp_path / "store" / "shapes.lance" / "_indices").iterdir())) >= 2


def test_a_damaged_table_is_refused(filled: Collection, tmp_path: Path) -> None:
    shutil.copytree(filled.path, tmp_path / "store")
    for one in (tmp_path / "store" / "shapes.lance" / "_versions").iterdir():
        one.unlink()
    with pytest.raises(FileError, match="if it is damaged, remove its folder"):
        Collection(tmp_path / "store")


ADD = """import sys
from unbend.collection import Collection
Collection(sys.argv[1]).add(sys.argv[2], workers=1)
"""


def test_killed_and_resumed_it_is_as_if_undisturbed(
    filled: Collection, stones: Path, tmp_path: Path
) -> None:
    (tmp_path / "add.py").write_text(ADD)  # a script without a guard, as people write them
    done = subprocess.Popen([sys.executable, tmp_path / "add.py", tmp_path / "killed", stones])
    while done.poll() is None and len(Collection(tmp_path / "killed")) < 3:
        time.sleep(0.2)
    done.kill()
    done.wait()
    killed = Collection(tmp_path / "killed")
    last = killed.add(stones, workers=0)
    assert last.skipped >= 3
    assert last.added + last.skipped == 8
    assert_same_rows(killed, filled)


def test_a_cluster_gives_the_same_table_and_may_lose_a_worker(
    forked: None, filled: Collection, stones: Path, tmp_path: Path
) -> None:
    from distributed import LocalCluster

    options = {"dashboard_address": "127.0.0.1:0", "silence_logs": CRITICAL}
    with LocalCluster(n_workers=2, threads_per_worker=1, **options) as cluster:
        collection = Collection(tmp_path / "store")
        killed = []

        def kill_one(stage: str, share: float) -> None:
            if share > 0.3 and not killed:
                killed.append(cluster.workers[0].pid)
                os.kill(killed[0], getattr(signal, "SIGKILL", signal.SIGTERM))

        done = collection.add(stones, scheduler=cluster.scheduler_address, progress=kill_one)
        assert killed
        assert (done.added, done.failures) == (8, ())
        assert_same_rows(collection, filled)


def test_an_empty_name_is_not_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_mesh("ball.ply", BALL)
    collection = Collection("store")
    added = collection.add("", workers=0)
    assert (added.added, len(added.failures)) == (0, 1)
    collection.add("ball.ply", workers=0)
    for call in (collection.remove, lambda name: collection.register(name, "out")):
        with pytest.raises(InputError, match=" is not in the collection"):
            call("")
    assert len(collection) == 1
    with pytest.raises(InputError, match=r"^\./other is not in the collection"):
        collection.remove("./other")
