"""How likely a chosen map is right: calibrated on how it compares with its runners-up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from unbend._types import FloatArray
from unbend.matching._shape import Shape
from unbend.matching._solve import Candidate
from unbend.refinement import nearest_pairs, spectral_weights

# Maps whose images lie further apart than this on average, in units of sqrt(area), are rivals.
_DIFFERENT = 0.1
_SAMPLES = 300
# log odds = intercept + fit * (misfit's logarithm) + lead * (lead over the best rival).
_INTERCEPT, _FIT, _LEAD = 0.0, -2.0, 4.0
# A rival this far behind, or none at all, counts as this lead.
_LARGEST_LEAD = 2.0


def confidence(source: Shape, target: Shape, ranked: Sequence[Candidate]) -> float:
    """Probability that the first of the ranked candidates is right, by a logistic rule.

    Two things count: how rigid the map is by itself, and how far it leads the best candidate
    that goes elsewhere on the shape.
    """
    fit, lead = evidence(source, target, ranked)
    return float(1 / (1 + np.exp(-(_INTERCEPT + _FIT * fit + _LEAD * lead))))


def evidence(source: Shape, target: Shape, ranked: Sequence[Candidate]) -> tuple[float, float]:
    """Rigidity of the first candidate, and its lead over the best one that differs."""
    first = ranked[0]
    images = _images(source, target, first.functional_map)
    for other in ranked[1:]:
        if other.orientation <= 0:
            continue
        apart = np.linalg.norm(_images(source, target, other.functional_map) - images, axis=1)
        if apart.mean() > _DIFFERENT:
            return first.rigidity, min(other.rigidity - first.rigidity, _LARGEST_LEAD)
    return first.rigidity, _LARGEST_LEAD


def _images(source: Shape, target: Shape, functional_map: FloatArray) -> FloatArray:
    k = len(functional_map)
    weights = spectral_weights(source.eigenvalues, target.eigenvalues, k)
    left = source.basis[source.samples[:_SAMPLES], :k] @ functional_map * weights
    theirs = target.samples[:_SAMPLES]
    pairs = nearest_pairs(left[None], target.basis[theirs, :k] * weights)
    return target.vertices[theirs[pairs.forward[0]]]
