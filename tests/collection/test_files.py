"""Files that may be meshes."""

import hashlib
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from unbend._text import quoted
from unbend.collection._files import (
    find_file,
    find_files,
    hashed,
    is_gone,
    read_found,
    warn_of_others,
)
from unbend.collection._rows import Failure, Hit
from unbend.errors import FileError, UnbendWarning


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in (
        "b.ply",
        "a.OBJ",
        "deep/er/c.stl",
        "deep/d.off",
        "g.vtk",
        "points.xyz",
        "labels.npy",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    (tmp_path / ".git").mkdir()
    (tmp_path / ".git" / "e.ply").touch()
    (tmp_path / ".f.ply").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def found(*given: str) -> list[str]:
    return [os.path.relpath(path) for path in find_files(given)]


def test_folders_are_searched_for_surfaces(folder: Path) -> None:
    assert found(".") == ["a.OBJ", "b.ply", "g.vtk", "deep/d.off", "deep/er/c.stl"]
    assert found("deep/er", "b.ply") == ["deep/er/c.stl", "b.ply"]
    assert list(find_files(["deep/er"])) == [os.path.join("deep/er", "c.stl")]


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


def test_what_registration_wrote_is_left_out_below_a_folder(folder: Path) -> None:
    for name in ("deep/fitted/registrations/d-1.npz", "deep/fitted/template.off"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    (folder / "deep" / "fitted" / "d-1.off").touch()
    assert found("deep") == ["deep/d.off", "deep/er/c.stl"]
    assert found("deep/fitted") == ["deep/fitted/d-1.off", "deep/fitted/template.off"]
    (folder / "deep" / "fitted" / "d.off").touch()  # scans in the folder that is written to
    assert found("deep/fitted") == ["deep/fitted/d.off"]
    assert found("deep") == ["deep/d.off", "deep/er/c.stl", "deep/fitted/d.off"]


@pytest.mark.skipif(sys.platform == "win32", reason="links need a privilege")
def test_links_to_folders_are_followed_once(folder: Path) -> None:
    (folder / "far").mkdir()
    (folder / "far" / "g.ply").touch()
    (folder / "deep" / "far").symlink_to(folder / "far")
    (folder / "deep" / "up").symlink_to(folder / "deep")
    assert found("deep") == ["deep/d.off", "deep/er/c.stl", "deep/far/g.ply"]


def test_a_folder_that_cannot_be_read_is_told(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def closed(path: str, do: Callable[[str], object]) -> object:
        if os.path.basename(path) == "er":
            raise PermissionError(13, "Permission denied", path)
        return do(path)

    for name in ("scandir", "listdir"):
        monkeypatch.setattr(os, name, partial(closed, do=getattr(os, name)))
    inside = os.path.join("deep", "er")
    assert found("deep") == ["deep/d.off", inside]
    assert found(inside) == [inside]
    ((_, failures),) = hashed(find_files(["deep"]))
    assert failures == [Failure(inside, "it cannot be read: Permission denied")]


def test_a_folder_without_any_mesh_is_refused(folder: Path) -> None:
    (folder / "bare").mkdir()
    with pytest.raises(FileError, match=r"^cannot read bare: it is a folder without .off, .obj"):
        found("deep", "bare")
    assert found("bar*", "deep/er") == ["deep/er/c.stl"]  # a pattern asks for what there is


def test_other_meshes_in_folders_are_counted(folder: Path) -> None:
    for name in ("deep/1.glb", "deep/er/2.GLB", "deep/3.vtu", "deep/er/lh.thickness"):
        (folder / name).touch()
    example = quoted(os.path.join("deep/er", "*.GLB"))
    with pytest.warns(UnbendWarning) as told:
        warn_of_others(["deep", "deep/er", "b.ply", "nothing"])
    assert [str(one.message) for one in told] == [
        f"deep: left out 2 .glb files, 1 .vtu file; name them to include them, as in {example}",
        f"deep/er: left out 1 .glb file; name them to include them, as in {example}",
    ]


def test_hashes_are_of_the_bytes(folder: Path) -> None:
    expected = hashlib.blake2b(b"b.ply", digest_size=16).hexdigest()
    ((files, failures),) = hashed(iter(["b.ply", "gone.ply", "deep"]))
    assert files == [("b.ply", expected)]
    assert failures == [
        Failure("gone.ply", "there is no such file"),
        Failure("deep", "it is not a regular file"),
    ]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there are no such names")
def test_a_name_that_is_no_text_is_refused(folder: Path) -> None:
    Path(os.fsdecode(b"caf\xe9.ply")).touch()
    ((_, failures),) = hashed(find_files(["."]))
    assert failures == [Failure("./caf?.ply", "its name is no text in UTF-8; rename it")]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_what_may_never_end_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.off")
    (tmp_path / "endless.off").symlink_to("/dev/zero")
    ((_, failures),) = hashed(find_files([str(tmp_path)]))
    assert [one.reason for one in failures] == ["it is not a regular file"] * 2


def test_only_what_certainly_is_not_there_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    assert not is_gone(str(tmp_path / "file"))
    assert is_gone(str(tmp_path / "nowhere" / "file"))
    assert is_gone(str(tmp_path / "file" / "below"))

    def closed(path: str) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("unbend.collection._files.os.stat", closed)
    assert not is_gone(str(tmp_path / "nowhere"))


def test_a_shape_is_in_the_first_file_that_is_as_it_was(tmp_path: Path) -> None:
    paths = [str(tmp_path / name) for name in ("a.off", "b.off", "c.off")]
    for path in paths:
        Path(path).write_text("the same")
    digest = hashlib.blake2b(b"the same", digest_size=16).hexdigest()
    shape = Hit(digest, paths[0], 0.0, also=tuple(paths[1:]))
    assert find_file(shape, "store") == paths[0]
    os.remove(paths[0])
    Path(paths[1]).write_text("something else")
    assert find_file(shape, "store") == paths[2]
    Path(paths[2]).unlink()
    with pytest.raises(FileError) as told:
        find_file(shape, "my store")
    assert str(told.value) == (
        f"cannot read {paths[0]} (there is no such file), nor {paths[1]} (it has changed since it "
        f"was added), nor {paths[2]} (there is no such file): run unbend collection add "
        f"{quoted('my store')} NEWFOLDER, with the folder that it is in now, or "
        "unbend collection remove if it is gone"
    )


def test_shown_files_of_one_name_are_named_from_where_their_folders_differ() -> None:
    files = ("human/plain/0.off", "human/noisy/0.off", "human/0.ply", "cup/1.off")
    shown, _ = read_found([Hit("", f"/scans/{file}", 0.0) for file in files], "store")
    assert [one.name for one in shown] == ["plain/0.off", "noisy/0.off", "0.ply", "1.off"]
