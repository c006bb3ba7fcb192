"""Whole files and tables: read at once, or written so that nobody ever sees half of one."""

from __future__ import annotations

import csv
import io
import os
import secrets
import shutil
import stat
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

from unbend._memory import available_memory
from unbend._text import gib
from unbend._types import StrPath
from unbend.errors import FileError, InputError, file_errors


def path_text(path: StrPath) -> str:
    """Text of a path as it is; InputError of what is none, as where arguments are exchanged."""
    text = os.fspath(path) if isinstance(path, str | os.PathLike) else path
    if not isinstance(text, str):
        raise InputError(f"a path is needed, not {type(text).__name__}")
    return text


def as_path(path: StrPath) -> Path:
    """Make a Path, as :func:`path_text` allows."""
    return Path(path_text(path))


def check_writable(path: StrPath, suffixes: Collection[str]) -> Path:
    """Raise FileError if a file cannot be written, before anything is computed.

    Suffixes are in lower case, with their dot; empty: any. The folder must exist and be writable.
    """
    path = as_path(path)
    if os.path.isdir(path):
        raise FileError(f"cannot write {path}: it is a folder; give a file's name")
    check_suffix(path, suffixes, "write")
    folder = path.parent
    with file_errors(f"write {path}"), suppress(FileNotFoundError, NotADirectoryError):
        path.lstat()  # its name may be too long, or we may not look
    if os.path.exists(path) and not os.path.isfile(path):
        raise FileError(f"cannot write {path}: it is not a regular file")
    if not os.path.isdir(folder):
        problem = ", but a file" if os.path.exists(folder) else "; create it first"
        raise FileError(f"cannot write {path}: there is no folder {folder}{problem}")
    if sys.platform == "win32" and path.exists() and not os.access(path, os.W_OK):
        # Windows neither replaces nor removes a read-only file; elsewhere only the folder counts.
        raise FileError(f"cannot write {path}: it is read-only; allow writing or remove it")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FileError(f"cannot write {path}: no permission to write in the folder {folder}")
    return path


# What to do with files that are not read.
_ADVICE = {
    ".vrm": "it is a .glb file: rename it to that",
    **dict.fromkeys((".fbx", ".blend", ".usd", ".usdz"), "export it as .glb or .obj"),
    ".surf": "if FreeSurfer wrote it, rename it to end in .pial",
}


def check_suffix(path: Path, suffixes: Collection[str], verb: str) -> None:
    """Raise FileError if the suffix is none of these; empty: any."""
    suffix = path.suffix.lower()
    if suffixes and suffix not in suffixes:
        *most, last = dict.fromkeys(suffixes)
        known = f"{', '.join(most)} or {last}" if most else last
        found = f'unknown suffix "{path.suffix}"' if suffix else "its name has no suffix"
        advice = _ADVICE.get(suffix) if verb == "read" else None
        raise FileError(f"cannot {verb} {path}: {found}; {advice or f'use {known}'}")


def read_bytes(path: Path, suffixes: Collection[str]) -> bytes:
    """Read a whole file whose suffix is one of these; empty: any.

    Raises FileError if it is missing, of another kind, larger than the free memory, empty,
    compressed as a whole, or unreadable.
    """
    if os.path.isdir(path):
        raise FileError(f"cannot read {path}: it is a folder; give a file's name")
    check_suffix(path, suffixes, "read")
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):  # a pipe may never end, nor a device
            raise FileError(f"cannot read {path}: it is not a regular file")
        # Asking takes as long as reading a small file does.
        free = available_memory() if status.st_size > 2**20 else None
        if free is not None and status.st_size > free:
            raise FileError(
                f"cannot read {path}: it has {gib(status.st_size)}, and {gib(free)} of memory are "
                "free"
            )
        data = path.read_bytes()
    except FileNotFoundError:
        raise FileError(f"cannot read {path}: there is no such file") from None
    except OSError as error:
        raise FileError(f"cannot read {path}: {error.strerror or error}") from error
    if not data.strip():
        raise FileError(f"{path.name} is empty")
    if data.startswith(b"\x1f\x8b\x08"):
        raise FileError(f"{path.name} is compressed with gzip; unpack it first")
    return data


@contextmanager
def prefixed(prefix: str) -> Iterator[None]:
    """Put a prefix, such as the file's name, in front of errors that readers raise without it."""
    try:
        yield
    except InputError as error:
        raise type(error)(f"{prefix}: {error}") from error.__cause__


@contextmanager
def atomic_write(path: StrPath) -> Iterator[BinaryIO]:
    """Open a file that appears under its name, or replaces another, only once it is complete.

    It is written under a temporary name in the same folder, and renamed at the end of the ``with``
    block. If the block fails or is interrupted, nothing is left. A replaced file's permissions are
    kept. Raises FileError if the folder is missing, closed to us or full.
    """
    check_writable(path, ())
    # Replace the target of a symbolic link, not the link.
    target = Path(os.path.realpath(path))
    # Names are limited to 255 bytes; a character takes up to four.
    temporary = target.with_name(f".{target.name[:50]}.{secrets.token_hex(4)}.part")
    try:
        with open(temporary, "xb") as file:
            yield file
        if target.exists():
            shutil.copymode(target, temporary)
        os.replace(temporary, target)
    except OSError as error:
        raise FileError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        with suppress(OSError):  # usually it was renamed
            temporary.unlink()


def read_table(path: StrPath, columns: Sequence[str]) -> list[list[str]]:
    """Read the values of these columns, in any order and among others; the first line names them.

    Row i is line i + 2 of a file without empty lines. Blanks around values do not count. Raises
    FileError if the file cannot be read, lacks a column or a value, or has one too many.
    """
    path = Path(path)
    data = read_bytes(path, (".csv", ".txt"))
    try:
        reader = csv.DictReader(
            io.StringIO(data.decode("utf-8-sig"), newline=""), skipinitialspace=True
        )
        heads = [name.strip() for name in reader.fieldnames or ()]
        reader.fieldnames = heads
        if twice := [name for name in heads if name and heads.count(name) > 1]:
            raise FileError(f"{path}: the first line names the column {twice[0]} twice")
        for name in columns:
            if name not in heads:
                raise FileError(
                    f"{path}: there is no column {name}; the first line must name the columns "
                    f"{', '.join(columns)}, with commas between"
                )
        found = list(reader)
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"cannot read {path}: {error}") from None
    rows = []
    for line, cells in enumerate(found, start=2):
        if any(cells.get(None, ())):
            raise FileError(f"{path}: line {line} has more values than there are columns")
        rows.append([(cells[name] or "").strip() for name in columns])
        for name, value in zip(columns, rows[-1], strict=True):
            if not value:
                raise FileError(f"{path}: line {line} has no {name}")
    return rows


def write_table(path: StrPath, rows: Iterable[Iterable[Any]], *, quote_all: bool = False) -> None:
    """Write rows, the first being the names of the columns; the file appears once complete."""
    with atomic_write(path) as file:
        # What a line may end with is quoted in values, a carriage return too.
        lines: Any = SimpleNamespace(
            write=lambda line: file.write(line[:-2].encode(errors="replace") + b"\n")
        )
        options: dict[str, Any] = {"quoting": csv.QUOTE_ALL} if quote_all else {}
        csv.writer(lines, lineterminator="\r\n", **options).writerows(rows)
