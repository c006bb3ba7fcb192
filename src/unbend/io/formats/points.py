"""Point clouds: XYZ text and NumPy arrays."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from unbend._types import FloatArray, IntArray
from unbend.errors import FileError
from unbend.io.formats.contents import NO_FACES, Contents, data_lines, misfit, positions
from unbend.io.formats.contents import table as write_table
from unbend.io.formats.npy import read_array

_NO_CHANCE = 10  # points whose first numbers are one more each


def read_xyz(data: bytes) -> Contents:
    """Read one point per line, its numbers separated by spaces, commas or semicolons."""
    lines = data_lines(data, "XYZ")
    if not lines:
        raise FileError("holds no points")
    rows = []
    for index, line in enumerate(lines):
        words = line.replace(";", " ").split()
        if len(words) > 1 and any("," in word.strip(",") for word in words):
            problem = ", whose commas may be decimal ones; write decimal points"
            raise misfit(f"point {index}", line.strip(), problem)
        rows.append(" ".join(words).replace(",", " ").split())
    widths = {len(row) for row in rows}
    notes = _left_out(max(widths))
    points = positions(rows, "point")
    counted = np.arange(len(points)) + points[0, 0]
    if notes and len(points) >= _NO_CHANCE and (points[:, 0] == counted).all():
        raise FileError("its first column numbers the points; leave it out")
    return Contents(points, NO_FACES, notes)


def _left_out(n_columns: int) -> tuple[str, ...]:
    return ("columns after the third left out",) if n_columns > 3 else ()


def read_npy(data: bytes) -> Contents:
    """Read an (n, 3) array of numbers, or one with normals or colours after; never a pickle."""
    points = read_array(data)
    if points.ndim != 2 or points.shape[1] < 3 or points.dtype.kind not in "fiu":
        raise FileError(
            f"holds an array of shape {points.shape} and type {points.dtype}, not (n, 3) numbers"
        )
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused later
        return Contents(points[:, :3].astype(np.float64), NO_FACES, _left_out(points.shape[1]))


def write_xyz(file: BinaryIO, vertices: FloatArray, faces: IntArray) -> None:
    """Write one point per line."""
    file.write(write_table(vertices))
