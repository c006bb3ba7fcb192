"""The last choice between maps, and how likely it is right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from unbend._types import FloatArray
from unbend.alignment import nearest_pairs
from unbend.matching._shape import Shape
from unbend.matching._solve import Candidate, OnStep, Solution, refine
from unbend.matching._zoomout import spectral_weights

# Maps whose images lie further apart than this on average, in units of sqrt(area), are rivals.
_DIFFERENT = 0.1
_SAMPLES = 300
# A rival whose rigidity score is this near is polished too: the residual of the polished maps
# tells even a person from the same person back to front.
_CONTESTED = 0.3
# Real pairs of one body have a rigidity score of -2.3 or less, pairs of different bodies seldom
# below -2.2: even odds between them, and how fast the log odds change per unit of score.
_EVEN, _SLOPE = -2.2, 5.0
# A lead over the best rival by this much makes the log odds between the two 1: in the rigidity
# score, and in the logarithm of the polished maps' residuals.
_LEAD, _POLISHED_LEAD = 0.07, 0.05


class Decision(NamedTuple):
    """The map that was chosen.

    Attributes
    ----------
    ranked : list of Candidate
        The chosen one, then the others in their order.
    solution : Solution
    confidence : float
        Probability that the map is right as a whole. Two things must hold: that it moves the
        surface as one body in two poses moves, and that no candidate which goes elsewhere on
        the shape does so nearly as well.
    """

    ranked: list[Candidate]
    solution: Solution
    confidence: float


def decide(
    source: Shape,
    target: Shape,
    ranked: Sequence[Candidate],
    *,
    polish: bool,
    on_step: OnStep | None = None,
) -> Decision:
    """Bring the first of the ranked candidates to full resolution, or a rival that proves better.

    Parameters
    ----------
    source, target : Shape
    ranked : sequence of Candidate
        Most rigid first.
    polish, on_step
        As in :func:`unbend.matching._solve.refine`. Without polish the rank decides.
    """
    first, *others = ranked
    solution = refine(source, target, first, polish=polish, on_step=on_step)
    rival = _best_rival(source, target, first, others)
    odds = np.inf if rival is None else (rival.rigidity - first.rigidity) / _LEAD
    if polish and rival is not None and rival.rigidity - first.rigidity < _CONTESTED:
        other = refine(source, target, rival, on_step=on_step)
        odds = np.log(other.residual / solution.residual) / _POLISHED_LEAD
        if odds < 0:
            others = [first, *(one for one in others if one is not rival)]
            first, solution, odds = rival, other, -odds
    one_body = 1 / (1 + np.exp(_SLOPE * (first.rigidity - _EVEN)))
    return Decision([first, *others], solution, float(one_body / (1 + np.exp(-odds))))


def _best_rival(
    source: Shape, target: Shape, first: Candidate, others: Sequence[Candidate]
) -> Candidate | None:
    images = _images(source, target, first.functional_map)
    for other in others:
        apart = np.linalg.norm(_images(source, target, other.functional_map) - images, axis=1)
        if apart.mean() > _DIFFERENT:
            return other
    return None


def _images(source: Shape, target: Shape, functional_map: FloatArray) -> FloatArray:
    k = len(functional_map)
    weights = spectral_weights(source.eigenvalues, target.eigenvalues, k)
    left = source.basis[source.samples[:_SAMPLES], :k] @ functional_map * weights
    theirs = target.samples[:_SAMPLES]
    pairs = nearest_pairs(left[None], target.basis[theirs, :k] * weights)
    return np.asarray(target.vertices[theirs[pairs.forward[0]]])
