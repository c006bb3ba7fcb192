"""Distances on a surface: biharmonic, commute-time, diffusion, geodesic."""

from unbend.distances._distance import (
    GEODESIC,
    diffusion_time,
    distance,
    length_power,
    make_metric,
)
from unbend.distances._geodesic import geodesic_solver
from unbend.distances._gram import Metric, spectral_filter, truncated_metric

__all__ = [
    "GEODESIC",
    "Metric",
    "diffusion_time",
    "distance",
    "geodesic_solver",
    "length_power",
    "make_metric",
    "spectral_filter",
    "truncated_metric",
]
