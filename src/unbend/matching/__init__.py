"""Matching two deformable shapes, and one with its own mirror image."""

from unbend.matching._archive import (
    read_functional_map,
    read_match,
    write_functional_map,
    write_match,
)
from unbend.matching._kernels import closest_faces, walk
from unbend.matching._match import match, prepare_spectrum, symmetry
from unbend.matching._result import Hypothesis, Match, warn_of_disorder

__all__ = [
    "Hypothesis",
    "Match",
    "closest_faces",
    "match",
    "prepare_spectrum",
    "read_functional_map",
    "read_match",
    "symmetry",
    "walk",
    "warn_of_disorder",
    "write_functional_map",
    "write_match",
]
