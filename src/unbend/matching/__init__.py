"""Matching two deformable shapes, and one with its own mirror image."""

from unbend.matching._match import match, symmetry
from unbend.matching._result import Hypothesis, Match

__all__ = ["Hypothesis", "Match", "match", "symmetry"]
