"""Numbers and labels as colours, for programs that show nothing else of a vertex."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from unbend._arrays import array_of, check_choice, numbers_of
from unbend.errors import InputError

# Viridis of matplotlib, at every sixteenth.
_VIRIDIS = np.array(
    [
        (68, 1, 84), (72, 24, 106), (71, 45, 123), (66, 64, 134), (59, 82, 139),
        (51, 99, 141), (44, 114, 142), (38, 130, 142), (33, 145, 140), (31, 160, 136),
        (40, 174, 128), (63, 188, 115), (94, 201, 98), (132, 212, 75), (173, 220, 48),
        (216, 226, 25), (253, 231, 37),
    ]
)  # fmt: skip
# RdBu of ColorBrewer (Harrower and Brewer 2003), at every tenth, blue first.
_BLUE_TO_RED = np.array(
    [
        (5, 48, 97), (33, 102, 172), (67, 147, 195), (146, 197, 222), (209, 229, 240),
        (247, 247, 247), (253, 219, 199), (244, 165, 130), (214, 96, 77), (178, 24, 43),
        (103, 0, 31),
    ]
)  # fmt: skip
_OTHER_SIGN = 0.05  # of the greatest size, from which numbers of the other sign are no noise
# Okabe and Ito, "Color universal design", 2008, without black.
_SEVEN = np.array(
    [
        (0, 114, 178), (230, 159, 0), (0, 158, 115), (204, 121, 167), (86, 180, 233), (213, 94, 0),
        (240, 228, 66),
    ],
    dtype=np.uint8,
)  # fmt: skip
_LABELS = np.concatenate([_SEVEN, _SEVEN // 2])
_GREY = 153


def value_colors(
    values: npt.ArrayLike, *, kind: str = "scalar", limits: tuple[float, float] | None = None
) -> npt.NDArray[np.uint8]:
    """Turn values per vertex into colours (n, 3) of uint8 that colour-blind eyes tell apart, too.

    Numbers (n,) go from dark blue to yellow, from the least to the greatest or between `limits`;
    those of :func:`both_signs` go from blue (negative) over white (0) to red, without limits.
    Each label has a colour, in its turn of seven and the same darker; of weights (n, k) each vertex
    has that of its largest. Grey stands for numbers that are not finite, and for the labels -1, NaN
    and "". Raises InputError for another `kind`, and for several numbers of each vertex.
    """
    check_choice(kind, "kind", ("scalar", "label", "weights"))
    array = array_of(values, "values")
    known = None
    if kind == "weights":
        weights = numbers_of(array, "values").reshape(len(array), -1)
        known, kind = np.arange(weights.shape[1]), "label"
        array = np.where(np.isfinite(weights).all(axis=1), weights.argmax(axis=1), -1)
    if array.ndim == 2 and array.shape[1] == 1:
        array = array[:, 0]
    if array.ndim != 1:
        raise InputError(
            f"{array.shape[1]} numbers for each vertex have no colour: write one column, or .ply"
        )
    if kind == "label":
        unknown = array == "" if array.dtype.kind == "U" else (array == -1) | np.isnan(array)
        known = np.unique(array[~unknown]) if known is None else known
        of_labels: npt.NDArray[np.uint8] = _LABELS[np.searchsorted(known, array) % len(_LABELS)]
        of_labels[unknown] = _GREY
        return of_labels
    numbers = numbers_of(array, "values")
    finite = np.isfinite(numbers)
    shown = numbers[finite] if finite.any() else np.zeros(1)
    low, high = limits or scale_limits(shown.min(), shown.max())
    scale = _BLUE_TO_RED if limits is None and both_signs(low, high) else _VIRIDIS
    shares = (np.where(finite, numbers, low) - low) / max(high - low, 1e-300)
    marks = np.linspace(0, 1, len(scale))
    colors = np.stack([np.interp(shares, marks, one) for one in scale.T], axis=1)
    colors[~finite] = _GREY
    return np.asarray(np.rint(colors), dtype=np.uint8)


def both_signs(low: float, high: float) -> bool:
    """Whether numbers between these are negative and positive, such as growth and loss."""
    return min(-low, high) > _OTHER_SIGN * max(-low, high)


def scale_limits(low: float, high: float) -> tuple[float, float]:
    """Choose the ends of the scale for such numbers: equally far from 0 if of both signs."""
    most = max(-low, high)
    return (-most, most) if both_signs(low, high) else (low, high)
