"""Writing files so that nobody ever sees half of one."""

from __future__ import annotations

import os
import secrets
import shutil
import stat
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from unbend._memory import available_memory
from unbend.errors import FileError


def check_writable(path: str | os.PathLike[str], suffixes: Collection[str]) -> Path:
    """Refuse an output path that cannot work, before any computing is done.

    Parameters
    ----------
    path : path
        Where a file will be written.
    suffixes : collection of str
        The suffixes that can be written, in lower case and with their dot. Empty: any.

    Returns
    -------
    Path

    Raises
    ------
    FileError
        If the suffix is not one of these, or the folder is missing or closed to us.

    Examples
    --------
    >>> from unbend.io import check_writable
    >>> check_writable("shape.jpg", (".off", ".ply"))
    Traceback (most recent call last):
    ...
    unbend.errors.FileError: cannot write shape.jpg: unknown suffix ".jpg"; use .off or .ply
    """
    path = Path(path)
    check_suffix(path, suffixes, "write")
    folder = path.parent
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # its name is too long, or we may not look
        raise FileError(f"cannot write {path}: {error.strerror or error}") from error
    if os.path.isdir(path):
        raise FileError(f"cannot write {path}: it is a folder; give a file's name")
    if os.path.exists(path) and not os.path.isfile(path):
        raise FileError(f"cannot write {path}: it is not a regular file")
    if not os.path.isdir(folder):
        raise FileError(f"cannot write {path}: there is no folder {folder}; create it first")
    if sys.platform == "win32" and path.exists() and not os.access(path, os.W_OK):
        # Elsewhere the folder alone decides; there such a file can be neither replaced nor, had
        # the temporary one taken its mode, tidied away.
        raise FileError(f"cannot write {path}: it is read-only; allow writing or remove it")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FileError(f"cannot write {path}: no permission to write in the folder {folder}")
    return path


def check_suffix(path: Path, suffixes: Collection[str], verb: str) -> str:
    """Return the suffix in lower case, or say which ones are known."""
    suffix = path.suffix.lower()
    if suffixes and suffix not in suffixes:
        *most, last = suffixes
        known = f"{', '.join(most)} or {last}" if most else last
        found = f'unknown suffix "{path.suffix}"' if suffix else "its name has no suffix"
        raise FileError(f"cannot {verb} {path}: {found}; use {known}")
    return suffix


def read_bytes(path: Path, suffixes: Collection[str]) -> bytes:
    """Read a whole file of a known kind.

    Parameters
    ----------
    path : Path
    suffixes : collection of str
        The suffixes that can be read, in lower case and with their dot. Empty: any.

    Returns
    -------
    bytes
        More than white space.

    Raises
    ------
    FileError
        If the file is missing, of another kind, cannot be read, or is empty.
    """
    if os.path.isdir(path):
        raise FileError(f"cannot read {path}: it is a folder; give a file's name")
    check_suffix(path, suffixes, "read")
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):  # a pipe may never end, nor a device
            raise FileError(f"cannot read {path}: it is not a regular file")
        free = available_memory()
        if free is not None and status.st_size > free:
            raise FileError(
                f"cannot read {path}: it has {status.st_size / 2**30:,.0f} GiB, and "
                f"{free / 2**30:,.1f} GiB of memory are free"
            )
        data = path.read_bytes()
    except FileNotFoundError:
        raise FileError(f"cannot read {path}: there is no such file") from None
    except OSError as error:
        raise FileError(f"cannot read {path}: {error.strerror or error}") from error
    if not data.strip():
        raise FileError(f"{path.name} is empty")
    return data


@contextmanager
def atomic_write(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file that appears under its name only once it is complete.

    The bytes go to a temporary name in the same folder, which is renamed at the end of the
    ``with`` block and removed if the block fails or is interrupted.

    Parameters
    ----------
    path : path
        Where the file shall be; an existing file there is replaced, keeping its permissions.

    Yields
    ------
    binary file

    Raises
    ------
    FileError
        If the folder is missing, closed to us or full.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend.io import atomic_write
    >>> path = Path(tempfile.mkdtemp()) / "hello.txt"
    >>> with atomic_write(path) as file:
    ...     _ = file.write(b"hello")
    >>> path.read_text()
    'hello'
    """
    check_writable(path, ())
    # A symbolic link keeps pointing where it did: its target is what gets replaced.
    target = Path(os.path.realpath(path))
    # Systems limit a name to 255 bytes, of which a letter may take four.
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
        with suppress(OSError):  # the usual case: it was renamed
            temporary.unlink()
