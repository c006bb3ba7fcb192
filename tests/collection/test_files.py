"""Files that may be meshes."""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path

import pytest

from unbend.collection._files import content_hash, count_files, find_files, hashed
from unbend.collection._rows import Failure


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("b.ply", "a.OBJ", "deep/er/c.stl", "deep/d.off", "points.xyz", "labels.npy"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    (tmp_path / ".git").mkdir()
    (tmp_path / ".git" / "e.ply").touch()
    (tmp_path / ".f.ply").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def found(*given: str) -> list[str]:
    assert count_files(given) == len(list(find_files(given)))
    return [os.path.relpath(path) for path in find_files(given)]


def test_folders_are_searched_for_surfaces(folder: Path) -> None:
    assert found(".") == ["a.OBJ", "b.ply", "deep/d.off", "deep/er/c.stl"]
    assert found("deep/er", "b.ply") == ["deep/er/c.stl", "b.ply"]
    assert all(os.path.isabs(path) for path in find_files(["."]))


def test_patterns_match_whatever_they_say(folder: Path) -> None:
    assert sorted(found("*.xyz", "**/*.st?", "nothing/*.ply")) == [
        "deep/er/c.stl",
        "nothing/*.ply",
        "points.xyz",
    ]
    assert sorted(found("d*")) == ["deep/d.off", "deep/er/c.stl"]
    for name in ("odd1.ply", "odd[1].ply"):
        Path(name).touch()
    assert found("odd[1].ply") == ["odd[1].ply"]  # it is there as it is written


def test_hashes_are_of_the_bytes(folder: Path) -> None:
    expected = hashlib.blake2b(b"b.ply", digest_size=16).hexdigest()
    assert content_hash("b.ply") == expected
    (lot,) = hashed(iter(["b.ply", "gone.ply", "deep"]))
    assert lot[0] == ("b.ply", expected)
    assert lot[1] == Failure("gone.ply", "there is no such file")
    assert lot[2] == Failure("deep", "it is not a regular file")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there are no such names")
def test_a_name_that_is_no_text_is_refused(folder: Path) -> None:
    Path(os.fsdecode(b"caf\xe9.ply")).touch()
    ((lot,),) = [[one for lot in hashed(find_files(["."])) for one in lot if "caf" in str(one)]]
    assert lot == Failure(f"{folder}/caf?.ply", "its name is no text in UTF-8; rename it")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_what_may_never_end_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.off")
    (tmp_path / "endless.off").symlink_to("/dev/zero")
    (found,) = hashed(find_files([str(tmp_path)]))
    assert [one.reason for one in found if isinstance(one, Failure)] == [
        "it is not a regular file"
    ] * 2
