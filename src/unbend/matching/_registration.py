"""Polish: move each shape onto the other as rigidly as possible, starting from a spectral map.

A map through smooth functions slides a little along featureless parts. Deforming the shapes
themselves, every neighbourhood turned but hardly stretched (Sorkine & Alexa, "As-rigid-as-possible
surface modeling", SGP 2007), takes the slide out. Points correspond that are close in both poses:
what one deformation gets wrong the other seldom gets wrong too. They are found by walking over
the meshes from where the map stands, so a leg is never caught by the leg beside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from unbend._types import FloatArray, IntArray
from unbend.alignment import nearest_rotation
from unbend.linalg.factorization import factorize
from unbend.matching._kernels import edge_covariances, rotated_divergence, turn_rotations, walk
from unbend.matching._shape import Shape
from unbend.mesh import vertex_normals

# Pull towards the other shape, in units of 1 / area: stiffness and pull balance over a length that
# is the inverse of its square root, from a seventeenth of sqrt(area) to a fifty-fifth.
_PULLS = (300.0, 1000.0, 3000.0)
_STEPS_PER_PULL = 8
# Rotations are averaged over about this length: limbs turn as wholes, which keeps their ends
# from sliding, yet joints still bend.
_TURNING_LENGTH = 0.03
# Closest points are sought from where the last step leads to, which speeds up a slow slide.
_MOMENTUM = 0.7
_NORMAL_WEIGHT = 0.1


class Registered(NamedTuple):
    """A polished pair of maps.

    Attributes
    ----------
    source_to_target, target_to_source : ndarrays of int64
    source_places : (n, 6) ndarray of float64
        Positions of the source's vertices in the target's pose and in its own.
    target_places : (m, 6) ndarray of float64
        Positions of the target's vertices in its own pose and in the source's.
    """

    source_to_target: IntArray
    target_to_source: IntArray
    source_places: FloatArray
    target_places: FloatArray


def register(
    source: Shape,
    target: Shape,
    functional_map: FloatArray,
    source_to_target: IntArray,
    target_to_source: IntArray,
) -> Registered:
    """Polish a pair of point maps by deformations of both shapes.

    Parameters
    ----------
    source, target : Shape
    functional_map : (k, k) ndarray of float64
        Gives the starting poses: the other shape's positions, pulled back smoothly.
    source_to_target, target_to_source : ndarrays of int64
        The maps to polish.
    """
    ours = _Deformation(source, target, functional_map)
    theirs = _Deformation(target, source, functional_map.T)
    forward, backward = source_to_target, target_to_source
    for stage, pull in enumerate(_PULLS):
        ours.stiffen(pull)
        theirs.stiffen(pull)
        for step in range(_STEPS_PER_PULL):
            if stage + step:
                forward, backward = _closest(ours, theirs, forward, backward)
            ours.step(forward, backward)
            theirs.step(backward, forward)
    ours.ahead, theirs.ahead = ours.posed, theirs.posed
    for _ in range(2):
        forward, backward = _closest(ours, theirs, forward, backward)
    return Registered(
        forward,
        backward,
        np.hstack([ours.posed, source.vertices]),
        np.hstack([target.vertices, theirs.posed]),
    )


class _Deformation:
    """A shape on its way into another's pose.

    Attributes
    ----------
    posed : (n, 3) ndarray of float64
    ahead : (n, 3) ndarray of float64
        Where the last step leads to.
    """

    def __init__(self, shape: Shape, goal: Shape, functional_map: FloatArray) -> None:
        self.shape, self.goal = shape, goal
        k = len(functional_map)
        basis = shape.basis[:, :k]
        self.posed = self.ahead = basis @ (functional_map @ goal.position_coefficients[:k])
        self._stiffness = sp.diags(np.asarray(shape.spokes.sum(axis=1)).ravel()) - shape.spokes
        self._mass = sp.diags(shape.areas)
        self._average = factorize(self._mass + _TURNING_LENGTH**2 * self._stiffness)
        smooth = basis @ shape.position_coefficients[:k]
        self._rotations = nearest_rotation(self._covariances(smooth).transpose(0, 2, 1))

    def stiffen(self, pull: float) -> None:
        """Set the pull of the steps that follow."""
        # Both directions pull, each with the whole area: on average twice a vertex's own.
        self._pull = pull
        self._system = factorize(self._stiffness + 2 * pull * self._mass)

    def step(self, forward: IntArray, backward: IntArray) -> None:
        """Draw the shape to where the maps to and from the goal say, then turn neighbourhoods."""
        shape, goal, spokes = self.shape, self.goal, self.shape.spokes
        n = len(shape.vertices)
        force = shape.areas[:, None] * (goal.vertices[forward] + self.ahead)
        force += _scatter(backward, goal.areas[:, None] * goal.vertices, n)
        force -= np.bincount(backward, goal.areas, n)[:, None] * self.ahead
        turned = rotated_divergence(
            spokes.indptr, spokes.indices, spokes.data, shape.vertices, self._rotations
        )
        before, self.posed = self.posed, self._system.solve(turned + self._pull * force)
        turn_rotations(self._covariances(shape.vertices), self._rotations)
        self.ahead = self.posed + _MOMENTUM * (self.posed - before)

    def rows(self) -> tuple[FloatArray, FloatArray]:
        """Positions and normals ahead, and at rest: (n, 6) each."""
        normals = vertex_normals(self.ahead, self.shape.faces)
        return (
            np.hstack([self.ahead, _NORMAL_WEIGHT * normals]),
            np.hstack([self.shape.vertices, _NORMAL_WEIGHT * self.shape.normals]),
        )

    def _covariances(self, rest: FloatArray) -> FloatArray:
        """Covariance of edges at rest and posed, averaged over neighbourhoods, (n, 3, 3)."""
        spokes = self.shape.spokes
        cross = edge_covariances(spokes.indptr, spokes.indices, spokes.data, rest, self.posed)
        return self._average.solve(cross.reshape(-1, 9)).reshape(-1, 3, 3)


def _closest(
    ours: _Deformation, theirs: _Deformation, forward: IntArray, backward: IntArray
) -> tuple[IntArray, IntArray]:
    """Points of either shape that are close to the other's in both poses."""
    left, right = np.hstack(ours.rows()), np.hstack(theirs.rows()[::-1])
    mine = ours.shape.spokes.indptr, ours.shape.spokes.indices
    other = theirs.shape.spokes.indptr, theirs.shape.spokes.indices
    return (
        walk(left, right, forward, *mine, *other),
        walk(right, left, backward, *other, *mine),
    )


def _scatter(rows: IntArray, values: FloatArray, n: int) -> FloatArray:
    return np.stack([np.bincount(rows, column, n) for column in values.T], axis=1)
