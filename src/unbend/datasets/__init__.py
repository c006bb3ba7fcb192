"""Shapes to try things on, with known correspondences: synthetic animals, and TOSCA to download."""

from unbend.datasets.biped import make_biped
from unbend.datasets.fetch import fetch_tosca_remeshed
from unbend.datasets.octopus import make_octopus
from unbend.datasets.primitives import make_sphere
from unbend.datasets.quadruped import make_quadruped
from unbend.datasets.shape import Shape, rest_map

__all__ = [
    "Shape",
    "fetch_tosca_remeshed",
    "make_biped",
    "make_octopus",
    "make_quadruped",
    "make_sphere",
    "rest_map",
]
