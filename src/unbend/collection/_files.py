"""Files that may be meshes, found and told apart by their bytes."""

from __future__ import annotations

import functools
import glob
import hashlib
import itertools
import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from unbend._parallel import run_all
from unbend.collection._rows import Entry, Failure, Hit
from unbend.errors import FileError

# What a folder is searched through for: points and arrays are added by name or pattern only.
_SUFFIXES = (".off", ".obj", ".ply", ".stl")
_FILES_AT_ONCE = 256


def find_files(given: Sequence[str]) -> Iterator[str]:
    """Absolute paths of files, of those in folders, and of those that patterns match.

    Parameters
    ----------
    given : sequence of str
        A folder stands for the meshes in it and below it, without what is hidden. What is
        nothing of all this comes back as it is.

    Yields
    ------
    str
    """
    for one in given:
        matches: Iterable[str] = [one]
        if not os.path.exists(one) and glob.has_magic(one):
            matches = itertools.chain(*_matching(glob.iglob(one, recursive=True), one))
        for match in matches:
            if os.path.isdir(match):
                yield from _walk(os.path.abspath(match))
            else:
                yield os.path.abspath(match)


def _matching(found: Iterator[str], pattern: str) -> tuple[Iterable[str], Iterable[str]]:
    """Find the matches of a pattern, or the pattern itself if there are none."""
    first = next(found, None)
    return ([pattern] if first is None else [first], found)


def _walk(folder: str) -> Iterator[str]:
    for here, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(files):
            if not name.startswith(".") and name.lower().endswith(_SUFFIXES):
                yield os.path.join(here, name)


def count_files(given: Sequence[str]) -> int:
    """Count what :func:`find_files` finds, without keeping it."""
    return sum(1 for _ in find_files(given))


def hashed(paths: Iterator[str]) -> Iterator[list[tuple[str, str] | Failure]]:
    """Hash files some hundreds at a time.

    Yields
    ------
    list of (str, str) or Failure
        Path and hash, or why it cannot be read.
    """
    while some := list(itertools.islice(paths, _FILES_AT_ONCE)):
        yield run_all(functools.partial(_hash, path) for path in some)


def _hash(path: str) -> tuple[str, str] | Failure:
    try:
        path.encode()
        if not stat.S_ISREG(os.stat(path).st_mode):  # a pipe may never end, nor a device
            return Failure(path, "it is not a regular file")
        return path, content_hash(path)
    except UnicodeEncodeError:
        readable = path.encode(errors="replace").decode()
        return Failure(readable, "its name is no text in UTF-8; rename it")
    except FileNotFoundError:
        return Failure(path, "there is no such file")
    except OSError as error:
        return Failure(path, f"it cannot be read: {error.strerror or error}")


def find_file(shape: Entry | Hit, store: str) -> str:
    """Find a file of a shape that has the content with which it was added.

    Raises
    ------
    FileError
        If there is none; the message says how to bring the collection at `store` up to date.
    """
    reasons = []
    for path in (shape.path, *shape.also):
        found = _hash(path)
        if isinstance(found, Failure):
            reasons.append(f"{path} ({found.reason})")
        elif found[1] == shape.id:
            return path
        else:
            reasons.append(f"{path} (it has changed since it was added)")
    raise FileError(
        f"cannot read {', nor '.join(reasons)}: run unbend collection add {store} NEWFOLDER, with "
        "the folder that it is in now"
    )


def is_gone(path: str) -> bool:
    """Whether there is certainly no file; one that cannot be looked for may be there."""
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return True
    except OSError:
        return False
    return False


def make_folder(path: str | os.PathLike[str]) -> Path:
    """Make a folder for results, if there is none, before anything is computed.

    Raises
    ------
    FileError
        If it cannot be made, or we may not write into it.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"cannot make the folder {folder}: {error.strerror or error}") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FileError(f"cannot write into the folder {folder}: no permission")
    return folder


def content_hash(path: str | os.PathLike[str]) -> str:
    """Hash of a file's bytes, 32 hexadecimal digits."""
    with Path(path).open("rb") as file:
        digest = hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16))
    return digest.hexdigest()
