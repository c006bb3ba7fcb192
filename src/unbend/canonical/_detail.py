"""The surface itself in its form's pose: what a form loses of a shape, given back.

In a canonical form limbs are threads and hands have no fingers. Laid into the form's pose as
rigidly as possible, the surface keeps them (after Lian, Godil & Xiao, "Feature-preserved 3D
canonical form", IJCV 102, 2013). Patches are drawn to where the form has them, each as a whole,
while every neighbourhood is turned but hardly stretched (Sorkine & Alexa, "As-rigid-as-possible
surface modeling", SGP 2007).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from unbend._types import FloatArray, IntArray, Progress
from unbend.alignment import nearest_rotation
from unbend.linalg.factorization import Factorization, factorize
from unbend.matching import Shape, edge_covariances, rotated_divergence, turn_rotations
from unbend.mesh import wind_alike

# Pull towards the form, in units of 1 / area, first so strong that every joint gives way; steps
# for each.
_PULLS, _STEPS = (300.0, 100.0, 30.0, 10.0), 8
# Lengths in sqrt(area): what a patch is that is drawn as a whole, about as long as a limb is round,
# so that a limb keeps its girth; and what neighbourhood has one rotation, short enough for joints.
_PATCH, _TURNING = 0.3, 0.015


def lay_into_pose(
    vertices: FloatArray, faces: IntArray, areas: FloatArray, form: FloatArray, progress: Progress
) -> FloatArray:
    """Lay a surface into the pose of its canonical form.

    Parameters
    ----------
    vertices : (n, 3) ndarray of float64
        Of a surface of unit area.
    faces : (m, 3) ndarray of int64
    areas : (n,) ndarray of float64
        Sum to one.
    form : (n, 3) ndarray of float64
        Unique up to a rotation or reflection, of which the surface takes the one that does not
        turn it inside out; in any unit, to which the surface is indifferent.
    progress : callable

    Returns
    -------
    (n, 3) ndarray of float64
    """
    wound = wind_alike(vertices, faces)
    rest = vertices - areas @ vertices
    goal = form - areas @ form
    if wound is not None and _volume(rest, wound) * _volume(goal, wound) < 0:
        goal = goal * np.array([-1.0, 1.0, 1.0])
    shape = Shape(rest, faces, areas, np.empty(0), np.empty((len(rest), 0)))
    spokes, mass = shape.spokes, areas[:, None]
    edges = spokes.indptr, spokes.indices, spokes.data
    patches = factorize(sp.diags(areas) + _PATCH**2 * shape.stiffness)
    averaging = factorize(sp.diags(areas) + _TURNING**2 * shape.stiffness)

    def covariances(places: FloatArray, over: Factorization = averaging) -> FloatArray:
        cross = edge_covariances(*edges, rest, places)
        return np.asarray(over.solve(cross.reshape(-1, 9)).reshape(-1, 3, 3))

    rotations = nearest_rotation(covariances(goal, patches).transpose(0, 2, 1))
    rotations = np.ascontiguousarray(rotations)
    places = goal * np.sqrt((mass * rest**2).sum() / (mass * goal**2).sum())
    for i, pull in enumerate(_PULLS):
        system = factorize(shape.stiffness + sp.diags(pull * areas))
        for step in range(_STEPS):
            size = (mass * places * goal).sum() / (mass * goal**2).sum()
            wanted = places + patches.solve(mass * (size * goal - places))
            turned = rotated_divergence(*edges, rest, rotations)
            places = system.solve(turned + pull * mass * wanted)
            turn_rotations(covariances(places), rotations)
            progress("detail", (i + (step + 1) / _STEPS) / len(_PULLS))
    return np.asarray(places)


def _volume(points: FloatArray, faces: IntArray) -> float:
    a, b, c = (points[faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)))
