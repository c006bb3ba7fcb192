"""The judge: which of two maps is the better one, and how likely the best is right.

One number decides. A right map carries every patch of a surface to a turned, little stretched
copy of it; the energy is what such copies leave unexplained, over both directions. A map that
turns the surface inside out is no candidate at all, however well it fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from unbend._kernels import edge_covariances, turn_rotations
from unbend._types import FloatArray, IntArray
from unbend.matching._projection import closest_faces
from unbend.matching._registration import Registered, landing_places
from unbend.matching._shape import Shape, vertex_normals

# Maps whose images lie further apart than this on average, in sqrt(area), are different: the
# double of that tells a limb from its neighbour.
DIFFERENT = 0.1
# The energy at which a map is as likely right as wrong, how fast that changes, and the lead in
# energy that makes the odds between two maps 2.7 to 1.
_EVEN, _SPREAD, _LEAD = 1.6, 0.15, 0.05


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pair of maps between two shapes, registered and judged.

    Attributes
    ----------
    registered : Registered
    energy : float
        See :func:`energy`.
    orientation : float
        Share of the surface that stays right side out, less the rest, in the worse direction.
    reflected : bool
        Whether the target was taken as its mirror image.
    """

    registered: Registered
    energy: float
    orientation: float
    reflected: bool = False


def judge(source: Shape, target: Shape, found: Registered, reflected: bool = False) -> Candidate:
    """Judge a registration of two shapes."""
    left, right = landing_places(source, target, found)
    ahead = _images(left, right, target, found.forward)
    back = _images(right, left, source, found.backward)
    energy = (
        _unexplained(source, ahead, found.source.rotations)
        + _unexplained(target, back, found.target.rotations)
    ) / 2
    orientation = min(
        _right_side_out(source, target, found.forward, found.source.places),
        _right_side_out(target, source, found.backward, found.target.places),
    )
    return Candidate(found, energy, orientation, reflected)


def ranked(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Lowest energy first, of those that keep the right side out if any does."""
    kept = [one for one in candidates if one.orientation > 0]
    return sorted(kept or candidates, key=lambda one: one.energy)


def distinct(candidates: Sequence[Candidate], target: Shape, areas: FloatArray) -> list[Candidate]:
    """Leave out of ranked candidates those that lead where a better one does."""
    found: list[Candidate] = []
    for one in candidates:
        images = target.vertices[one.registered.forward]
        if all(
            areas @ np.linalg.norm(images - target.vertices[other.registered.forward], axis=1)
            > DIFFERENT
            for other in found
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


def _unexplained(shape: Shape, images: FloatArray, rotations: FloatArray) -> float:
    """Energy of the edges' images that turned edges do not explain, over that of the edges.

    Dirichlet energy of the images and of the shape itself, less what the two have in common
    after the best rotation of every neighbourhood: an as-rigid-as-possible energy with rotations
    that are alike nearby.
    """
    spokes = shape.spokes
    graph = spokes.indptr, spokes.indices, spokes.data
    common = edge_covariances(*graph, shape.vertices, images)
    rotations = rotations.copy()
    turn_rotations(shape.averaging.solve(common.reshape(-1, 9)).reshape(-1, 3, 3), rotations)
    own = np.einsum("nii->", edge_covariances(*graph, shape.vertices, shape.vertices))
    theirs = np.einsum("nii->", edge_covariances(*graph, images, images))
    return float((theirs + own - 2 * np.einsum("nij,nji->", rotations, common)) / own)


def _right_side_out(shape: Shape, goal: Shape, point_map: IntArray, places: FloatArray) -> float:
    normals = vertex_normals(places, shape.faces)
    return float(shape.areas @ np.sign((normals * goal.normals[point_map]).sum(axis=1)))
