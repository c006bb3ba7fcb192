"""Commands on many files: folders stand for their meshes, and results go to a folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from unbend.cli._output import say
from unbend.errors import FileError, InputError

if TYPE_CHECKING:
    from unbend.collection import Failure


def expand_folders(paths: Iterable[str]) -> list[str]:
    """Replace folders by the meshes in and below them, in order."""
    from unbend.collection import find_files

    found: list[str] = []
    for path in paths:
        if not os.path.isdir(path):
            found.append(path)
            continue
        meshes = [os.path.join(path, os.path.relpath(one, path)) for one in find_files([path])]
        if not meshes:
            raise FileError(
                f"cannot read {path}: it is a folder without .off, .obj, .ply or .stl files"
            )
        found += meshes
    return found


def is_batch(paths: Sequence[str], out: str | None, of_one: Mapping[str, object]) -> bool:
    """Whether results go to a folder: there are several meshes, or `out` is a folder.

    Raises InputError if `out` is named like a file then, or if options of a single mesh are given.
    """
    from unbend.io import VALUE_SUFFIXES, WRITE_SUFFIXES

    is_file = out is not None and Path(out).suffix.lower() in (*WRITE_SUFFIXES, *VALUE_SUFFIXES)
    if len(paths) == 1 and (is_file or out is None or not os.path.isdir(out)):
        return False
    if is_file:
        raise InputError(f"{len(paths)} meshes need a folder to write to, and {out} is a file")
    for name, value in of_one.items():
        if value is not None:
            raise InputError(f"{name} is for a single mesh; leave it out, or -o FOLDER")
    return True


def files_in(folder: str, paths: Sequence[str], suffix: Callable[[str], str]) -> list[str]:
    """Make the folder; name a file in it after each mesh, and never one of the meshes."""
    from unbend.collection import make_folder

    meshes = {os.path.realpath(path) for path in paths}
    found: dict[str, str] = {}
    for path in paths:
        file = os.path.join(folder, Path(path).stem + suffix(path))
        if file in found:
            raise InputError(f"{found[file]} and {path} would both be written to {file}")
        if os.path.realpath(file) in meshes:
            raise InputError(f"{file} is one of the meshes; give another folder to write to")
        found[file] = path
    make_folder(folder)
    return list(found)


def shown(path: str) -> str:
    """Shorten a path that is below the folder we are in."""
    here = os.path.join(os.getcwd(), "")
    return path.removeprefix(here)


def list_failures(failures: Sequence[Failure]) -> None:
    """Name on stderr what could not be done, each with its reason."""
    for failure in failures:
        name = " -> ".join(shown(path) for path in failure.path.split(" -> "))
        say("failed", f"{name}: {failure.reason}")
