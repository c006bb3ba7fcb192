"""Landmarks as points with labels: files of 3D Slicer and MeshLab, tables of x, y, z."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from unbend._arrays import listed
from unbend._text import plural
from unbend._types import FloatArray, IntArray, StrPath
from unbend.errors import FileError, InputError, warn
from unbend.io._files import as_path, atomic_write, check_writable, prefixed, read_bytes
from unbend.io._foreign import MeshLike
from unbend.io._meshes import as_mesh
from unbend.io.formats import landmarks
from unbend.mesh import Mesh, used_vertices, vertex_ids

MARKUP_SUFFIXES = landmarks.SUFFIXES
# Of the diagonal of the mesh's bounding box: how far from the mesh a point may be, and how far from
# the vertex that it is described as unless it has been moved.
_FARTHEST, _MOVED = 0.03, 1e-3
# So many times closer points are on other axes, or to the other of two meshes, if those are meant.
_CLOSER, _CLOSER_TO_OTHER = 3.0, 2.0
_SCHEMA = (
    "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/"
    "Resources/Schema/markups-schema-v1.0.3.json#"
)


def read_markups(path: StrPath, mesh: MeshLike) -> tuple[list[str], IntArray]:
    """Read landmarks that 3D Slicer, MeshLab, unbend or another program placed on a mesh.

    Parameters
    ----------
    path : path
        A .mrk.json or .fcsv file. A point described as ``vertex 123`` is that vertex if it lies
        there; any other is moved to the nearest vertex. Points in RAS are turned to LPS, in which
        Slicer writes meshes. Or a .pp file of MeshLab, without the points that are not active. Or
        a .csv, .txt or .pts table: x, y and z in each row, perhaps after a label, or in columns of
        these names, or those of 3D Slicer, l, p, s or r, a, s, with a label in the first or in one
        called label, name or landmark; or columns label and vertex, as the page of ``unbend view``
        saves landmarks of one mesh.
    mesh : mesh-like
        The mesh with the points on it.

    Returns
    -------
    labels : list of str
        Empty where a point has none.
    vertices : (l,) ndarray of int64

    Raises
    ------
    FileError
        If the file cannot be read, a point is farther from the mesh than 3 % of its size, one
        without a label has no position, or the points fit the mesh far better in the other of RAS
        and LPS.

    Warns
    -----
    UnbendWarning
        Of points with a label that have no position, which are left out; of points that lie
        elsewhere than the vertices they are described as; and of points at different places that
        are one vertex.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend.datasets import make_sphere
    >>> from unbend.io import read_markups, write_markups
    >>> path = Path(tempfile.mkdtemp()) / "ball.mrk.json"
    >>> write_markups(path, make_sphere(2), [7, 100], ["nose", "ear"])
    >>> read_markups(path, make_sphere(2))
    (['nose', 'ear'], array([  7, 100]))
    """
    labels, vertices, _ = _read(as_path(path), _places(as_mesh(mesh)), alone=True)
    return labels, vertices


class _Places(NamedTuple):
    """Where landmarks of a mesh may be."""

    mesh: Mesh
    vertices: IntArray  # those of its surface
    tree: cKDTree  # of their positions
    size: float  # of the mesh


def _places(mesh: Mesh) -> _Places:
    used = used_vertices(mesh)
    there = np.flatnonzero(np.isfinite(used).all(axis=1))
    if not len(there):
        raise InputError(f"{mesh.name} has no vertices to be landmarks")
    size = float(np.linalg.norm(np.ptp(used[there], axis=0)))
    return _Places(mesh, there, cKDTree(used[there]), size)


def _off(points: FloatArray, around: _Places) -> float:
    """Mean distance of points from a mesh, as a share of its size."""
    return float(around.tree.query(points)[0].mean()) / (around.size or 1.0)


def _read(
    path: Path, around: _Places, *, alone: bool = False
) -> tuple[list[str], IntArray, FloatArray]:
    """Read landmarks as :func:`read_markups` does, and where they are in the file.

    One without a position is left out only if the file is `alone`: it may pair by order.
    """
    data, suffix = read_bytes(path, (*landmarks.SUFFIXES, *landmarks.TABLES)), path.suffix.lower()
    mesh, there, tree, size = around
    labels, places, vertices, away, n_moved = [], [], [], [], 0
    with prefixed(path.name):
        points = landmarks.read(data, suffix, mesh.vertices)
        for i, (given, description, position) in enumerate(points):
            label = given or f"{i + 1}"
            number = re.fullmatch(r"vertex (\d{1,18})", description)
            described = int(number[1]) if number else -1
            if described >= mesh.n_vertices:
                raise FileError(
                    f"point {label!r} is {description}, but {mesh.name} has "
                    f"{plural(mesh.n_vertices, 'vertex')}"
                )
            if not np.isfinite(position).all():
                if not (alone and given):
                    raise FileError(f"point {label!r} has no position: place it, or delete it")
                warn(f"{path.name}: point {label!r} has no position: left out")
                continue
            distance, nearest = tree.query(position)
            moved = math.dist(mesh.vertices[described], position)
            if described >= 0 and moved <= _MOVED * size:
                vertex = described
            elif nearest == len(there) or distance > _FARTHEST * size:  # none, if it overflows
                raise FileError(
                    f"point {label!r} is {distance:.3g} from {mesh.name}, more than 3 % of its "
                    "size: is it of another mesh, unit or axes (RAS or LPS)?"
                )
            else:
                vertex = int(there[nearest])
            labels.append(given)
            places.append(position)
            vertices.append(vertex)
            away.append(distance)
            n_moved += described not in (-1, vertex)
        if not places:
            raise FileError("holds no points")
        on_file = np.array(places)
        off, turned = np.mean(away), tree.query(on_file * (-1, -1, 1))[0].mean()
        if turned < off / _CLOSER and off > _MOVED * size:
            raise FileError(
                f"its points are {off:.3g} from {mesh.name}, {turned:.3g} with x and y negated: "
                "one of them is in RAS and the other in LPS; save the mesh in LPS"
            )
    first = np.unique(vertices, return_index=True)[1]
    shared = len(np.unique(on_file, axis=0)) - len(first)
    if shared > 0:
        names = ", ".join(one for i, one in enumerate(labels) if one and i not in first)
        which = plural(shared, "point") + (f" ({names})" if names else "")
        warn(
            f"{path.name}: {which} at the same vertex of {mesh.name} as another one: is the mesh "
            "too coarse, or in another unit?"
        )
    if n_moved:
        warn(
            f"{path.name}: {plural(n_moved, 'point')} not at the vertices they are described as: "
            "taken where they lie"
        )
    return labels, np.array(vertices, dtype=np.int64), on_file


def read_markup_pairs(
    paths: Sequence[StrPath], source: MeshLike, target: MeshLike
) -> tuple[list[str], IntArray]:
    """Read landmarks from a file for each of two meshes: labels of the first, and vertices (l, 2).

    Points are paired by label, in any case, if the files have labels in common, and left out with a
    warning if only one has theirs; by number if all that differs is what stands before it, as in
    F-1 and P-1; otherwise, or if the labels of both are the same in the same order, by order, with
    a warning if there are names or the numbers are not in order.

    Raises FileError if a file cannot be read, or the files fit the meshes far better the other way
    round; InputError if their points do not pair.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend.datasets import make_sphere
    >>> from unbend.io import read_markup_pairs, write_markups
    >>> ball, folder = make_sphere(2), Path(tempfile.mkdtemp())
    >>> write_markups(folder / "a.mrk.json", ball, [7, 100], ["nose", "ear"])
    >>> write_markups(folder / "b.mrk.json", ball, [90, 8], ["ear", "nose"])
    >>> read_markup_pairs([folder / "a.mrk.json", folder / "b.mrk.json"], ball, ball)
    (['nose', 'ear'], array([[  7,   8],
           [100,  90]]))
    """
    paths = listed(paths, "landmarks of two meshes")
    if len(paths) != 2:
        raise InputError(f"landmarks of two meshes need two files, not {len(paths)}")
    a, b = _places(as_mesh(source, "source")), _places(as_mesh(target, "target"))
    labels, first, on_a = _read(as_path(paths[0]), a)
    others, second, on_b = _read(as_path(paths[1]), b)
    off = _off(on_a, a) + _off(on_b, b)
    if off > _MOVED and _off(on_a, b) + _off(on_b, a) < off / _CLOSER_TO_OTHER:
        raise FileError(
            f"{paths[0]} fits {b.mesh.name} and {paths[1]} fits {a.mesh.name}: give the files of "
            "landmarks the other way round"
        )
    keys, its = labels, others
    if set(labels) != set(others):
        keys, its = ([label.strip().casefold() for label in one] for one in (labels, others))
    numbers, its_numbers = _numbers(keys), _numbers(its)
    if numbers and set(numbers) == set(its_numbers) and not set(keys) & set(its):
        keys, its = numbers, its_numbers
    in_common = bool(set(keys) & set(its) - {""})
    counted = [[int(one) for one in some] for some in (numbers, its_numbers)]
    starts = [min(one) for one in counted if one and max(one) - min(one) == len(one) - 1]
    if in_common and len(first) == len(second) and {*starts} == {0, 1}:
        raise InputError(
            f"{paths[0]} numbers its points from {starts[0]}, {paths[1]} from {starts[1]}: number "
            "them alike"
        )
    if in_common and labels != others:
        for key, label in zip((*keys, *its), (*labels, *others), strict=True):
            if keys.count(key) > 1 or its.count(key) > 1:
                raise InputError(f"{paths[0]} and {paths[1]} do not both have one point {label!r}")
            if key not in keys or key not in its:
                warn(f"only one of {paths[0]} and {paths[1]} has a point {label!r}: left out")
        rows = [i for i, key in enumerate(keys) if key in its]
        labels = [labels[i] for i in rows]
        first, second = first[rows], second[[its.index(keys[i]) for i in rows]]
    if len(first) != len(second):
        raise InputError(
            f"{paths[0]} has {plural(len(first), 'point')}, {paths[1]} {len(second):,}: they must "
            "be pairs"
        )
    if not in_common and not all(one and one == sorted(one) for one in counted):
        warn(f"{paths[0]} and {paths[1]} have no label in common: points are paired by order")
    return labels, np.column_stack([first, second])


def _numbers(labels: list[str]) -> list[str]:
    """Numbers of points that no one has named: Slicer calls them F-1 or the like. Else, none."""
    if not any(labels):
        return [str(i) for i in range(len(labels))]
    found = [re.fullmatch(r"(.*-|)0*([0-9]{1,18})", label) for label in labels]
    numbers = [one[2] for one in found if one]
    alike = len({one[1] for one in found if one}) == 1 and len(set(numbers)) == len(labels)
    return numbers if alike else []


def write_markups(
    path: StrPath, mesh: MeshLike, vertices: npt.ArrayLike, labels: Sequence[str]
) -> None:
    """Write vertices of a mesh as landmarks for 3D Slicer, a .mrk.json file.

    Raises InputError for a vertex that the mesh lacks, or another number of labels.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend.datasets import make_sphere
    >>> from unbend.io import read_markups, write_markups
    >>> path = Path(tempfile.mkdtemp()) / "ball.mrk.json"
    >>> write_markups(path, make_sphere(2), [7, 100], ["nose", "ear"])
    >>> read_markups(path, make_sphere(2))
    (['nose', 'ear'], array([  7, 100]))
    """
    path, mesh = check_writable(path, (".json",)), as_mesh(mesh)
    vertices = vertex_ids(vertices, mesh.n_vertices, mesh.name)
    labels = listed(labels, "labels")
    if not all(isinstance(label, str) for label in labels):
        raise InputError(f"{mesh.name}: labels of landmarks must be a list of text")
    if len(labels) != len(vertices):
        raise InputError(
            f"{mesh.name}: {len(vertices)} landmarks need as many labels, not {len(labels)}"
        )
    points = [
        {
            "id": str(i + 1),
            "label": label,
            "description": f"vertex {vertex}",
            "position": mesh.vertices[vertex].tolist(),
        }
        for i, (vertex, label) in enumerate(zip(vertices, labels, strict=True))
    ]
    markup = {"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": points}
    with atomic_write(path) as file:
        file.write(json.dumps({"@schema": _SCHEMA, "markups": [markup]}, indent=1).encode())
