"""Shapes to try things on, with known correspondences: synthetic animals, and TOSCA to download."""

from __future__ import annotations

from unbend.datasets.biped import make_biped
from unbend.datasets.bodies import make_body, random_proportions
from unbend.datasets.damage import Damaged, cut, cut_discs, damaged_truth, keep
from unbend.datasets.fetch import fetch_tosca_remeshed
from unbend.datasets.octopus import make_octopus
from unbend.datasets.primitives import make_sphere
from unbend.datasets.quadruped import make_quadruped
from unbend.datasets.scanning import add_components, add_noise, seen_from
from unbend.datasets.shape import Shape, rest_map
from unbend.datasets.welding import fuse, weld

__all__ = [
    "Damaged",
    "Shape",
    "add_components",
    "add_noise",
    "cut",
    "cut_discs",
    "damaged_truth",
    "fetch_tosca_remeshed",
    "fuse",
    "keep",
    "make_biped",
    "make_body",
    "make_octopus",
    "make_quadruped",
    "make_sphere",
    "random_proportions",
    "rest_map",
    "seen_from",
    "weld",
]
