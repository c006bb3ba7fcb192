"""Pairs of a collection, matched once."""

import csv
import re
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stones import BALL, write_stones
from unbend import Mesh, match, read_map, read_match, read_mesh, write_mesh
from unbend.choices import Partial
from unbend.collection import Collection, _collection, _pairs
from unbend.collection._engine import Outcome
from unbend.errors import FileError, InputError, UnbendWarning, warn
from unbend.matching import Match


@pytest.fixture
def three(tmp_path: Path) -> tuple[Collection, list[Path]]:
    """Three stones, in files that may be changed."""
    collection, paths = Collection(tmp_path / "store"), write_stones(tmp_path / "stones", 6)[3:]
    collection.add(paths, workers=0)
    return collection, paths


def test_all_pairs_are_matched_once(three: tuple[Collection, list[Path]], tmp_path: Path) -> None:
    collection, paths = three
    out = tmp_path / "matches"
    some = collection.match([(str(paths[0]), str(paths[2]))], out, workers=0)
    assert (some.matched, some.skipped) == (1, 0)
    told, begun = [], time.monotonic()
    rest = collection.match(None, out, workers=0, progress=lambda *how: told.append(how))
    assert (rest.matched, rest.skipped, rest.failures) == (2, 1, ())
    assert 0 < rest.seconds <= time.monotonic() - begun
    assert told[-1][0].startswith("2 of 2 pairs")
    assert len(list((out / "spectra").iterdir())) == 3
    with open(out / "matches.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    pairs = [(row["source"], row["target"]) for row in rows]
    assert pairs == [(str(paths[i]), str(paths[j])) for i, j in ((0, 1), (0, 2), (1, 2))]
    found = read_match(out / rows[2]["file"])
    alone = match(paths[1], paths[2])
    np.testing.assert_array_equal(found.source_to_target, alone.source_to_target)
    np.testing.assert_allclose(found.functional_map, alone.functional_map, atol=1e-6)
    for name in ("confidence", "overlap_source"):
        np.testing.assert_allclose(float(rows[2][name]), getattr(alone, name))
    plain = (out / rows[2]["file"]).with_suffix(".csv")
    np.testing.assert_array_equal(read_map(plain), alone.source_to_target)
    read_match(out / rows[2]["file"], source=paths[1], target=paths[2])
    other = read_mesh(paths[1])
    with pytest.raises(FileError, match="belongs to another mesh"):
        read_match(out / rows[2]["file"], source=(-other.vertices, other.faces[::-1]))


def test_matches_of_another_choice_of_what_is_partial_are_kept_apart(
    three: tuple[Collection, list[Path]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    collection, paths = three
    pair, out, asked = [(paths[0], paths[1])], tmp_path / "matches", []

    def matched(*shapes: Mesh, partial: Partial) -> Match:
        asked.append(partial)
        return match(*shapes, partial=partial)

    monkeypatch.setattr(_pairs, "match", matched)
    for partial, new in (("auto", 1), ("none", 1), ("none", 0), ("auto", 0)):
        done = collection.match(pair, out, partial=partial, workers=0)
        assert (done.matched, done.skipped) == (new, 1 - new)
        with open(out / "matches.csv", newline="") as file:
            (row,) = csv.DictReader(file)
        assert row["file"].endswith("-none.npz") == (partial == "none")
    assert asked == ["auto", "none"]
    with pytest.raises(InputError, match=r"partial must be one of auto, none, .* not 'all'"):
        collection.match(pair, out, partial="all", workers=0)


def test_long_names_whose_letters_take_several_bytes_name_files_too(tmp_path: Path) -> None:
    paths = write_stones(tmp_path / "stones", 2)
    paths = [one.rename(one.with_name(f"{'日本語' * 20}{one.name}")) for one in paths]
    collection = Collection(tmp_path / "store")
    collection.add(paths, workers=0)
    done = collection.match(None, tmp_path / "matches", workers=0)
    assert (done.matched, done.failures) == (1, ())
    assert collection.match(None, tmp_path / "matches", workers=0).skipped == 1


def test_warnings_are_told_once_for_a_shape_or_a_pair_and_doubtful_pairs_are_counted(
    three: tuple[Collection, list[Path]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    collection, paths = three
    points = np.vstack([BALL.vertices, BALL.vertices[:3] + 9])
    write_mesh(paths[0], (points, np.vstack([BALL.faces, len(BALL.vertices) + np.arange(3)])))
    collection.add(paths[0], workers=0)

    def unsure(*shapes: Mesh, partial: Partial) -> Match:
        found = match(*shapes, partial=partial)
        warn("there is something about the pair")
        return replace(found, confidence=0.59 if shapes[1].name == paths[2].name else 1.0)

    monkeypatch.setattr(_pairs, "match", unsure)
    with pytest.warns(UnbendWarning) as told:
        done = collection.match(None, tmp_path / "matches", workers=0)
    assert (done.matched, done.doubtful) == (3, 2)
    said = [str(one.message).split(": ", 1) for one in told]
    names = [name for name, _ in said]
    pairs = [f"{paths[i]} -> {paths[j]}" for i, j in ((0, 1), (0, 2), (1, 2))]
    assert names == [str(paths[0]), *pairs]
    assert "is matched" in said[0][1]
    assert collection.match(None, tmp_path / "matches", workers=0).doubtful == 2


def test_what_cannot_be_matched_is_named_once(
    three: tuple[Collection, list[Path]], tmp_path: Path, moebius_strip: Mesh
) -> None:
    collection, paths = three
    collection.remove([str(paths[0])])
    write_mesh(tmp_path / "strip.ply", moebius_strip)
    collection.add(tmp_path / "strip.ply", workers=0)
    write_mesh(paths[2], (3 * BALL.vertices, BALL.faces))
    done = collection.match(None, tmp_path / "matches", workers=0)
    assert (done.matched, done.skipped) == (0, 0)
    reasons = {Path(one.path).name: one.reason for one in done.failures}
    assert set(reasons) == {"strip.ply", paths[2].name}
    assert "only one side" in reasons["strip.ply"]
    assert f"{paths[2]} (it has changed since it was added)" in reasons[paths[2].name]
    with open(tmp_path / "matches" / "matches.csv", newline="") as file:
        assert not list(csv.DictReader(file))
    pair = paths[1], str(paths[1])
    assert collection.match([pair, pair[::-1]], tmp_path / "twice", workers=0).matched == 1
    with pytest.raises(InputError, match="a pair is a source and a target, not"):
        collection.match([pair[:1]], tmp_path / "none", workers=0)
    paths[2].unlink()
    done = collection.match(None, tmp_path / "matches", workers=0)
    reasons = {Path(one.path).name: one.reason for one in done.failures}
    assert reasons[paths[2].name] == (
        f"cannot read {paths[2]} (there is no such file): run unbend collection add "
        f"{collection.path} NEWFOLDER, with the folder that it is in now, or "
        "unbend collection remove if it is gone"
    )


def test_a_match_of_a_file_that_changed_is_not_passed_off_as_one_of_it(
    three: tuple[Collection, list[Path]], tmp_path: Path
) -> None:
    collection, paths = three
    pairs = [(paths[0], paths[1]), (paths[2], paths[2])]
    assert collection.match(pairs, tmp_path / "matches", workers=0).matched == 2
    write_mesh(paths[1], (3 * BALL.vertices, BALL.faces))
    done = collection.match(pairs, tmp_path / "matches", workers=0)
    assert (done.matched, done.skipped) == (0, 1)
    (failure,) = done.failures
    assert failure.path == str(paths[1])
    assert "it has changed since it was added" in failure.reason
    with open(tmp_path / "matches" / "matches.csv", newline="") as file:
        assert [row["source"] for row in csv.DictReader(file)] == [str(paths[2])]


def test_a_damaged_match_is_named_and_what_to_do(filled: Collection, tmp_path: Path) -> None:
    source, target, *_ = filled
    path = tmp_path / _pairs.file_name(source, target, "auto")
    path.write_bytes(b"PK")
    again = f"cannot read {path}: remove it, and run unbend collection match again"
    with pytest.raises(FileError, match=re.escape(again)):
        filled.match([(source.id, target.id)], tmp_path, workers=0)


def test_workers_with_another_current_folder_write_into_the_same(
    filled: Collection, stones: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path)

    def run(work, items):
        monkeypatch.chdir(tmp_path / "elsewhere")
        yield [Outcome(item, work(item)) for item in items]

    @contextmanager
    def engine(**options):
        yield run

    monkeypatch.setattr(_collection, "engine", engine)
    done = filled.match([(stones / "stone03.ply", stones / "stone04.ply")], "matches")
    assert (done.matched, done.failures) == (1, ())
    assert len(list((tmp_path / "matches").glob("*.npz"))) == 1


def test_mistakes(filled: Collection, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nobody.ply is not in the collection"):
        filled.match([("nobody.ply", "nobody.ply")], tmp_path / "matches", workers=0)
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot make the folder"):
        filled.match(None, tmp_path / "file" / "matches", workers=0)
    with pytest.raises(FileError, match="has no name"):
        filled.match(None, "", workers=0)
