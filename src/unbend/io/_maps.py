"""Reading and writing point maps."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from unbend._arrays import array_of, check_whole, is_whole, snap
from unbend._text import plural
from unbend._types import FloatArray, IntArray, StrPath
from unbend.errors import FileError, InputError, warn
from unbend.io._files import as_path, atomic_write, check_writable, prefixed, read_bytes
from unbend.io._foreign import MeshLike
from unbend.io._meshes import as_mesh
from unbend.io._value_tables import read_table_of_values
from unbend.io.formats.contents import (
    are_numbers,
    data_lines,
    misfit,
    refuse_blank_rows,
    text_lines,
)
from unbend.io.formats.landmarks import LABELS
from unbend.io.formats.npy import read_array, write_array
from unbend.mesh import edge_ends

MAP_SUFFIXES = (".npy", ".txt", ".csv", ".vts")
_LESS = 0.8  # Maps off by one are 1.5 times as rough on grids, 2.5 times and more on scans.
_SIDES = (("source", "target"), ("template", "scan"))  # what names of columns of landmarks hold


def read_map(
    path: StrPath,
    *,
    base: int | None = None,
    n_source: int | None = None,
    n_target: int | None = None,
) -> IntArray:
    r"""Read a point map: the target vertex of each source vertex.

    Parameters
    ----------
    path : path
        A .npy file with a one-dimensional array, or a .txt, .csv or .vts file with one number
        to a line. A .csv file may begin with a line that names its columns, one of which may hold
        the source vertices, see :func:`unbend.io.read_values`.
    base : {0, 1}, optional
        What the file counts vertices from. Default: 1 for .vts, 0 for the others. In either, -1
        says that a vertex has no image.
    n_source, n_target : int, optional
        How many vertices the two shapes have.

    Returns
    -------
    (n_source,) ndarray of int64
        Counted from 0; -1 where there is no image.

    Raises
    ------
    FileError
        If the file cannot be read, holds something else than whole numbers, has the wrong length
        or names a vertex that does not exist.

    See Also
    --------
    unbend.read_match : A whole match, from a .npz file.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from unbend import read_map
    >>> path = pathlib.Path(tempfile.mkdtemp(), "map.vts")
    >>> _ = path.write_text("3\n1\n-1\n")
    >>> read_map(path)
    array([ 2,  0, -1])
    """
    path = as_path(path)
    for name, number in (("n_source", n_source), ("n_target", n_target)):
        if number is not None:
            check_whole(number, name, 1)
    data = read_bytes(path, MAP_SUFFIXES)
    suffix = path.suffix.lower()
    first = _base(base, suffix)
    with prefixed(path.name):
        values = whole_numbers(read_array(data)) if suffix == ".npy" else _numbers(data, suffix)
        if n_source is not None and len(values) != n_source:
            raise FileError(
                f"holds {plural(len(values), 'row')}, but the source has "
                f"{plural(n_source, 'vertex')}; "
                "a map has one row for each"
            )
        return counted_from_zero(values, first, n_target)


def write_map(path: StrPath, point_map: npt.ArrayLike, *, base: int | None = None) -> None:
    """Write a point map: the target vertex of each source vertex.

    Parameters
    ----------
    path : path
        The suffix (.npy, .txt, .csv or .vts) says the format; see :func:`read_map`.
    point_map : (n_source,) array_like of int
        Counted from 0; -1 where there is no image, which is written as -1 in every format.
    base : {0, 1}, optional
        What the file shall count vertices from. Default: 1 for .vts, 0 for the others.

    Raises
    ------
    FileError
        If the suffix is unknown or the file cannot be written.
    InputError
        If the map is empty, or not a list of whole numbers of at least -1.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from unbend import write_map
    >>> path = pathlib.Path(tempfile.mkdtemp(), "map.vts")
    >>> write_map(path, [2, 0, -1])
    >>> path.read_text().split()
    ['3', '1', '-1']
    """
    path = check_writable(path, MAP_SUFFIXES)
    suffix = path.suffix.lower()
    first = _base(base, suffix)
    images = checked_map(point_map)
    if not len(images):
        raise InputError("a map of no vertices cannot be written")
    rows = np.where(images < 0, -1, images + first)
    with atomic_write(path) as file:
        if suffix == ".npy":
            write_array(file, rows)
        else:
            lines = ["target_vertex"] * (suffix == ".csv") + [str(row) for row in rows.tolist()]
            file.write(("\n".join(lines) + "\n").encode())


def read_landmarks(
    path: StrPath, n_source: int | None = None, n_target: int | None = None
) -> IntArray:
    """Read landmarks (l, 2): on each line a source vertex and the corresponding target vertex.

    The file is .csv or .txt, its numbers counted from 0 and separated by a comma or blanks. A .csv
    file may begin with column names, ``source,target`` or ``template,scan`` in either order; a
    nameless first column, of names of rows, is left out. Raises FileError if it cannot be read or
    has other lines or names, or numbers not below `n_source` and `n_target`.
    """
    path = as_path(path)
    data = read_bytes(path, (".csv", ".txt"))
    is_csv = path.suffix.lower() == ".csv"
    if is_csv:  # NumPy writes names of columns as a comment
        sides = "|".join(word for words in _SIDES for word in words)
        data = re.sub(rf"(?mi)\A#\W*(?=({sides})\W+({sides})\W*$)".encode(), b"", data)
    with prefixed(path.name):
        lines = data_lines(data, path.suffix[1:])
        rows = [re.sub('[,;"]', " ", line).split() for line in lines]
        if rows and is_csv and not any(are_numbers([word]) for word in rows[0]):
            header, rows = lines[0].lower(), rows[1:]
            if re.fullmatch(rf"\W*({'|'.join(LABELS)})\W+vertex\W*", header):
                raise FileError(
                    "holds vertices of one mesh; landmarks are pairs of vertices, source,target"
                )
            if re.match(r'[\s"]*[,;]', header):  # names of rows, as pandas and R write them
                rows = [row[1:] for row in rows]
            places = [[header.find(word) for word in words] for words in _SIDES]
            first, second = next((two for two in places if min(two) >= 0), (0, 0))
            if first == second:
                raise FileError(
                    f"its columns are named {header[:40]!r}, which tells no direction; name them "
                    "source,target"
                )
            if second < first:
                rows = [row[::-1] for row in rows]
        if not rows:
            raise FileError("holds no landmarks")
        for index, row in enumerate(rows):
            if len(row) != 2 or not all(word.isdecimal() and len(word) < 19 for word in row):
                meant = "two vertex numbers, of the source and of the target, counted from 0"
                if len(row) > 2:
                    meant += "; points need a file for each shape"
                raise misfit(f"row {index}", " ".join(row), f"; a landmark is {meant}")
            for word, n, side in zip(row, (n_source, n_target), ("source", "target"), strict=True):
                if n is not None and int(word) >= n:
                    raise FileError(
                        f"row {index} names vertex {word}, but the {side} has "
                        f"{plural(n, 'vertex')}, counted from 0"
                    )
    return np.array(rows, dtype=np.int64)


def checked_map(
    values: npt.ArrayLike, n_target: int | None = None, what: str = "a map"
) -> IntArray:
    """Turn a map of any whole type into an array of int64.

    Raises InputError if it is no map, or names a vertex that the target does not have.
    """
    array = array_of(values, what)
    is_list = array.ndim == 1 and array.dtype.kind in "iu"
    images = array.astype(np.int64) if is_list else np.array([-2])
    if images.min(initial=-1) < -1:  # of uint64, what is too large turns negative
        raise InputError(f"{what} must be a list of vertex numbers (whole, from 0; -1 for none)")
    if n_target is not None and images.max(initial=-1) >= n_target:
        raise InputError(
            f"{what} names target vertex {images.max()}, but the target has "
            f"{plural(n_target, 'vertex')}"
        )
    return images


def invert_map(point_map: npt.ArrayLike, target: MeshLike) -> IntArray:
    """Invert a map from source to target.

    A target vertex that is the image of several source vertices takes the first of them; one that
    is the image of none takes that of the vertex nearest to it along the target's edges.

    Parameters
    ----------
    point_map : (n_source,) array_like of int
        Target vertex of each source vertex, -1 for none.
    target : mesh-like

    Returns
    -------
    (n_target,) ndarray of int64
        Source vertex of each target vertex; -1 where no edges lead to the image of any.

    Raises
    ------
    InputError
        If the map names a vertex that the target lacks.

    Examples
    --------
    >>> from unbend.io import invert_map
    >>> invert_map([2, 0], ([[0, 0, 0], [1, 0, 0], [0, 3, 0]], [[0, 1, 2]]))
    array([1, 1, 0])
    """
    mesh = as_mesh(target)
    n = mesh.n_vertices
    images = checked_map(point_map, n)
    hit, first = np.unique(images, return_index=True)
    hit, first = hit[hit >= 0], first[hit >= 0]
    inverse = np.full(n, -1, dtype=np.int64)
    inverse[hit] = first
    if len(hit) and mesh.n_faces:
        i, j = edge_ends(mesh.faces, n).T
        lengths = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1)
        graph = sp.csr_matrix((snap(lengths), (i, j)), shape=(n, n))
        _, _, nearest = dijkstra(
            graph, directed=False, indices=hit, return_predecessors=True, min_only=True
        )
        reached = nearest >= 0
        inverse[reached] = inverse[nearest[reached]]
    return inverse


def roughness(source: MeshLike, target: MeshLike) -> Callable[[IntArray], float]:
    """Return what sums up how far apart a map leads neighbours of the source."""
    mesh, places = as_mesh(source), as_mesh(target).vertices
    i, j = edge_ends(mesh.faces, mesh.n_vertices).T
    return lambda images: _length(places, images[i], images[j])


def straight_error(
    target: MeshLike, rows: IntArray, truth: IntArray
) -> Callable[[IntArray], float]:
    """Return what sums up how far from the truth, in a straight line, a map leads some vertices."""
    places = as_mesh(target).vertices
    return lambda images: _length(places, images[rows], truth)


def _length(places: FloatArray, start: IntArray, end: IntArray) -> float:
    there = (start >= 0) & (end >= 0)
    return float(np.linalg.norm(places[start[there]] - places[end[there]], axis=1).sum())


def refuse_other_base(
    path: StrPath, point_map: IntArray, n_target: int, cost: Callable[[IntArray], float]
) -> None:
    """Raise FileError if a map costs clearly less where its file counts from the other of 0 and 1.

    A map that is off by one leads to what is next in the file, not on the surface.
    """
    first = _base(None, Path(path).suffix.lower())
    other = np.where(point_map < 0, -1, point_map + 2 * first - 1)
    possible = other.max() < n_target and (other < 0).sum() == (point_map < 0).sum()
    if possible and cost(other) < _LESS * cost(point_map):
        raise FileError(
            f"{path}: fits far better if it counts from {1 - first}: add --base {1 - first}, or "
            f"--base {first} if it does not"
        )


def warn_of_truth(
    paths: Sequence[str], point_map: IntArray, target: MeshLike, rows: IntArray, truth: IntArray
) -> None:
    """Warn if a map is far nearer the truth where the files of that count from 1."""
    if (
        any(path.lower().endswith(".vts") for path in paths)
        or min(rows.min(), abs(truth).min()) < 1
    ):
        return
    other = np.where(truth < 0, -1, truth - 1)
    here, there = straight_error(target, rows, truth), straight_error(target, rows - 1, other)
    if there(point_map) < _LESS / 2 * here(point_map):
        warn(
            f"{paths[0]} and {paths[1]} count from 0, and the map is far nearer the truth if they "
            "count from 1: name them .vts, if they do"
        )


def _base(base: int | None, suffix: str) -> int:
    if base is not None and (not is_whole(base) or base not in (0, 1)):
        raise InputError(f"base must be 0 or 1, not {base!r}")
    return int(suffix == ".vts") if base is None else base


def _numbers(data: bytes, suffix: str) -> IntArray:
    if suffix == ".csv":
        values, _ = read_table_of_values(data, suffix, None)
        if values.dtype.kind != "U":
            return whole_numbers(values)
        lines = values.tolist()
    else:
        every = text_lines(data, suffix[1:])
        refuse_blank_rows(every, "write -1 for a vertex without image")
        lines = [row for line in every if (row := line.partition("#")[0].strip())]
    for index, line in enumerate(lines):
        if not are_numbers([line]):
            raise misfit(f"row {index}", line, "; a map has one vertex number to a line")
    return whole_numbers(np.array([float(line) for line in lines]))


def whole_numbers(values: npt.NDArray[Any]) -> IntArray:
    """Accept whole numbers, also those that some program stored as floats."""
    if values.ndim != 1 or values.dtype.kind not in "iuf":
        raise FileError(
            f"holds {values.dtype} of shape {values.shape}; a map is a list of vertex numbers, "
            "whose rows in .csv a column named vertex may number"
        )
    if not len(values):
        raise FileError("holds no rows")
    whole = np.abs(values) < 2.0**53  # beyond it floats skip numbers; NaN fails too
    whole[whole] = values[whole] == np.floor(values[whole])
    if not whole.all():
        row = int(np.flatnonzero(~whole)[0])
        raise FileError(f"row {row} is {values[row]}, which is not a vertex number (-1 for none)")
    return values.astype(np.int64)


def counted_from_zero(values: IntArray, first: int, n_target: int | None) -> IntArray:
    """Check vertex numbers and count them from 0; -1, for no image, stays."""
    images = np.where(values == -1, -1, values - first)
    last = np.iinfo(np.int64).max if n_target is None else n_target - 1
    outside = (images < 0) & (values != -1) | (images > last)
    if not outside.any():
        return images
    row = int(np.flatnonzero(outside)[0])
    known = f"{first} or more" if n_target is None else f"{first} to {n_target - 1 + first}"
    raise FileError(
        f"row {row} is {values[row]}, but counted from {first} vertices are {known} (or -1 for "
        f"none); does the file count from {1 - first}?"
    )
