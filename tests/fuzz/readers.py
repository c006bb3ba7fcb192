"""Bytes through the readers of meshes, maps, values and archives."""

import functools
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from unbend import Match, Mesh, diagnose, read_map, read_match, read_mesh
from unbend.errors import UnbendError
from unbend.io import read_landmarks, read_markups, read_values
from unbend.io.formats import obj
from unbend.preparation import prepare

_FOLDER = Path(tempfile.mkdtemp(dir="/dev/shm" if os.path.isdir("/dev/shm") else None))
_MESHES = (".off", ".obj", ".ply", ".stl", ".xyz", ".npy", ".vtk", ".vtp")
_MAPS = (".txt", ".csv", ".vts", ".npy")
_MARKUPS = (".json", ".fcsv", ".csv", ".txt", ".pts", ".pp")
_VALUES = (".csv", ".txt", ".npy", ".ply", ".obj")
_N = 42  # vertices that maps and values are for
_POINTS = np.arange(3.0 * _N).reshape(-1, 3)


def meshes(data: bytes) -> None:
    """Read a mesh, the first byte being its format, and examine it; write an OBJ file like it."""
    _read(read_mesh, _MESHES, data, _check_mesh)
    _read(_rewrite, (".obj",), b"\0" + data[1:], _check_mesh)


def _rewrite(path: Path) -> Mesh:
    """Read what is written with the lines of a file: the same mesh again."""
    data, mesh = path.read_bytes(), read_mesh(path)
    again = obj.read(obj.rewrite(data, mesh.vertices))
    written = Mesh(again.vertices, again.faces)
    np.testing.assert_array_equal(written.vertices, mesh.vertices)
    np.testing.assert_array_equal(written.faces, mesh.faces)
    return written


def maps(data: bytes) -> None:
    """Read a map, whose entries must be vertices or -1; or landmarks of two kinds."""
    _read(lambda path: read_map(path, n_target=_N), _MAPS, data, _check_map)
    _read(lambda path: read_landmarks(path, _N, _N), (".csv", ".txt"), data, _check_map)
    _read(lambda path: read_markups(path, _POINTS)[1], _MARKUPS, data, _check_map)


def values(data: bytes) -> None:
    """Read values, of which there must be some."""
    _read(read_values, _VALUES, data, _check_values)


def archives(data: bytes) -> None:
    """Read a match."""
    _read(read_match, (".npz",), b"\0" + data, _check_match)


def _read(
    read: Callable[[Path], Any],
    suffixes: tuple[str, ...],
    data: bytes,
    check: Callable[[Any], None],
) -> None:
    """Read and check; unbend's own errors are welcome, and no others."""
    path = _FOLDER / f"file{suffixes[data[0] % len(suffixes)] if data else suffixes[0]}"
    path.write_bytes(data[1:])
    with warnings.catch_warnings(), suppress(UnbendError):
        warnings.simplefilter("error")
        check(read(path))


def _check_mesh(mesh: Mesh) -> None:
    assert mesh.faces.size == 0 or 0 <= mesh.faces.min() <= mesh.faces.max() < mesh.n_vertices
    used = np.unique(mesh.faces) if mesh.n_faces else np.arange(mesh.n_vertices)
    assert np.isfinite(mesh.vertices[used]).all()
    assert diagnose(mesh).n_vertices == mesh.n_vertices
    prepared = prepare(mesh, component="largest")
    assert prepared.mesh.n_vertices == len(prepared.kept)
    assert prepared.mesh.n_faces == len(prepared.kept_faces)


def _check_map(found: Any) -> None:
    assert found.dtype == np.int64
    assert -1 <= found.min() <= found.max() < _N


def _check_values(found: Any) -> None:
    assert found.size
    assert found.dtype.kind in "biufU"


def _check_match(found: Match) -> None:
    n, m = len(found.source_to_target), len(found.target_to_source)
    assert -1 <= found.source_to_target.min() <= found.source_to_target.max() < m
    assert -1 <= found.target_to_source.min() <= found.target_to_source.max() < n


def seeds(family: str) -> Iterator[bytes]:
    """Give what the corpus of bad input has for a family, each with the byte of its format."""
    known = {"meshes": _MESHES, "maps": _MAPS, "values": _VALUES}
    suffixes = known.get(family, (".npz",))
    for suffix, data in _small_files():
        if suffix in suffixes:
            yield (b"" if family == "archives" else bytes([suffixes.index(suffix)])) + data


@functools.cache
def _small_files() -> list[tuple[str, bytes]]:
    """Read the small files of the corpus of bad input, with their suffixes."""
    from corpus import CASES

    found = []
    for case in CASES:
        with tempfile.TemporaryDirectory() as folder:
            case.make(Path(folder))
            for path in sorted(Path(folder).glob("*.*")):
                if path.is_file() and path.stat().st_size < 2**16:
                    found.append((path.suffix, path.read_bytes()))
    return found
