"""Files (.npz) of matches, never as pickles."""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections.abc import Sequence
from dataclasses import MISSING, fields, replace
from hashlib import blake2b
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._text import plural
from unbend._types import FloatArray, IntArray, StrPath
from unbend.errors import FileError, InputError
from unbend.io import (
    MeshLike,
    as_mesh,
    as_path,
    atomic_write,
    check_writable,
    counted_from_zero,
    prefixed,
    read_bytes,
    whole_numbers,
)
from unbend.io.formats.npy import read_array, read_header
from unbend.matching import Hypothesis, Match
from unbend.mesh import Mesh

_Arrays = dict[str, npt.NDArray[Any]]

_REQUIRED = tuple(one.name for one in fields(Match) if one.default is MISSING)
_RANGES = {
    "orientation": (-1, 1),
    "confidence": (0, 1),
    "overlap_source": (0, 1),
    "overlap_target": (0, 1),
    "confidence_bound": (0, 1),
    "area_ratio": (0, np.inf),
    "disorder": (0, 2),
}
_MESHES = ("source_mesh", "target_mesh")  # hashes
_KNOWN = {*(one.name for one in fields(Match)), *_MESHES} - {"alternatives"}
_ALTERNATIVE = re.compile(r"alternatives/\d+/")  # comes before the names of its arrays
# Compression makes a match about ten times smaller. An archive that would grow more than a
# hundredfold, and to more than 64 MiB, is not unpacked.
_MOST_GROWTH, _ALWAYS_ALLOWED = 100, 2**26
_ROUNDING = 1e-6


def write_match(
    path: StrPath, match: Match, *, source: MeshLike | None = None, target: MeshLike | None = None
) -> None:
    """Write all fields of a match, including its alternatives, to a .npz file.

    Parameters
    ----------
    path : path
        With the suffix .npz.
    match : Match
    source, target : mesh-like, optional
        The meshes matched. Their hashes are written, so that :func:`read_match` can tell them from
        others.

    Raises
    ------
    FileError
        If the file cannot be written.
    InputError
        If it is not a match.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend import match, write_match
    >>> from unbend.datasets import make_sphere
    >>> ball, path = make_sphere(2), Path(tempfile.mkdtemp()) / "match.npz"
    >>> egg = ball.vertices * [1, 0.8, 0.6], ball.faces
    >>> write_match(path, match(egg, egg, refine=False), source=egg, target=egg)
    >>> path.exists()
    True
    """
    if not isinstance(match, Match):
        raise InputError(f"a {type(match).__name__} is no Match; write_map writes point maps")
    arrays = _arrays_of(match)
    for name, mesh in zip(_MESHES, (source, target), strict=True):
        if mesh is not None:
            arrays[name] = np.array(mesh_hashes(as_mesh(mesh)), dtype=np.uint64)
    check_writable(path, (".npz",))
    with atomic_write(path) as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def _arrays_of(match: Match) -> _Arrays:
    """Turn all fields into arrays, except for what is empty or None."""
    arrays: _Arrays = {}
    for name, value in vars(match).items():
        if name == "hypotheses":
            rows = [(one.energy, one.orientation, one.difference) for one in value]
            arrays[name] = np.reshape(rows, (-1, 3))
        elif name == "alternatives":
            for i, one in enumerate(value):
                for inner, array in _arrays_of(one).items():
                    arrays[f"alternatives/{i}/{inner}"] = array
        elif value is not None and not (isinstance(value, tuple) and not value):
            arrays[name] = np.asarray(value)
    return arrays


def read_match(
    path: StrPath, *, source: MeshLike | None = None, target: MeshLike | None = None
) -> Match:
    """Read a match that :func:`write_match` wrote.

    Parameters
    ----------
    path : path
        With the suffix .npz.
    source, target : mesh-like, optional
        Meshes that the match must belong to: of the same number of vertices and, if the file has
        hashes, of the same positions or the same faces.

    Returns
    -------
    Match

    Raises
    ------
    FileError
        If the file cannot be read, does not hold a match, or belongs to other meshes.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend.datasets import make_sphere
    >>> from unbend import match, read_match, write_match
    >>> ball, path = make_sphere(2), Path(tempfile.mkdtemp()) / "match.npz"
    >>> stone = ball.vertices * [1, 0.8, 0.6], ball.faces
    >>> write_match(path, match(stone, stone, refine=False))
    >>> len(read_match(path).source_to_target)
    162
    """
    path = as_path(path)
    data = read_bytes(path, (".npz",))
    with prefixed(path.name):
        arrays = _load(data)
        hashes = [arrays.pop(name, None) for name in _MESHES]
        folders: dict[str, _Arrays] = {"": {}}
        for name, array in arrays.items():
            folder, _, own_name = name.rpartition("/")
            folders.setdefault(folder, {})[own_name] = array
        for folder, arrays in folders.items():
            if missing := set(_REQUIRED) - set(arrays):
                raise FileError(f"holds no {folder}/{min(missing)}")
        match, *alternatives = (_checked_match(arrays) for arrays in folders.values())
        sizes = len(match.source_to_target), len(match.target_to_source)
        given = [None if mesh is None else as_mesh(mesh) for mesh in (source, target)]
        _check_meshes(
            given, sizes, [None if one is None else one.ravel().tolist() for one in hashes]
        )
        return replace(match, alternatives=tuple(alternatives))


