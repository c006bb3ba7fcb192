"""Matching two deformable shapes, and one with its own mirror image."""

from unbend.matching._match import Hypothesis, Match, match, symmetry

__all__ = ["Hypothesis", "Match", "match", "symmetry"]
