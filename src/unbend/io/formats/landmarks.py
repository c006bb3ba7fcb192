"""Files of landmarks: 3D Slicer's and MeshLab's, and tables of x, y, z."""

from __future__ import annotations

import csv
import json
import re
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from unbend._types import FloatArray
from unbend.errors import FileError
from unbend.io.formats.contents import are_numbers, data_lines, misfit, text_lines

SUFFIXES = (".json", ".fcsv", ".pp")
TABLES = (".csv", ".txt", ".pts")
LABELS = ("label", "name", "landmark")
# Slicer's older files have numbers for their axes.
_FLIPS = {"LPS": 1, "RAS": -1, "1": 1, "0": -1}

Point = tuple[str, str, npt.NDArray[np.float64]]  # label, description, position


def read(data: bytes, suffix: str, vertices: FloatArray) -> list[Point]:
    """Read points in LPS, with positions of NaN where there is none.

    ``vertices`` are those of the mesh, which tables may number.
    """
    try:
        if suffix in TABLES:
            return _table(data, suffix, vertices)
        return {".json": _mrk_json, ".fcsv": _fcsv, ".pp": _pp}[suffix](data)
    except FileError:
        raise
    except Exception as error:  # JSON or XML of another structure raises many kinds
        program = "MeshLab" if suffix == ".pp" else "3D Slicer"
        raise FileError(f"not a landmark file of {program}, or a damaged one") from error


def _mrk_json(data: bytes) -> list[Point]:
    return [
        _point(
            point.get("label", ""),
            point.get("description", ""),
            point["position"]
            if point.get("positionStatus", "defined") == "defined"
            else [np.nan] * 3,
            markup.get("coordinateSystem", "LPS"),
        )
        for markup in json.loads(data)["markups"]
        for point in markup["controlPoints"]
    ]


def _fcsv(data: bytes) -> list[Point]:
    """Rows of id, x, y, z, four numbers of a rotation, three switches, label and description.

    Newer ones end in a node, whether there is a position (2) or none yet, and another switch.
    """
    lines = text_lines(data, "FCSV")
    axes = [line.partition("=")[2].strip() for line in lines if "CoordinateSystem" in line]
    rows = csv.reader((line for line in lines if line and not line.startswith("#")), strict=True)
    return [
        _point(
            row[11],
            row[12],
            row[1:4] if row[14:15] in ([], [""], ["2"]) else [np.nan] * 3,
            axes[0] if axes else "RAS",
        )
        for row in rows
    ]


def _pp(data: bytes) -> list[Point]:
    """Elements with a name, x, y, z, and active="0" where a point has not been placed."""
    points = ElementTree.fromstring("\n".join(text_lines(data, "PP"))).iter("point")
    return [
        _point(one.get("name", ""), "", [one.attrib[axis] for axis in "xyz"], "LPS")
        for one in points
        if one.get("active") != "0"
    ]


def _table(data: bytes, suffix: str, vertices: FloatArray) -> list[Point]:
    """Rows of x, y, z, perhaps after a label, or columns of these names; IDAV's .pts likewise.

    Tables of 3D Slicer name their axes l, p, s or r, a, s, and say in a column whether a point is
    defined. Or columns label and vertex, as the page of unbend view saves landmarks of one mesh.
    """
    lines = _csv_lines(data) if suffix == ".csv" else data_lines(data, suffix[1:])
    if suffix == ".pts" and lines and re.match(r"version", lines[0], re.IGNORECASE):
        lines = lines[2:]  # how many there are
    between = next((mark for mark in ";\t," if lines and mark in lines[0]), " ")
    if between == " ":
        lines = [" ".join(line.split()) for line in lines]
    cells = csv.reader(lines, delimiter=between, skipinitialspace=True, strict=True)
    try:
        rows = [[word.strip() for word in row] for row in cells]
    except csv.Error as error:
        raise FileError(f"not a table: {error}") from None
    names = [name.lower() for name in rows[0]] if rows else []
    label = next((i for i, name in enumerate(names) if name in LABELS), 0)
    if "vertex" in names and "x" not in names and names[label] in LABELS:
        number = names.index("vertex")
        for i, row in enumerate(rows[1:]):
            if len(row) != len(names) or not re.fullmatch(r"\d{1,18}", row[number]):
                meant = "a label and the number of a vertex"
                raise misfit(f"row {i}", between.join(row), f"; a landmark is {meant}")
        places = np.vstack([vertices, np.full(3, np.nan)])  # the last of numbers that are too high
        return [
            (row[label], f"vertex {row[number]}", places[min(int(row[number]), len(vertices))])
            for row in rows[1:]
        ]
    at, first = [-3, -2, -1], 0
    axes = next((axes for axes in ("xyz", "lps", "ras") if {*axes} <= {*names}), "")
    if axes:
        at, first = [names.index(axis) for axis in axes], 1
    labelled = len(names) > 3 and label not in at
    points = []
    for i, row in enumerate(rows[first:]):
        of_row = len(row) == len(names) and (first or len(row) in (3, 4))
        place = ["nan" if row[k] == "NA" else row[k] for k in at] if of_row else []  # NA: R's
        if not of_row or not are_numbers(place):
            meant = "x, y and z with decimal points, perhaps after a label, or below these names"
            raise misfit(f"row {i}", between.join(row), f"; a point is {meant}")
        if "defined" in names and row[names.index("defined")] == "0":
            place = ["nan"] * 3
        turned = "RAS" if axes == "ras" else "LPS"
        points.append(_point(row[label] if labelled else "", "", place, turned))
    return points


def _csv_lines(data: bytes) -> list[str]:
    """Lines without comments; one with as many cells as the first begins with a label."""
    lines: list[str] = []
    for line in text_lines(data, "CSV"):
        kept = re.sub(r'\s#[^"]*$', "", line)
        ends = len(re.findall(r"[;,\t]", kept))  # of cells
        first = len(re.findall(r"[;,\t]", lines[0])) if lines else ends + 1
        is_comment = kept.lstrip().startswith("#") and ends < max(first, 1)
        if kept.strip() and not is_comment:
            lines.append(kept)
    return lines


def _point(label: Any, description: Any, position: Any, axes: Any) -> Point:
    flip = _FLIPS[axes]
    x, y, z = map(float, position)
    return str(label), str(description).strip(), np.array([flip * x, flip * y, z])
