"""Surfaces that deform as rigidly as possible."""

from unbend.deformation._kernels import edge_squares, normals_into, scatter
from unbend.deformation._projection import closest_faces, walk
from unbend.deformation._surface import TURNING, ElasticSurface, cached

__all__ = [
    "TURNING",
    "ElasticSurface",
    "cached",
    "closest_faces",
    "edge_squares",
    "normals_into",
    "scatter",
    "walk",
]
