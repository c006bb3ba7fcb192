"""Polish: move the source onto the target as rigidly as possible, starting from a spectral map.

A map through smooth functions slides a little along featureless parts. Deforming the source
itself, every neighbourhood turned but hardly stretched (Sorkine & Alexa, "As-rigid-as-possible
surface modeling", SGP 2007), takes the slide out. Closest points are found by walking over the
meshes from where the map stands, so a leg is never caught by the leg beside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from unbend._kernels import edge_covariances, rotated_divergence, turn_rotations, walk
from unbend._types import FloatArray, IntArray
from unbend.linalg.factorization import Factorization, factorize
from unbend.matching._shape import Shape, vertex_normals

# Pull towards the target, in units of 1 / area: stiffness and pull balance over a length that is
# the inverse of its square root, from a seventeenth of sqrt(area) to a fifty-fifth.
_PULLS = (300.0, 1000.0, 3000.0)
_STEPS_PER_PULL = 5
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
    posed : (n, 3) ndarray of float64
        The deformed source.
    stretch : float
        Energy of the edges' changes of length, as a share of that of the edges: what is left of
        isometry. Of two maps between the same shapes the truer one has less of it.
    """

    source_to_target: IntArray
    target_to_source: IntArray
    posed: FloatArray
    stretch: float


def register(
    source: Shape,
    target: Shape,
    functional_map: FloatArray,
    source_to_target: IntArray,
    target_to_source: IntArray,
) -> Registered:
    """Polish a pair of point maps by a deformation of the source.

    Parameters
    ----------
    source, target : Shape
    functional_map : (k, k) ndarray of float64
        Gives the starting pose: the target's positions, pulled back smoothly.
    source_to_target, target_to_source : ndarrays of int64
        The maps to polish.
    """
    k = len(functional_map)
    basis = source.basis[:, :k]
    posed = basis @ (functional_map @ target.position_coefficients[:k])
    smooth = basis @ source.position_coefficients[:k]
    spokes = source.spokes
    stiffness = sp.diags(np.asarray(spokes.sum(axis=1)).ravel()) - spokes
    mass = sp.diags(source.areas)
    average = factorize(mass + _TURNING_LENGTH**2 * stiffness)
    rotations = _start_rotations(_covariances(source, average, smooth, posed))
    forward, backward = source_to_target, target_to_source
    ahead = posed
    for stage, pull in enumerate(_PULLS):
        # Both directions pull, each with the whole area: on average twice a vertex's own.
        system = factorize(stiffness + 2 * pull * mass)
        for step in range(_STEPS_PER_PULL):
            if stage + step:
                forward, backward = _closest(source, target, ahead, forward, backward)
            force = source.areas[:, None] * (target.vertices[forward] + ahead)
            force += _scatter(backward, target.areas[:, None] * target.vertices, len(ahead))
            force -= np.bincount(backward, target.areas, len(ahead))[:, None] * ahead
            turned = rotated_divergence(
                spokes.indptr, spokes.indices, spokes.data, source.vertices, rotations
            )
            before, posed = posed, system.solve(turned + pull * force)
            turn_rotations(_covariances(source, average, source.vertices, posed), rotations)
            ahead = posed + _MOMENTUM * (posed - before)
    for _ in range(2):
        forward, backward = _closest(source, target, posed, forward, backward)
    return Registered(forward, backward, posed, _stretch(source, posed))


def _stretch(source: Shape, posed: FloatArray) -> float:
    edges = source.spokes.tocoo()
    before = np.linalg.norm(source.vertices[edges.row] - source.vertices[edges.col], axis=1)
    after = np.linalg.norm(posed[edges.row] - posed[edges.col], axis=1)
    return float((edges.data @ (after - before) ** 2) / (edges.data @ before**2))


def _closest(
    source: Shape, target: Shape, posed: FloatArray, forward: IntArray, backward: IntArray
) -> tuple[IntArray, IntArray]:
    left = np.hstack([posed, _NORMAL_WEIGHT * vertex_normals(posed, source.faces)])
    right = np.hstack([target.vertices, _NORMAL_WEIGHT * target.normals])
    ours = source.spokes.indptr, source.spokes.indices
    theirs = target.spokes.indptr, target.spokes.indices
    return walk(left, right, forward, *ours, *theirs), walk(right, left, backward, *theirs, *ours)


def _covariances(
    source: Shape, average: Factorization, rest: FloatArray, posed: FloatArray
) -> FloatArray:
    """Covariance of edges at rest and posed, averaged over neighbourhoods, (n, 3, 3)."""
    spokes = source.spokes
    cross = edge_covariances(spokes.indptr, spokes.indices, spokes.data, rest, posed)
    return average.solve(cross.reshape(-1, 9)).reshape(-1, 3, 3)


def _start_rotations(covariances: FloatArray) -> FloatArray:
    left, _, right = np.linalg.svd(covariances)
    left[:, :, 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))[:, None]
    return np.ascontiguousarray(np.matmul(right.transpose(0, 2, 1), left.transpose(0, 2, 1)))


def _scatter(rows: IntArray, values: FloatArray, n: int) -> FloatArray:
    return np.stack([np.bincount(rows, column, n) for column in values.T], axis=1)
