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
# Real pairs of one body have a rigidity score of -2.3 or less, pairs of different bodies seldom
# below -2.2: even odds between them, and how fast the log odds change per unit of score.
_EVEN, _SLOPE = -2.2, 5.0
# A lead over the best rival by this much makes the log odds between the two 1.
_LEAD = 0.07
# A rival this far behind, or none at all, counts as this lead.
_LARGEST_LEAD = 2.0


def confidence(source: Shape, target: Shape, ranked: Sequence[Candidate]) -> float:
    """Probability that the first of the ranked candidates is right.

    Two things must hold: that the map moves the surface as one body in two poses moves, and
    that no candidate which goes elsewhere on the shape does so nearly as well.
    """
    fit, lead = evidence(source, target, ranked)
    one_body = 1 / (1 + np.exp(_SLOPE * (fit - _EVEN)))
    return float(one_body / (1 + np.exp(-lead / _LEAD)))


def evidence(source: Shape, target: Shape, ranked: Sequence[Candidate]) -> tuple[float, float]:
    """Rigidity of the first candidate, and its lead over the best one that differs."""
    first = ranked[0]
    images = _images(source, target, first.functional_map)
    for other in ranked[1:]:
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
    return np.asarray(target.vertices[theirs[pairs.forward[0]]])
