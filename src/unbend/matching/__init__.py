"""Matching two deformable shapes, and one with its own mirror image."""

from unbend.matching._kernels import closest_faces, walk
from unbend.matching._match import match, prepare_spectrum, symmetry
from unbend.matching._result import Hypothesis, Match, warn_of_disorder

__all__ = [
    "Hypothesis",
    "Match",
    "closest_faces",
    "match",
    "prepare_spectrum",
    "symmetry",
    "walk",
    "warn_of_disorder",
]
