"""Distances on a surface: biharmonic, commute-time, diffusion, geodesic."""

from unbend.distances._distance import distance, make_metric
from unbend.distances._geodesic import geodesic_solver
from unbend.distances._gram import SPECTRAL, gram_metric, spectral_filter, truncated_metric
from unbend.distances._metric import (
    GEODESIC,
    Metric,
    diffusion_time,
    length_power,
    refuse_of_geodesics,
)

__all__ = [
    "GEODESIC",
    "SPECTRAL",
    "Metric",
    "diffusion_time",
    "distance",
    "geodesic_solver",
    "gram_metric",
    "length_power",
    "make_metric",
    "refuse_of_geodesics",
    "spectral_filter",
    "truncated_metric",
]
