"""The judge: which of two maps is the better one, and how likely the best is right.

One number decides. A right map carries every patch of a surface to a turned, little stretched
copy of it; the energy is what such copies leave unexplained, over both directions. A map that
turns the surface inside out is no candidate at all, however well it fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from unbend._types import FloatArray, IntArray
from unbend.matching._kernels import edge_covariances
from unbend.matching._projection import closest_faces
from unbend.matching._registration import Registered, landing_places
from unbend.matching._shape import Shape
from unbend.mesh import vertex_normals

# Maps are different where more than this share of the surface, a limb's end, goes further apart
# than this, in sqrt(area): to another limb.
_SHARE, _APART = 0.03, 0.22
# The energy at which a map is as likely right as wrong, how fast that changes, and the lead in
# energy that makes the odds between two maps 2.7 to 1.
_EVEN, _SPREAD, _LEAD = 0.42, 0.03, 0.02
_DIGITS = 6  # of energies, that are not rounding


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pair of maps between two shapes, registered and judged.

    Attributes
    ----------
    registered : Registered
    energy : float
        Share of local shape, 0 to 1, that the maps leave unexplained; both directions.
    orientation : float
        Share of the surface that stays right side out, less the rest, in the worse direction.
    reflected : bool
        Whether the target was taken as its mirror image.
    hypothesis : (k, k) ndarray of float64, or None
        The functional map that was registered.
    """

    registered: Registered
    energy: float
    orientation: float
    reflected: bool = False
    hypothesis: FloatArray | None = None


def judge(
    source: Shape,
    target: Shape,
    found: Registered,
    reflected: bool = False,
    hypothesis: FloatArray | None = None,
) -> Candidate:
    """Judge a registration of two shapes."""
    left, right = landing_places(source, target, found)
    ahead = _images(left, right, target, found.forward)
    back = _images(right, left, source, found.backward)
    energy = (_unexplained(source, ahead) + _unexplained(target, back)) / 2
    orientation = min(
        _right_side_out(source, target, found.forward, found.source.places),
        _right_side_out(target, source, found.backward, found.target.places),
    )
    return Candidate(found, energy, orientation, reflected, hypothesis)


def ranked(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Lowest energy first, of those that keep the right side out if any does.

    Of those that a symmetry of the shapes makes equal, which differ by rounding only, the one that
    came first stays first.
    """
    kept = [one for one in candidates if one.orientation > 0]
    return sorted(kept or candidates, key=lambda one: round(one.energy, _DIGITS))


def distinct(candidates: Sequence[Candidate], target: Shape, areas: FloatArray) -> list[Candidate]:
    """Leave out of ranked candidates those that lead where a better one does."""
    found: list[Candidate] = []
    for one in candidates:
        images = target.vertices[one.registered.forward]
        others = (target.vertices[other.registered.forward] for other in found)
        if all(
            areas @ (np.linalg.norm(images - other, axis=1) > _APART) > _SHARE for other in others
        ):
            found.append(one)
    return found


def confidence(found: Sequence[Candidate]) -> float:
    """Probability, 0 to 1, that the first of the distinct candidates is right as a whole.

    Two things must hold: that it moves the surface as one body in two poses moves, and that no
    other does so nearly as well. Candidates of one energy share the probability.
    """
    first, *others = found
    one_body = 1 / (1 + np.exp((first.energy - _EVEN) / _SPREAD))
    shares = sum(np.exp((first.energy - other.energy) / _LEAD) for other in others)
    return float(one_body / (1 + shares))


def _images(left: FloatArray, right: FloatArray, goal: Shape, point_map: IntArray) -> FloatArray:
    """Where on the goal's faces each vertex lands, (n, 3), not rounded to vertices."""
    faces, weights = closest_faces(left, right, goal.faces, point_map)
    return np.asarray(np.einsum("ij,ijk->ik", weights, goal.vertices[goal.faces[faces]]))


def _unexplained(shape: Shape, images: FloatArray) -> float:
    """Share of local shape that the images of patches, turned and scaled, do not explain: 0 to 1.

    One less the correlation of a patch's edges with their images after the best rotation (Kabsch
    1976), weighted by area; a patch that collapses is not explained at all.
    """
    spokes = shape.spokes
    graph = spokes.indptr, spokes.indices, spokes.data
    own, common, theirs = (
        edge_covariances(*graph, *ends).reshape(-1, 9)
        for ends in ((shape.vertices, shape.vertices), (shape.vertices, images), (images, images))
    )
    lengths = np.stack([own[:, ::4].sum(axis=1), theirs[:, ::4].sum(axis=1)], axis=1)
    averaged = shape.patches.solve(np.hstack([common, lengths]))
    cross = averaged[:, :9].reshape(-1, 3, 3)
    values = np.linalg.svd(cross, compute_uv=False)
    values[:, 2] *= np.sign(np.linalg.det(cross))
    size = np.sqrt(np.maximum(averaged[:, 9:].prod(axis=1), np.finfo(float).tiny))
    return float(shape.areas @ (1 - values.sum(axis=1) / size))


def _right_side_out(shape: Shape, goal: Shape, point_map: IntArray, places: FloatArray) -> float:
    normals = vertex_normals(places, shape.faces)
    return float(shape.areas @ np.sign((normals * goal.normals[point_map]).sum(axis=1)))
