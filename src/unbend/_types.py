"""Types used in signatures."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

StrPath = str | os.PathLike[str]

# Called with a stage's name and the share of it that is done, from 0 to 1.
Progress = Callable[[str, float], None]

# SciPy ships no type stubs; its sparse matrices are spelled this way for the reader's sake.
SparseMatrix = Any