def _checked_match(arrays: _Arrays) -> Match:
    n, m = arrays["source_to_target"].size, arrays["target_to_source"].size
    found: dict[str, Any] = {
        "source_to_target": _vertices(arrays, "source_to_target", n, m),
        "target_to_source": _vertices(arrays, "target_to_source", m, n),
        "functional_map": _numbers(arrays, "functional_map", 2),
    }
    rows, columns = found["functional_map"].shape
    if rows > n or columns > m:
        raise FileError(
            f"its functional_map of {rows} x {columns} is more than {n} and {m} vertices can have"
        )
    for name in filter(arrays.__contains__, _RANGES):
        is_float = arrays[name].dtype.kind == "f"
        if name == "confidence" and is_float and np.array_equal(arrays[name], np.nan, True):
            found[name] = np.nan
        else:
            found[name] = float(_in_range(name, _numbers(arrays, name, 0), *_RANGES[name]))
    if "mirror_fits" in arrays:
        if arrays["mirror_fits"].shape or arrays["mirror_fits"].dtype != bool:
            raise FileError("its mirror_fits is neither true nor false")
        found["mirror_fits"] = bool(arrays["mirror_fits"])
    if "mirrored" in arrays:
        found["mirrored"] = _vertices(arrays, "mirrored", n, m)
    if "expected_error" in arrays:
        partners = found["source_to_target"]
        found["expected_error"] = _row_numbers(arrays, "expected_error", partners, "vertex")
    for name, other in (("faces", "weights"), ("weights", "faces")):
        if name in arrays and other not in arrays:
            raise FileError(f"its {name} mean nothing without {other}")
    if "faces" in arrays:
        found["faces"] = _vertices(arrays, "faces", n, None)
        found["weights"] = _row_numbers(arrays, "weights", found["faces"], "face", 3)
    if "hypotheses" in arrays:
        rows = _numbers(arrays, "hypotheses", 2)
        if rows.shape[1] != 3:
            raise FileError(f"its hypotheses have {rows.shape[1]} columns, not 3; match again")
        _in_range("hypotheses", rows[:, 1], *_RANGES["orientation"])
        found["hypotheses"] = tuple(Hypothesis(*row) for row in rows.tolist())
    for name, below in (("missed_landmarks", None), ("landmark_hints", n)):
        if name in arrays:
            found[name] = tuple(_vertices(arrays, name, None, below).tolist())
    return Match(**found)


def _vertices(arrays: _Arrays, name: str, n: int | None, below: int | None) -> IntArray:
    """Check a list of n vertices or faces, -1 for none; None allows any length."""
    with prefixed(f"its {name}"):
        found = counted_from_zero(whole_numbers(arrays[name]), 0, below)
    if n is not None and len(found) != n:
        rows = plural(len(found), "row")
        raise FileError(f"its {name} has {rows}, but its source_to_target {n:,}")
    return found


def _numbers(arrays: _Arrays, name: str, n_dimensions: int) -> FloatArray:
    """Check finite numbers."""
    array = arrays[name]
    if array.ndim != n_dimensions or array.dtype.kind not in "fiu":
        what = f"a table of {n_dimensions} dimensions" if n_dimensions else "a number"
        raise FileError(f"its {name} is {array.dtype} of shape {array.shape}, not {what}")
    if not np.isfinite(array).all():
        raise FileError(f"its {name} holds numbers that are not finite")
    return np.asarray(array, dtype=np.float64)


def _in_range(name: str, array: FloatArray, least: float, most: float) -> FloatArray:
    if ((array < least - _ROUNDING) | (array > most + _ROUNDING)).any():
        raise FileError(f"its {name} is not from {least:g} to {most:g}")
    return array


