"""Matching two deformable shapes, and one with its own mirror image."""

from unbend.matching._inputs import wider_component
from unbend.matching._landmarks import landmark_pairs
from unbend.matching._match import check_partial, match, prepare_spectrum, symmetry
from unbend.matching._result import Hypothesis, Match, faults_of, warn_of_faults

__all__ = [
    "Hypothesis",
    "Match",
    "check_partial",
    "faults_of",
    "landmark_pairs",
    "match",
    "prepare_spectrum",
    "symmetry",
    "warn_of_faults",
    "wider_component",
]
