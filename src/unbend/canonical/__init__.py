"""Canonical forms: a surface embedded so that its poses look alike."""

from unbend.canonical._canonical_form import CanonicalForm, canonical_form
from unbend.canonical._interpolation import distance_coefficients, interpolate
from unbend.canonical._mds import sampled_scaling
from unbend.canonical._sampling import farthest_point_sampling, shape_end, spread_samples

__all__ = [
    "CanonicalForm",
    "canonical_form",
    "distance_coefficients",
    "farthest_point_sampling",
    "interpolate",
    "sampled_scaling",
    "shape_end",
    "spread_samples",
]
