"""Matching two deformable shapes, and one with its own mirror image."""

from unbend.matching._archive import (
    read_functional_map,
    read_match,
    write_functional_map,
    write_match,
)
from unbend.matching._match import match, symmetry
from unbend.matching._projection import closest_faces
from unbend.matching._result import Match

__all__ = [
    "Match",
    "closest_faces",
    "match",
    "read_functional_map",
    "read_match",
    "symmetry",
    "write_functional_map",
    "write_match",
]