def _row_numbers(
    arrays: _Arrays, name: str, partners: IntArray, what: str, *width: int
) -> FloatArray:
    """Check numbers, none negative, for each row; NaN without a partner. Weights sum to one."""
    array = arrays[name]
    shape = len(partners), *width
    if array.shape != shape or array.dtype.kind != "f":
        raise FileError(f"its {name} is {array.dtype} of shape {array.shape}, not {shape}")
    rows = array.reshape(len(partners), -1)
    right = (np.isfinite(rows) & (rows >= -_ROUNDING)).all(axis=1)
    if name == "weights":
        right &= np.abs(rows.sum(axis=1) - 1) <= _ROUNDING
    wrong = ~np.where(partners >= 0, right, np.isnan(rows).all(axis=1))
    if wrong.any():
        row = int(wrong.argmax())
        raise FileError(f"its {name} in row {row} cannot go with {what} {partners[row]}")
    return np.asarray(array, dtype=np.float64)


def _load(data: bytes) -> _Arrays:
    """Unpack only the arrays of a match, and none larger than its header says."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            found = {info.filename.removesuffix(".npy"): info for info in members}
            for name in _REQUIRED:
                if name not in found:
                    raise FileError(f"holds no {name}; it was not written by unbend match")
            if len(found) < len(members):
                raise FileError("holds two arrays of one name; it was not written by unbend")
            wanted = {
                name: info
                for name, info in found.items()
                if _ALTERNATIVE.sub("", name, count=1) in _KNOWN
            }
            _check_sizes(archive, wanted, len(data))
            return {name: read_array(archive.read(info)) for name, info in wanted.items()}
    except FileError:
        raise
    except Exception as error:  # zipfile raises many kinds on damaged archives
        raise FileError("not a .npz file, or a damaged one") from error


def _check_sizes(archive: zipfile.ZipFile, wanted: dict[str, zipfile.ZipInfo], packed: int) -> None:
    """Check, before anything is unpacked, that sizes go with shapes and are not far too large."""
    for name, info in wanted.items():
        # Other compressions are unpacked whole, whatever size the archive says.
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise FileError(f"its {name} is packed in a way that NumPy does not use")
        with archive.open(info) as stream, prefixed(f"its {name}"):
            shape, _, dtype = read_header(stream)
            size = stream.tell() + math.prod(shape) * dtype.itemsize
        if size != info.file_size:
            raise FileError(
                f"its {name} is {info.file_size} bytes, but with shape {shape} it would be {size}"
            )
    name, info = max(wanted.items(), key=lambda one: one[1].file_size)
    if sum(one.file_size for one in wanted.values()) > max(_ALWAYS_ALLOWED, _MOST_GROWTH * packed):
        raise FileError(
            f"its {name} would grow from {info.compress_size} bytes to {info.file_size}: no match "
            "does"
        )


def mesh_hashes(mesh: Mesh) -> list[int]:
    """Hash positions and faces, apart: of one mesh either may change, by rounding or by a pose."""
    parts = [mesh.vertices.astype("<f8")] + [mesh.faces.astype("<i8")] * (mesh.n_faces > 0)
    digests = [blake2b(part.tobytes(), digest_size=8).digest() for part in parts]
    return [int.from_bytes(digest, "little") for digest in digests]


def _check_meshes(
    given: Sequence[Mesh | None], sizes: Sequence[int], stored: Sequence[list[Any] | None]
) -> None:
    """Raise FileError unless source and target have these sizes and, if known, these hashes."""
    own = [
        mesh_hashes(mesh) if mesh is not None and known is not None else []
        for mesh, known in zip(given, stored, strict=True)
    ]
    here, there = ([(one or [None])[0] for one in some] for some in (own, stored))
    if None not in here and here == there[::-1] != there:
        source, target = (one.name for one in given if one is not None)
        raise FileError(
            f"maps {target} to {source}: exchange source and target, or match them the other way"
        )
    for mesh, size, hashes, known in zip(given, sizes, own, stored, strict=True):
        if mesh is None:
            continue
        if mesh.n_vertices != size:
            raise FileError(
                f"belongs to a mesh of {plural(size, 'vertex')}, but {mesh.name} has "
                f"{mesh.n_vertices:,}"
            )
        if known is not None and set(hashes).isdisjoint(known):
            raise FileError(
                f"belongs to another mesh than {mesh.name}, or to the same with its vertices in "
                "another order, as in another format: give the file that was matched, or match "
                "again"
            )
