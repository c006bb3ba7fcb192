"""What every distance on a surface offers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import get_args

from unbend._arrays import is_number
from unbend._types import FloatArray, IntArray
from unbend.choices import DIFFUSION_TIME, DistanceKind
from unbend.errors import InputError

GEODESIC = ("geodesic", "geodesic-exact")


@dataclass(frozen=True, eq=False)
class Metric:
    """One distance on one surface of unit area.

    `gram` gives products with g, (n, r), where the distance is ``d_ij^2 = g_ii + g_jj - 2 g_ij``.
    """

    from_sources: Callable[[IntArray], FloatArray]  # (s,) to (s, n): to all vertices
    between: Callable[[IntArray], FloatArray]  # (p,) to (p, p)
    gram: Callable[[FloatArray], FloatArray] | None = None


def length_power(kind: str) -> int:
    """Power of a length that the distance is measured in: scaling a mesh by s scales it by s^p."""
    return {"commute-time": 0, "diffusion": -1}.get(kind, 1)


def refuse_of_geodesics(kind: str, **options: bool) -> None:
    """Refuse options, by whether they were given, that only spectral distances can use."""
    for name, given in options.items():
        if kind in GEODESIC and given:
            raise InputError(f"{name} is for spectral distances, not {kind} ones; leave it out")


def diffusion_time(kind: str, time: float | None) -> float:
    """Take the default for a diffusion time that was not given.

    Refuses a name that is no distance, and a time that is not used or not positive.
    """
    names = get_args(DistanceKind)
    if kind not in names:
        raise InputError(f"there is no distance {kind!r}; choose one of {', '.join(names)}")
    if kind != "diffusion" and time is not None:
        raise InputError(f"time is for diffusion distances, not {kind} ones; leave it out")
    if time is None:
        return DIFFUSION_TIME
    if not is_number(time) or not 0 < time < math.inf:
        raise InputError(f"the diffusion time must be positive, not {time!r}")
    return time
