"""The surface itself in its form's pose: what a form loses of a shape, given back.

In a canonical form limbs are threads and hands have no fingers. Laid into the form's pose as
rigidly as possible, the surface keeps them (after Lian, Godil & Xiao, "Feature-preserved 3D
canonical form", IJCV 102, 2013). Patches are drawn to where the form has them, each as a whole,
while every neighbourhood is turned but hardly stretched (Sorkine & Alexa, "As-rigid-as-possible
surface modeling", SGP 2007).
"""

from __future__ import annotations

import numpy as np

from unbend._types import FloatArray, IntArray, Progress
from unbend.deformation import ElasticSurface
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
    surface, mass = ElasticSurface(rest, faces, areas), areas[:, None]
    rotations = surface.fit_rotations(goal, length=_PATCH)
    places = goal * np.sqrt((mass * rest**2).sum() / (mass * goal**2).sum())
    for i, pull in enumerate(_PULLS):
        system = surface.system(pull)
        for step in range(_STEPS):
            size = (mass * places * goal).sum() / (mass * goal**2).sum()
            wanted = places + surface.averaged(mass * (size * goal - places), _PATCH)
            places, *_ = surface.step(system, pull * mass * wanted, rotations, length=_TURNING)
            progress("detail", (i + (step + 1) / _STEPS) / len(_PULLS))
    return np.asarray(places)


def _volume(points: FloatArray, faces: IntArray) -> float:
    a, b, c = (points[faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)))
