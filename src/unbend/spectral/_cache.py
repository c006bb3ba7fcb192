"""Spectra kept on disk, so that a mesh's eigenpairs are computed once.

A file is named after everything that its eigenpairs depend on. One that is damaged or foreign is
recomputed; a folder that cannot be written is done without. Any number of processes may share it.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._arrays import is_number
from unbend._types import FloatArray
from unbend.errors import FileError, InputError, file_errors
from unbend.io import atomic_write
from unbend.mesh import Mesh

# Total size that the cache may grow to, unless UNBEND_CACHE_GIB says another; the files used
# longest ago go first. If it is 0, the cache is off.
_MOST_GIB = "2"
_OWN = "[0-9a-f]" * 40 + ".npz"  # files of ours, whatever else is in the folder
_ABANDONED_SECONDS = 3600.0  # a temporary file this old was left by a process that was killed


@dataclass(frozen=True)
class CacheInfo:
    """What the cache holds, and the size that it may grow to."""

    folder: Path
    n_files: int
    n_bytes: int
    most_bytes: int


def cache_folder() -> Path:
    """Folder of the cache: ``UNBEND_CACHE_DIR``, or the user's cache folder of the platform.

    Examples
    --------
    >>> from unbend.spectral import cache_folder, use_cache
    >>> with use_cache("spectra"):
    ...     cache_folder().name
    'spectra'
    """
    import platformdirs

    return Path(os.environ.get("UNBEND_CACHE_DIR") or platformdirs.user_cache_path("unbend"))


@contextmanager
def use_cache(
    folder: str | os.PathLike[str] | None = None, *, gib: float | None = None
) -> Iterator[None]:
    """Keep spectra elsewhere, or not at all, within a ``with`` block.

    Sets the environment variables ``UNBEND_CACHE_DIR`` and ``UNBEND_CACHE_GIB`` for this process
    and those that it starts meanwhile. All threads share them: use it around what starts threads,
    not in several threads at once.

    Parameters
    ----------
    folder : path, optional
        Where to keep spectra; other files there are left alone.
    gib : float, optional
        Size that the cache may grow to; 0 switches it off.

    Examples
    --------
    >>> from unbend import spectrum
    >>> from unbend.datasets import make_sphere
    >>> from unbend.spectral import use_cache
    >>> with use_cache(gib=0):  # nothing is read from disk, and nothing is kept
    ...     found = spectrum(make_sphere(2), 5)
    """
    if folder is not None and not (folder and isinstance(folder, str | os.PathLike)):
        raise InputError(f"folder must be a path, not {folder!r}; gib=0 switches the cache off")
    if gib is not None and not (is_number(gib) and 0 <= gib < np.inf):
        raise InputError(f"gib must be a number of GiB, 0 or more, not {gib!r}")
    size = None if gib is None else str(gib)
    given = {"UNBEND_CACHE_DIR": folder, "UNBEND_CACHE_GIB": size}
    settings = {name: os.fspath(value) for name, value in given.items() if value is not None}
    before = {name: os.environ[name] for name in settings if name in os.environ}
    os.environ.update(settings)
    try:
        yield
    finally:
        for name in settings:
            os.environ.pop(name, None)
        os.environ.update(before)


def _most_bytes() -> int:
    text = os.environ.get("UNBEND_CACHE_GIB") or _MOST_GIB
    try:
        most = int(float(text) * 2**30)
    except (ValueError, OverflowError):
        most = -1
    if most < 0:
        raise InputError(f"UNBEND_CACHE_GIB must be a number of GiB, 0 or more, not {text!r}")
    return most


def cache_key(mesh: Mesh, *how: str | float) -> str:
    """Name under which a mesh's spectrum is kept: a hash of the mesh and of how it was computed."""
    return _hash(f"{how!r} {mesh.vertices.shape}", mesh.vertices, mesh.faces).hex()


def _hash(text: str, *arrays: npt.NDArray[Any]) -> bytes:
    digest = hashlib.blake2b(text.encode(), digest_size=20)
    for array in arrays:
        digest.update(np.ascontiguousarray(array).data)
    return digest.digest()


def load_eigenpairs(key: str) -> tuple[FloatArray, FloatArray] | None:
    """Return the eigenvalues (k,) and eigenfunctions (n, k) kept under a key, or None."""
    if not _most_bytes():
        return None
    path = cache_folder() / f"{key}.npz"
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
            values, functions = file["eigenvalues"], file["eigenfunctions"]
            checked = bytes(file["digest"]) == _digest(key, values, functions)
    except Exception:  # whatever a damaged file makes NumPy or zipfile raise, it is no use
        return None
    if not checked:
        return None
    with suppress(OSError):
        os.utime(path)  # used just now: last to go
    return values, functions


def store_eigenpairs(key: str, values: FloatArray, functions: FloatArray) -> None:
    """Keep eigenpairs for the next time; quietly does nothing where that is impossible."""
    if functions.nbytes > _most_bytes() // 2:
        return
    digest = np.frombuffer(_digest(key, values, functions), dtype=np.uint8)
    with suppress(OSError, FileError):
        folder = cache_folder()
        folder.mkdir(parents=True, exist_ok=True)
        _make_room(functions.nbytes)
        with atomic_write(folder / f"{key}.npz") as file:
            np.savez(file, eigenvalues=values, eigenfunctions=functions, digest=digest)


def cache_info() -> CacheInfo:
    """Count what the cache holds.

    Examples
    --------
    >>> import tempfile
    >>> from unbend import spectrum
    >>> from unbend.datasets import make_sphere
    >>> from unbend.spectral import cache_info, use_cache
    >>> with use_cache(tempfile.mkdtemp()):
    ...     _ = spectrum(make_sphere(2), 9)
    ...     cache_info().n_files
    1
    """
    sizes = [size for _, size, _ in _files()]
    return CacheInfo(cache_folder(), len(sizes), sum(sizes), _most_bytes())


def clear_cache() -> int:
    """Remove every cached spectrum; return how many there were. FileError if one cannot be.

    Examples
    --------
    >>> import tempfile
    >>> from unbend import spectrum
    >>> from unbend.datasets import make_sphere
    >>> from unbend.spectral import clear_cache, use_cache
    >>> with use_cache(tempfile.mkdtemp()):
    ...     _ = spectrum(make_sphere(2), 9)
    ...     clear_cache()
    1
    """
    files = list(_files())
    for path, _, _ in files:
        with file_errors(f"remove {path}"):
            path.unlink(missing_ok=True)
    return len(files)


def _digest(key: str, values: FloatArray, functions: FloatArray) -> bytes:
    return _hash(f"{key} {values.shape} {functions.shape}", values, functions)


def _files(pattern: str = _OWN) -> Iterator[tuple[Path, int, float]]:
    """Path, size and time of last use of each file; others may remove them meanwhile."""
    for path in cache_folder().glob(pattern):
        with suppress(OSError):
            status = path.stat()
            yield path, status.st_size, status.st_mtime


def _make_room(n_bytes: int) -> None:
    now = time.time()
    given_up = [
        path for path, _, used in _files(f".{_OWN}.*.part") if now - used > _ABANDONED_SECONDS
    ]
    files = sorted(_files(), key=lambda file: file[2])
    excess = sum(size for _, size, _ in files) + n_bytes - _most_bytes()
    for path, size, _ in files:
        if excess > 0:
            given_up.append(path)
            excess -= size
    for path in given_up:
        with suppress(OSError):  # gone already or, on Windows, open in another process: let it be
            path.unlink()
