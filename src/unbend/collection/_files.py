"""Finding mesh files, and identifying them by the hash of their bytes."""

from __future__ import annotations

import functools
import glob
import hashlib
import itertools
import os
import re
import stat
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from unbend._parallel import run_all
from unbend._text import plural, quoted
from unbend._types import StrPath
from unbend.collection._rows import Entry, Failure, Hit
from unbend.errors import FileError, UnbendError, file_errors, warn
from unbend.io import FREESURFER_VALUES, READ_SUFFIXES, path_text, read_mesh
from unbend.mesh import Mesh

# Of files that folders are searched for; others are added by name or pattern only.
_SUFFIXES = (".off", ".obj", ".ply", ".stl", ".vtk", ".vtp")
_VALUES = (".npy", *FREESURFER_VALUES)  # rather than shapes
_OTHERS = tuple(one for one in READ_SUFFIXES if one not in (*_SUFFIXES, *_VALUES))
_FILES_AT_ONCE = 256
ID_DIGITS = 12  # of ids, in names of files: hardly two of a million shapes share them
REGISTRATIONS = "registrations"  # folder of a file per shape, beside its registered mesh

File = tuple[str, str]  # path and hash


def find_files(given: Sequence[str]) -> Iterator[str]:
    """Paths of files, of the meshes in and below folders, and of files matching patterns.

    Hidden files are left out of folders, and so is what registration wrote, unless a given folder
    has nothing else. A name that is none of these comes back, too, and so does a folder that cannot
    be read. Raises FileError if a folder holds no mesh.
    """
    for one in given:
        for match in matches(one):
            if not os.path.isdir(match):
                yield match
                continue
            closed: list[OSError] = []
            inside = _walk(match, onerror=closed.append)
            first = list(itertools.islice(inside, 1))
            if match == one and not (first or closed):
                known = f"{', '.join(_SUFFIXES[:-1])} or {_SUFFIXES[-1]}"
                raise FileError(f"cannot read {one}: it is a folder without {known} files")
            yield from itertools.chain(first, inside)
            yield from (error.filename for error in closed)


def matches(pattern: str) -> Iterator[str]:
    """Give what matches a pattern; the pattern itself if that exists, or if nothing matches."""
    found = iter([pattern] if os.path.exists(pattern) else glob.iglob(pattern, recursive=True))
    return itertools.chain([next(found, pattern)], found)


def warn_of_others(given: Iterable[str]) -> None:
    """Warn of files in and below folders that could be read, but are not added from folders."""
    for folder in given:
        if not os.path.isdir(folder):
            continue
        counts: Counter[str] = Counter()
        for path in _walk(folder, _OTHERS):
            counts[Path(path).suffix.lower()] += 1
            example = os.path.join(os.path.dirname(path), f"*{Path(path).suffix}")
        if counts:
            kinds = ", ".join(plural(number, f"{one} file") for one, number in counts.items())
            warn(f"{folder}: left out {kinds}; name them to include them, as in {quoted(example)}")


def _walk(
    folder: str,
    suffixes: tuple[str, ...] = _SUFFIXES,
    onerror: Callable[[OSError], object] | None = None,
) -> Iterator[str]:
    seen: set[str] = set()
    for here, folders, files in os.walk(folder, onerror=onerror, followlinks=True):
        if (place := os.path.realpath(here)) in seen:  # links may lead round in circles
            folders.clear()
            continue
        seen.add(place)
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        names = [
            name
            for name in sorted(files)
            if not name.startswith(".") and name.lower().endswith(suffixes)
        ]
        written = registered_stems(here)
        others = [name for name in names if Path(name).stem not in written]
        for name in others if others or here != folder else names:
            yield os.path.join(here, name)


def registered_stems(folder: StrPath) -> set[str]:
    """Names, without suffix, of the meshes in a folder that registration wrote."""
    results = Path(folder) / REGISTRATIONS
    return {"template", *(one.stem for one in results.glob("*.npz"))} if results.is_dir() else set()


def hashed(paths: Iterator[str]) -> Iterator[tuple[list[File], list[Failure]]]:
    """Paths with the hashes of their files, and failures, some hundreds at a time."""
    while some := list(itertools.islice(paths, _FILES_AT_ONCE)):
        found = run_all(functools.partial(hash_file, path) for path in some)
        failures = [one for one in found if isinstance(one, Failure)]
        yield [one for one in found if not isinstance(one, Failure)], failures


