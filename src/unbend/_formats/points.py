"""Point clouds: XYZ text and NumPy arrays."""

from __future__ import annotations

import io
from typing import BinaryIO

import numpy as np

from unbend._formats import NO_FACES, Contents, data_lines, positions
from unbend._formats import table as write_table
from unbend.errors import FileError
from unbend.mesh import Mesh


def read_xyz(data: bytes) -> Contents:
    """Read one point per line, its numbers separated by spaces, commas or semicolons."""
    lines = data_lines(data, "XYZ")
    if not lines:
        raise FileError("holds no points")
    rows = [line.replace(",", " ").replace(";", " ").split() for line in lines]
    widths = {len(row) for row in rows}
    notes = ("columns after the third left out",) if max(widths) > 3 else ()
    return Contents(positions(rows, "point"), NO_FACES, notes)


def read_npy(data: bytes) -> Contents:
    """Read an (n, 3) array of numbers; never a pickle."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        header = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        shape, fortran_order, dtype = header(stream)
    except Exception as error:  # NumPy parses the header as Python: any error may come of it
        raise FileError("not a NumPy array file, or a damaged one") from error
    if len(shape) != 2 or shape[1] != 3 or dtype.kind not in "fiu":
        raise FileError(f"holds an array of shape {shape} and type {dtype}, not (n, 3) numbers")
    n_bytes = shape[0] * 3 * dtype.itemsize
    if shape[0] < 0 or n_bytes > len(data) - stream.tell():
        raise FileError(
            f"truncated: it promises {shape[0]} points, {n_bytes} bytes, "
            f"but {len(data) - stream.tell()} bytes follow"
        )
    values = np.frombuffer(data, dtype=dtype, count=shape[0] * 3, offset=stream.tell())
    points = values.reshape(shape, order="F" if fortran_order else "C")
    return Contents(points.astype(np.float64), NO_FACES)


def write_xyz(file: BinaryIO, mesh: Mesh) -> None:
    """Write one point per line."""
    file.write(write_table(mesh.vertices))
