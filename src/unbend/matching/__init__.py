"""Matching two deformable shapes, and one with its own mirror image."""

from unbend.matching._archive import (
    read_functional_map,
    read_match,
    write_functional_map,
    write_match,
)
from unbend.matching._decimation import decimate
from unbend.matching._kernels import (
    edge_covariances,
    rotated_divergence,
    scatter,
    turn_rotations,
    walk,
)
from unbend.matching._match import match, prepare_spectrum, symmetry
from unbend.matching._projection import closest_faces
from unbend.matching._quality import warn_of_disorder
from unbend.matching._result import Hypothesis, Match
from unbend.matching._shape import Shape

__all__ = [
    "Hypothesis",
    "Match",
    "Shape",
    "closest_faces",
    "decimate",
    "edge_covariances",
    "match",
    "prepare_spectrum",
    "read_functional_map",
    "read_match",
    "rotated_divergence",
    "scatter",
    "symmetry",
    "turn_rotations",
    "walk",
    "warn_of_disorder",
    "write_functional_map",
    "write_match",
]