def hash_file(path: str) -> File | Failure:
    """Hash of a file's bytes, or why there is none."""
    try:
        path.encode()
        if os.path.isdir(path):
            os.listdir(path)  # tells why a folder cannot be read
        if not stat.S_ISREG(os.stat(path).st_mode):  # a pipe may never end, nor a device
            return Failure(path, "it is not a regular file")
        with open(path, "rb") as file:
            digest = hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16))
        return path, digest.hexdigest()
    except UnicodeEncodeError:
        path = path.encode(errors="replace").decode()
        return Failure(path, "its name is no text in UTF-8; rename it")
    except FileNotFoundError:
        return Failure(path, "there is no such file")
    except OSError as error:
        return Failure(path, f"it cannot be read: {error.strerror or error}")


def find_file(shape: Entry | Hit, store: str) -> str:
    """Find a file of a shape of the collection at `store` that is as it was added, or FileError."""
    reasons = []
    for path in (shape.path, *shape.also):
        found = hash_file(path)
        if found == (path, shape.id):
            return path
        why = found.reason if isinstance(found, Failure) else "it has changed since it was added"
        reasons.append(f"{path} ({why})")
    raise FileError(
        f"cannot read {', nor '.join(reasons)}: run unbend collection add {quoted(store)} "
        "NEWFOLDER, with the folder that it is in now, or unbend collection remove if it is gone"
    )


def warn_of_changed(shapes: Sequence[Hit], store: str) -> None:
    """Warn if files of shapes of the collection at `store` now hold others."""
    found = run_all(functools.partial(hash_file, one.path) for one in shapes)
    known = {(one.path, one.id) for one in shapes}
    changed = [now[0] for now in found if not isinstance(now, Failure) and now not in known]
    if changed:
        others = f" and {plural(len(changed) - 1, 'other file')}" if changed[1:] else ""
        warn(
            f"{changed[0]}{others} changed after being added: run unbend collection add "
            f"{quoted(store)} FOLDER, with the folder of what changed, and search again"
        )


def without_file(shapes: Iterable[Entry], store: str) -> list[Failure]:
    """Shapes of the collection at `store` of which no file is as it was added, and why."""
    failures = []
    for one in shapes:
        try:
            find_file(one, store)
        except FileError as error:
            failures.append(Failure.of(one.path, error))
    return failures


def read_found(shapes: Sequence[Entry | Hit], store: str) -> tuple[list[Mesh], list[Failure]]:
    """Read shapes of the collection at `store` to show them, and tell which cannot be read.

    Each has the name of its file, or its path from where those of one name differ on, and notes
    that name its other paths. One that cannot be read is a point, with a note that says why.
    """
    names = short_names([one.path for one in shapes])
    meshes, failures = [], []
    for one, short in zip(shapes, names, strict=True):
        try:
            mesh = read_mesh(find_file(one, store))
        except UnbendError as error:
            failures.append(Failure(one.path, str(error)))
            mesh = Mesh([[0, 0, 0]], notes=(f"not drawn: {error}",))
        path = Path(one.path)
        shown = path.name if short == path.stem else short
        notes = (*mesh.notes, *(f"also {path}" for path in one.also))
        meshes.append(replace(mesh, name=shown, notes=notes))
    return meshes, failures


def short_names(paths: Sequence[str]) -> list[str]:
    """Name files without their suffix; those whose names are alike from where they differ on."""
    alike: dict[str, list[tuple[str, ...]]] = {}
    for path in map(Path, paths):
        alike.setdefault(path.stem, []).append(path.parts)
    labels = []
    for path in map(Path, paths):
        columns = enumerate(zip(*alike[path.stem], strict=False))
        first = next((i for i, column in columns if len(set(column)) > 1), None)
        labels.append(path.stem if first is None else "/".join(path.parts[first:]))
    return labels


def stem(shape: Entry) -> str:
    """Name of a shape's file, without its suffix; two of them fit into a name of 255 bytes."""
    name = re.sub(r"[^\w.-]", "_", Path(shape.path).stem)[:60]
    return name.encode()[:100].decode(errors="ignore")


def is_gone(path: str) -> bool:
    """Whether there is certainly no such file."""
    try:
        os.stat(path)
    except OSError as error:
        return isinstance(error, FileNotFoundError | NotADirectoryError)
    return False


def make_folder(path: StrPath) -> Path:
    """Make a folder for results, if there is none; raise FileError if none can be written to."""
    if not (text := path_text(path)):
        raise FileError("the folder for results has no name; . is the current one")
    folder = Path(text)
    with file_errors(f"make the folder {folder}"):
        folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FileError(f"cannot write into the folder {folder}: no permission")
    return folder
