"""Shapes to try things on: synthetic animals whose true correspondences are known."""

from __future__ import annotations

from unbend.datasets.biped import make_biped
from unbend.datasets.octopus import make_octopus
from unbend.datasets.primitives import make_sphere
from unbend.datasets.quadruped import make_quadruped
from unbend.datasets.shape import Shape, rest_map

__all__ = ["Shape", "make_biped", "make_octopus", "make_quadruped", "make_sphere", "rest_map"]
