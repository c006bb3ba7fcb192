"""Landmarks of 3D Slicer: points with labels, in .mrk.json and .fcsv files."""

from __future__ import annotations

import csv
import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from unbend._text import plural
from unbend._types import IntArray
from unbend.errors import FileError, InputError
from unbend.io._files import atomic_write, check_writable, named, read_bytes
from unbend.io._meshes import as_mesh
from unbend.io._objects import MeshLike
from unbend.io.formats.contents import text_lines
from unbend.mesh import used_vertices

MARKUP_SUFFIXES = (".json", ".fcsv")
_FARTHEST = 0.03  # of the diagonal of the mesh's bounding box
_SCHEMA = (
    "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/"
    "Resources/Schema/markups-schema-v1.0.3.json#"
)
# Slicer's older files have numbers for their axes.
_FLIPS = {"LPS": 1, "RAS": -1, "1": 1, "0": -1}


def read_markups(path: str | os.PathLike[str], mesh: MeshLike) -> tuple[list[str], IntArray]:
    """Read landmarks that 3D Slicer or unbend placed on a mesh.

    Parameters
    ----------
    path : path
        A .mrk.json or .fcsv file. A point described as ``vertex 123`` is that vertex; any other is
        moved to the nearest vertex. Points in RAS are turned to LPS, in which Slicer writes meshes.
    mesh : mesh-like
        The mesh with the points on it.

    Returns
    -------
    labels : list of str
    vertices : (l,) ndarray of int64

    Raises
    ------
    FileError
        If the file cannot be read, or a point is farther from the mesh than 3 % of its size.
    """
    path, mesh = Path(path), as_mesh(mesh)
    data = read_bytes(path, MARKUP_SUFFIXES)
    used = used_vertices(mesh)
    there = np.flatnonzero(np.isfinite(used).all(axis=1))
    tree = cKDTree(used[there])
    farthest = _FARTHEST * np.linalg.norm(np.ptp(used[there], axis=0))
    labels, vertices = [], []
    with named(path):
        points = _fcsv(data) if path.suffix.lower() == ".fcsv" else _mrk_json(data)
        for label, description, position in points:
            number = re.fullmatch(r"vertex (\d{1,18})", description)
            if number:
                vertex = int(number[1])
                if vertex >= mesh.n_vertices:
                    raise FileError(
                        f"point {label!r} is vertex {vertex}, but {mesh.name} has "
                        f"{plural(mesh.n_vertices, 'vertex')}"
                    )
            else:
                if not np.isfinite(position).all():
                    raise FileError(f"point {label!r} has no position")
                distance, nearest = tree.query(position)
                if distance > farthest:
                    raise FileError(
                        f"point {label!r} is {distance:.3g} from {mesh.name}, more than 3 % of its "
                        "size: is it of another mesh, unit or axes (RAS or LPS)?"
                    )
                vertex = int(there[nearest])
            labels.append(label)
            vertices.append(vertex)
    if not labels:
        raise FileError(f"{path.name}: holds no points")
    return labels, np.array(vertices, dtype=np.int64)


def read_markup_pairs(
    paths: Sequence[str | os.PathLike[str]], source: MeshLike, target: MeshLike
) -> IntArray:
    """Read landmarks (l, 2) from a file for each of two meshes.

    Points are paired by label if both files have the same labels; otherwise by order.

    Raises FileError if a file cannot be read; InputError if their points do not pair.
    """
    (labels, first), (others, second) = (
        read_markups(path, mesh) for path, mesh in zip(paths, (source, target), strict=True)
    )
    if set(labels) & set(others) and len(set(labels)) == len(labels):
        for label in (*labels, *others):
            if label not in others or label not in labels or others.count(label) > 1:
                raise InputError(f"{paths[0]} and {paths[1]} do not both have one point {label!r}")
        second = second[[others.index(label) for label in labels]]
    if len(first) != len(second):
        raise InputError(
            f"{paths[0]} has {plural(len(first), 'point')}, {paths[1]} {len(second)}: they must be "
            "pairs"
        )
    return np.column_stack([first, second])


def write_markups(
    path: str | os.PathLike[str], mesh: MeshLike, vertices: npt.ArrayLike, labels: Sequence[str]
) -> None:
    """Write vertices of a mesh as landmarks for 3D Slicer, a .mrk.json file.

    See :func:`read_markups` for the reverse.
    """
    path, mesh = check_writable(path, (".json",)), as_mesh(mesh)
    points = [
        {
            "id": str(i + 1),
            "label": label,
            "description": f"vertex {vertex}",
            "position": mesh.vertices[vertex].tolist(),
        }
        for i, (vertex, label) in enumerate(zip(np.asarray(vertices), labels, strict=True))
    ]
    markup = {"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": points}
    with atomic_write(path) as file:
        file.write(json.dumps({"@schema": _SCHEMA, "markups": [markup]}, indent=1).encode())


_Point = tuple[str, str, npt.NDArray[np.float64]]


def _mrk_json(data: bytes) -> list[_Point]:
    try:
        document = json.loads(data)
        return [
            _point(
                point.get("label", ""),
                point.get("description", ""),
                point["position"] if point.get("positionStatus") != "undefined" else [np.nan] * 3,
                markup.get("coordinateSystem", "LPS"),
            )
            for markup in document["markups"]
            for point in markup["controlPoints"]
        ]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise FileError("not a .mrk.json file of 3D Slicer, or a damaged one") from error


def _fcsv(data: bytes) -> list[_Point]:
    lines = text_lines(data, "FCSV")
    axes = [line.partition("=")[2].strip() for line in lines if "CoordinateSystem" in line]
    columns = ["id", "x", "y", "z", "ow", "ox", "oy", "oz", "vis", "sel", "lock", "label", "desc"]
    for line in lines:
        if line.startswith("# columns"):
            columns = line.partition("=")[2].strip().split(",")
    try:
        return [
            _point(
                row["label"] or "",
                row.get("desc") or "",
                [row[axis] for axis in "xyz"],
                axes[0] if axes else "RAS",
            )
            for row in csv.DictReader(
                (line for line in lines if line and not line.startswith("#")), columns
            )
        ]
    except (ValueError, KeyError, TypeError, csv.Error) as error:
        raise FileError("not an .fcsv file of 3D Slicer, or a damaged one") from error


def _point(label: Any, description: Any, position: Any, axes: Any) -> _Point:
    flip = _FLIPS[axes]
    place = np.array([float(x) for x in position]) * (flip, flip, 1)
    if place.shape != (3,):
        raise ValueError("a position is three numbers")
    return str(label), str(description).strip(), place
