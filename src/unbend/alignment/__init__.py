"""Rigid alignment of point sets and surfaces, and their nearest neighbours."""

from unbend.alignment._alignment import (
    Alignment,
    align,
    icp,
    largest_traces,
    nearest_rotation,
    procrustes,
)
from unbend.alignment._motions import Motions, OrientedSurface, find_motions
from unbend.alignment._nearest import Pairs, farthest_points, nearest_pairs

__all__ = [
    "Alignment",
    "Motions",
    "OrientedSurface",
    "Pairs",
    "align",
    "farthest_points",
    "find_motions",
    "icp",
    "largest_traces",
    "nearest_pairs",
    "nearest_rotation",
    "procrustes",
]
