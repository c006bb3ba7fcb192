"""Files appear whole or not at all."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from unbend.errors import FileError
from unbend.io import _files, atomic_write, check_writable, write_map, write_values
from unbend.io._files import read_bytes


def test_a_file_appears_only_when_complete(tmp_path: Path) -> None:
    with atomic_write(tmp_path / "a.txt") as file:
        file.write(b"half")
        assert not (tmp_path / "a.txt").exists()
        file.write(b" and half")
    assert (tmp_path / "a.txt").read_bytes() == b"half and half"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("problem", [ValueError, KeyboardInterrupt])
def test_a_failure_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, problem: type[BaseException]
) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"old")

    def fail() -> None:
        with atomic_write(path) as file:
            file.write(b"new")
            raise problem

    with pytest.raises(problem):
        fail()
    assert path.read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_full_disk_is_one_sentence(tmp_path: Path) -> None:
    with (
        pytest.raises(FileError, match=r"cannot write .*a\.txt: No space left"),
        atomic_write(tmp_path / "a.txt"),
    ):
        raise OSError(28, "No space left on device")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of this kind")
@pytest.mark.parametrize(
    "write", [write_map, lambda path, one: write_values(path, one, np.eye(len(one), 3))]
)
def test_arrays_that_do_not_fit_say_why(tmp_path: Path, write) -> None:
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        with pytest.raises(FileError, match="File too large"):
            write(tmp_path / "a.npy", np.zeros(10_000, dtype=np.int64))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no permissions of this kind")
def test_permissions_follow_the_users_mask_and_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    mask = os.umask(0o027)
    try:
        with atomic_write(path):
            pass
    finally:
        os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o640
    path.chmod(0o604)
    with atomic_write(path):
        pass
    assert path.stat().st_mode & 0o777 == 0o604


@pytest.mark.skipif(sys.platform == "win32", reason="links need a privilege")
def test_a_link_keeps_pointing_where_it_did(tmp_path: Path) -> None:
    (tmp_path / "link.txt").symlink_to(tmp_path / "target.txt")
    (tmp_path / "target.txt").write_bytes(b"old")
    with atomic_write(tmp_path / "link.txt") as file:
        file.write(b"new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "target.txt").read_bytes() == b"new"


def test_outputs_that_cannot_work_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert check_writable(tmp_path / "a.OFF", [".off"]) == tmp_path / "a.OFF"
    with pytest.raises(FileError, match=r"no suffix; use \.off"):
        check_writable(tmp_path / "a", [".off"])
    with pytest.raises(FileError, match=r"no suffix; use \.npy or \.off$"):
        read_bytes(tmp_path / "mesh", (".npy", ".off", ".npy"))
    with pytest.raises(FileError, match="it is a folder; give a file's name"):
        check_writable(tmp_path, (".ply",))
    with pytest.raises(FileError, match="it is a folder"):
        check_writable(tmp_path, [])
    with pytest.raises(FileError, match="there is no folder"):
        check_writable(tmp_path / "missing" / "a.off", [".off"])
    if sys.platform != "win32":
        with pytest.raises(FileError, match="not a regular file"):
            check_writable("/dev/null", [])
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(FileError, match="no permission"):
        check_writable(tmp_path / "a.off", [".off"])


def test_a_read_only_file_is_refused_where_it_cannot_be_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.off"
    path.touch()
    monkeypatch.setattr(os, "access", lambda name, mode: Path(name) != path)
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(FileError, match="it is read-only; allow writing or remove it"):
        check_writable(path, [])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in folders")
def test_what_is_no_file_is_neither_read_nor_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    os.mkfifo(path)
    with pytest.raises(FileError, match="not a regular file"), atomic_write(path):
        pass
    assert path.is_fifo()
    with pytest.raises(FileError, match="not a regular file"):
        read_bytes(path, ())


@pytest.mark.parametrize("free", [2**21 - 1, 2**21, None])
def test_a_file_larger_than_memory_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free: int | None
) -> None:
    (tmp_path / "a.txt").write_bytes(b"four" * 2**19)
    monkeypatch.setattr(_files, "available_memory", lambda: free)
    if free == 2**21 - 1:
        with pytest.raises(FileError, match="of memory are free"):
            read_bytes(tmp_path / "a.txt", ())
    else:
        assert len(read_bytes(tmp_path / "a.txt", ())) == 2**21


def test_the_longest_name_of_wide_letters_can_be_written(tmp_path: Path) -> None:
    path = tmp_path / f"{'𝄞' * 62}.ply"  # 252 bytes of 255
    with atomic_write(path) as file:
        file.write(b"clef")
    assert path.read_bytes() == b"clef"


def test_a_name_that_is_too_long_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot write"):
        check_writable(tmp_path / ("a" * 300 + ".txt"), ())


def test_suffixes_are_told_apart_by_their_letters_alone(tmp_path: Path) -> None:
    assert check_writable(tmp_path / "a.PLY", (".off", ".ply")) == tmp_path / "a.PLY"
