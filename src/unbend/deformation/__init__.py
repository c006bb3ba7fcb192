"""Surfaces that deform as rigidly as possible."""

from unbend.deformation._kernels import edge_squares, normals_into, over_rows, scatter
from unbend.deformation._surface import TURNING, ElasticSurface, cached

__all__ = [
    "TURNING",
    "ElasticSurface",
    "cached",
    "edge_squares",
    "normals_into",
    "over_rows",
    "scatter",
]
