"""Shapes to try things on, with known correspondences: synthetic animals, public collections."""

from __future__ import annotations

from unbend.datasets.benchmarks import load_faust, load_scape, load_tosca
from unbend.datasets.biped import make_biped
from unbend.datasets.collection import Collection, Features, Truth
from unbend.datasets.fetch import fetch_tosca_remeshed
from unbend.datasets.octopus import make_octopus
from unbend.datasets.primitives import make_sphere
from unbend.datasets.quadruped import make_quadruped
from unbend.datasets.shape import Shape, rest_map

__all__ = [
    "Collection",
    "Features",
    "Shape",
    "Truth",
    "fetch_tosca_remeshed",
    "load_faust",
    "load_scape",
    "load_tosca",
    "make_biped",
    "make_octopus",
    "make_quadruped",
    "make_sphere",
    "rest_map",
]
