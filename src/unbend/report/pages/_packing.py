"""Arrays as short text within a page, which ``data.js`` unpacks.

Each number is stored as the difference from the one before; bytes of equal weight are compressed.
"""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np

from unbend._types import FloatArray, IntArray

# Positions are exact to 2^-14 of the longest side, a fraction of a pixel on any screen.
_STEPS = 2**14


def pack_whole(numbers: IntArray) -> dict[str, Any]:
    """Pack whole numbers (n,) or (n, c) whose differences down the columns fit into 32 bits.

    The dictionary is for JSON: ``columns``, ``planes`` (bytes of a number) and ``data``.
    """
    table = numbers.reshape(len(numbers), -1).astype(np.int64)
    steps = np.diff(table, axis=0, prepend=0)
    folded = np.where(steps < 0, -2 * steps - 1, 2 * steps).astype("<u4")
    planes = max(1, -(-int(folded.max(initial=0)).bit_length() // 8))
    columns = np.ascontiguousarray(folded.T).view(np.uint8).reshape(table.shape[1], -1, 4)
    data = np.ascontiguousarray(columns[:, :, :planes].transpose(0, 2, 1)).tobytes()
    packed = base64.b64encode(zlib.compress(data, 9)).decode("ascii")
    return {"columns": table.shape[1], "planes": planes, "data": packed}


def pack_places(places: FloatArray, step: float | None = None) -> dict[str, Any]:
    """Pack real numbers (n, c), rounded to a whole number of steps above each column's lowest.

    The step is by default a 16,384th of the widest column's range. Rows that are not finite become
    the lowest of the others. Adds ``low`` and ``step`` to what :func:`pack_whole` returns.
    """
    finite = np.asarray(np.isfinite(places).all(axis=1))
    low = places[finite].min(axis=0) if finite.any() else np.zeros(places.shape[1])
    above = np.where(finite[:, None], places - low, 0.0)
    step = step or max(float(above.max(initial=0)), 1e-300) / _STEPS
    whole = np.rint(above / step).astype(np.int64)
    return pack_whole(whole) | {"low": low.tolist(), "step": step}
