"""NumPy array files, read without trusting them: no pickles, no sizes that are not there."""

from __future__ import annotations

import io
import math
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from unbend._text import plural
from unbend.errors import FileError

# What NumPy can count, in empty arrays too.
_MOST_DIMENSIONS, _MOST_BYTES = 32, 2**62


def read_array(data: bytes) -> npt.NDArray[Any]:
    """Read an array of numbers, booleans or text; FileError if it is none, or truncated."""
    stream = io.BytesIO(data)
    shape, fortran_order, dtype = read_header(stream)
    size = math.prod(shape)
    follow = len(data) - stream.tell()
    if size * dtype.itemsize > follow:
        raise FileError(
            f"truncated: it promises {plural(shape[0] if shape else 1, 'row')}, "
            f"{size * dtype.itemsize:,} bytes, but {plural(follow, 'byte')} follow"
        )
    values = np.frombuffer(data, dtype=dtype, count=size, offset=stream.tell())
    return values.reshape(shape, order="F" if fortran_order else "C")


def write_array(file: IO[bytes], array: npt.NDArray[Any]) -> None:
    """Write an array; straight to a file, NumPy would not say why it cannot, as of a full disk."""
    stream = io.BytesIO()
    np.save(stream, array)
    file.write(stream.getbuffer())


def read_header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Read shape, column order and type of a .npy file; leave the stream at the first value."""
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
    if dtype.kind not in "biufU":
        raise FileError(f"holds an array of shape {shape} and type {dtype}, not numbers or text")
    bytes_but_for_zeros = math.prod(filter(None, shape)) * dtype.itemsize
    if (
        min(shape, default=0) < 0
        or len(shape) > _MOST_DIMENSIONS
        or not 0 < bytes_but_for_zeros < _MOST_BYTES
    ):
        raise FileError(f"promises an array of shape {shape} and type {dtype}")
    return shape, fortran_order, dtype
