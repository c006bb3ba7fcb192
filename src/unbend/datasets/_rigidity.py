"""Take the stretch out of a posed skin, as blended bone motions bend a limb like rubber.

A few steps of as-rigid-as-possible deformation, held close to the posed skin, give most of the
lost edge lengths back.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from unbend._types import FloatArray, IntArray
from unbend.alignment import nearest_rotation
from unbend.deformation import ElasticSurface
from unbend.mesh import measure_corners

_REACH = 0.2  # features of the pose larger than this are kept
_N_STEPS = 12


def restore_lengths(rest: FloatArray, posed: FloatArray, faces: IntArray) -> FloatArray:
    """Move posed vertices (n, 3) so that edges come closer to their resting lengths."""
    n = len(rest)
    dots, _, double_areas = measure_corners(rest, faces)
    cotangents = np.clip(dots / (2 * np.maximum(double_areas, 1e-12))[:, None], 0.02, 5).ravel()
    ends = [faces[:, [1, 2, 0]].ravel(), faces[:, [2, 0, 1]].ravel()]
    weights = sp.csr_matrix((np.tile(cotangents, 2), np.hstack([ends, ends[::-1]])), shape=(n, n))
    areas: FloatArray = np.bincount(faces.ravel(), np.repeat(double_areas, 3), n) / 6
    surface = ElasticSurface(rest, faces, areas).with_edge_weights(weights)
    system = surface.system(1 / _REACH**2)
    force = areas[:, None] * posed / _REACH**2
    moved = posed
    for _ in range(_N_STEPS):
        turns = nearest_rotation(surface.covariances(moved).transpose(0, 2, 1))
        moved = surface.fit_places(system, force, turns)
    return moved
