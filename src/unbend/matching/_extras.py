"""Parts that only one of two shapes has, such as a rider, wings, or a missing arm.

No boundary tells where they end. But wherever a map leads such a part, it is nothing like what is
there. It is cut off where little is to cut, the rest is registered without it, and then it is
looked for again: a part that was merely led astray is explained by then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from unbend._types import BoolArray, FloatArray
from unbend.matching import _constants as constants
from unbend.matching._plan import MEDIUM, Sides
from unbend.matching._polish import as_taken
from unbend.matching._registration import Registered, register
from unbend.matching._score import Candidate, unexplained
from unbend.matching._shape import Shape
from unbend.mesh import measure_corners, minimum_cut

# Share of a patch that is not explained, from which on it may be of such a part. The outline counts
# as a strip of a patch's radius of which nothing is explained but that.
_UNLIKE = 0.35
# Share of the area. Tails and ears of two animals may be as unlike as what only one has.
_SMALLEST, _LARGEST = 0.08, 0.5
_UNIT = 1e-7  # of areas


def without_extras(sides: Sides, candidate: Candidate, may_lack: Sequence[bool]) -> Candidate:
    """Leave out what only one of the shapes has, of a candidate between their finer proxies.

    ``may_lack`` says whether the source, and the target, may lack what the other has.
    """
    if not any(may_lack):
        return candidate
    shapes = as_taken(sides, candidate).at(MEDIUM)
    if (rough := _cut_off(*shapes, candidate.registered, may_lack)) is None:
        return candidate
    (found,) = register(*shapes, [rough], constants.DATA_WEIGHTS[2:], constants.STEPS)
    left = _cut_off(*shapes, found, may_lack)
    return candidate if left is None else replace(candidate, registered=left)


def _cut_off(
    source: Shape, target: Shape, found: Registered, may_lack: Sequence[bool]
) -> Registered | None:
    """Find such parts anew, and leave them out; None if there are none."""
    poses = found.source, found.target
    ours, theirs = (one.without(np.zeros_like(one.overlap)) for one in poses)
    shares = unexplained(source, target, found._replace(source=ours, target=theirs))
    mine, other = (
        _extra(shape, share) & lacks
        for shape, share, lacks in zip((source, target), shares, may_lack[::-1], strict=True)
    )
    if not (mine.any() or other.any()):
        return None
    return found._replace(source=found.source.without(mine), target=found.target.without(other))


def _extra(shape: Shape, shares: FloatArray) -> BoolArray:
    """Vertices (n,) whose patches are explained so badly that leaving them out pays."""
    gains = shape.areas * (shares - _UNLIKE)
    if shape.areas @ (gains > 0) < _SMALLEST:
        return np.zeros(len(shares), dtype=bool)
    # An outline that parts a corner from the two others leads through the middles of two sides.
    sides = np.sqrt(measure_corners(shape.vertices, shape.faces)[1])
    lengths = np.tile((sides.sum(axis=1, keepdims=True) / 4 - sides / 2).ravel(), 2)
    ends = [shape.faces[:, [1, 2, 0]].ravel(), shape.faces[:, [2, 0, 1]].ravel()]
    links = np.stack([np.concatenate(ends), np.concatenate(ends[::-1])])
    costs = _UNLIKE * constants.PATCH * np.maximum(lengths, 0)
    found = minimum_cut(gains, links, costs, _UNIT)
    return np.asarray(found & (_SMALLEST <= shape.areas @ found <= _LARGEST))
