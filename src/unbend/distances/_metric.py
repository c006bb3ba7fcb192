"""What every distance on a surface offers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import get_args

from unbend._types import FloatArray, IntArray
from unbend.choices import DistanceKind
from unbend.errors import InputError


@dataclass(frozen=True, eq=False)
class Metric:
    """One distance on one surface of unit area.

    Attributes
    ----------
    from_sources : callable
        Vertex ids (s,) to the distances from each of them to all vertices (s, n).
    between : callable
        Vertex ids (p,) to the distances between all of them (p, p).
    gram : callable or None
        Where the distance is ``d_ij^2 = g_ii + g_jj - 2 g_ij``: the product with g,
        (n, r) to (n, r).
    """

    from_sources: Callable[[IntArray], FloatArray]
    between: Callable[[IntArray], FloatArray]
    gram: Callable[[FloatArray], FloatArray] | None = None


def length_power(kind: str) -> int:
    """Power of a length that the distance is measured in: scaling a mesh by s scales it by s^p."""
    return {"commute-time": 0, "diffusion": -1}.get(kind, 1)


def check_kind(kind: str) -> None:
    """Refuse a name that is no distance."""
    if kind not in get_args(DistanceKind):
        names = ", ".join(get_args(DistanceKind))
        raise InputError(f"there is no distance {kind!r}; choose one of {names}")
