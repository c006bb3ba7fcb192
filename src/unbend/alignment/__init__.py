"""Rigid alignment of point sets, and their nearest neighbours."""

from unbend.alignment._alignment import (
    Alignment,
    align,
    icp,
    nearest_rotation,
    procrustes,
)
from unbend.alignment._nearest import Pairs, nearest_pairs

__all__ = [
    "Alignment",
    "Pairs",
    "align",
    "icp",
    "nearest_pairs",
    "nearest_rotation",
    "procrustes",
]
