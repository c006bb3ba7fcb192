"""The surface itself, deformed into the pose of its canonical form."""

from __future__ import annotations

import numpy as np

from unbend._text import plural
from unbend._types import FloatArray, Progress
from unbend.canonical._canonical_form import CanonicalForm
from unbend.errors import InputError, heard
from unbend.io import MeshLike, as_mesh
from unbend.mesh import Mesh, orient_consistently
from unbend.spectral import make_surface

# Pulls towards the form, in units of 1 / area, the first strong enough to bend every joint; steps
# for each.
_PULLS, _STEPS = (300.0, 100.0, 30.0, 10.0), 8
# Lengths in sqrt(area): of a patch pulled as a whole, about the girth of a limb, which it
# keeps; and of a neighbourhood with one rotation, short enough for joints.
_PATCH, _TURNING = 0.3, 0.015


def lay_into_pose(
    mesh: MeshLike, form: CanonicalForm, *, progress: Progress | None = None
) -> FloatArray:
    """Lay a surface, as rigidly as possible, into the pose of its canonical form.

    The form loses detail: limbs become threads. Here limbs keep their thickness, and edges nearly
    keep their lengths.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts, with faces.
    form : CanonicalForm
        Of that mesh, of at least 3 dimensions: the first three are the pose.
    progress : callable, optional
        Called with a step's name and the share of it that is done, 0 to 1.

    Returns
    -------
    (n, 3) ndarray of float64
        Places of the vertices, in the mesh's own unit; NaN where the form is. A form that is a
        mirror image of the mesh is reflected.

    Raises
    ------
    InputError
        If the mesh has no faces, or the form has fewer than 3 dimensions or another number of
        vertices.

    References
    ----------
    Lian, Godil and Xiao, "Feature-preserved 3D canonical form", IJCV 102, 2013. Sorkine and Alexa,
    "As-rigid-as-possible surface modeling", SGP 2007.

    Examples
    --------
    >>> from unbend import canonical_form, lay_into_pose
    >>> from unbend.datasets import make_octopus
    >>> octopus = make_octopus(n_vertices=600).mesh
    >>> lay_into_pose(octopus, canonical_form(octopus)).shape
    (600, 3)
    """
    from unbend.deformation import ElasticSurface  # slow to import, and seldom needed

    mesh = as_mesh(mesh)
    check_form(mesh, form)
    if form.points.shape[1] < 3:
        raise InputError(f"a pose needs a form of 3 dimensions, not {form.points.shape[1]}")
    inside = np.asarray(np.isfinite(form.points).all(axis=1))
    part = Mesh(mesh.vertices, mesh.faces[inside[mesh.faces].all(axis=1)], name=mesh.name)
    with heard():  # the form has warned already
        surface = make_surface(part, laplacian=form.laplacian)  # type: ignore[arg-type]
    unit, areas = np.sqrt(surface.area), surface.operator.areas
    vertices, faces = surface.mesh.vertices / unit, surface.mesh.faces
    form_points = form.points[surface.prepared.kept, :3]
    oriented = orient_consistently(vertices, faces)
    rest = vertices - areas @ vertices
    goal = form_points - areas @ form_points
    if oriented is not None:
        volumes = [np.linalg.det(points[oriented]).sum() for points in (rest, goal)]
        if volumes[0] * volumes[1] < 0:
            goal = goal * np.array([-1.0, 1.0, 1.0])
    elastic, mass = ElasticSurface(rest, faces, areas), areas[:, None]
    rotations = elastic.fit_rotations(goal, length=_PATCH)
    places = goal * np.sqrt((mass * rest**2).sum() / (mass * goal**2).sum())
    for i, pull in enumerate(_PULLS):
        system = elastic.system(pull)
        for step in range(_STEPS):
            size = (mass * places * goal).sum() / (mass * goal**2).sum()
            wanted = places + elastic.averaged(mass * (size * goal - places), _PATCH)
            places, *_ = elastic.step(system, pull * mass * wanted, rotations, length=_TURNING)
            if progress is not None:
                progress("detail", (i + (step + 1) / _STEPS) / len(_PULLS))
    return surface.prepared.expand(places * unit)


def check_form(mesh: Mesh, form: CanonicalForm) -> None:
    """Raise InputError for a mesh without faces, or the form of another mesh."""
    if not isinstance(form, CanonicalForm):
        raise InputError(f"this needs a CanonicalForm, not {type(form).__name__}")
    if mesh.is_point_cloud:
        raise InputError(f"{mesh.name} has no faces, and this needs a surface")
    if len(form.points) != mesh.n_vertices:
        raise InputError(
            f"the form has {plural(len(form.points), 'point')}, but {mesh.name} has "
            f"{plural(mesh.n_vertices, 'vertex')}"
        )
