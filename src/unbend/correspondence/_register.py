"""A template laid onto a scan: its own vertices and faces, on the other surface.

The template is deformed as rigidly as possible (Sorkine & Alexa, "As-rigid-as-possible surface
modeling", SGP 2007), every neighbourhood turned, and scaled as the bodies differ, towards the
closest points on the scan's faces, ever softer, as in Amberg, Romdhani & Vetter, "Optimal step
nonrigid ICP algorithms for surface registration", CVPR 2007. Closest points are found by walking
over the scan from where the match leads, so a leg is never caught by the leg beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from unbend._types import BoolArray, FloatArray, IntArray, Progress
from unbend.alignment import procrustes
from unbend.correspondence._fitting import Fit
from unbend.correspondence._landing import make_ground
from unbend.correspondence._transfer import as_point_map, positions_on_target
from unbend.deformation import ElasticSurface
from unbend.errors import InputError, MeshError
from unbend.io import MeshLike, as_mesh
from unbend.matching import Match, warn_of_disorder
from unbend.matching import match as find_match
from unbend.mesh import Mesh, vertex_areas, wind_alike

_COVERED = 0.1  # mean edges that a vertex on the scan may lie off it


@dataclass(frozen=True, eq=False)
class Registration:
    """A template that lies on a scan.

    Attributes
    ----------
    mesh : Mesh
        The template's vertices, in their order, and its faces; in the scan's coordinates and unit.
    distances : (n_template,) ndarray of float64
        Of each vertex to the scan's surface, in the scan's unit; NaN where no face uses it.
    covered : (n_template,) ndarray of bool
        Whether a vertex lies on the scan: within `tolerance`, and not where the scan ends.
    coverage : float
        Share of the area of `mesh` that is covered, 0 to 1.
    tolerance : float
        A tenth of the mean edge of `mesh`, in the scan's unit.
    confidence : float
        Of the match, see :class:`unbend.Match`; NaN where it was given as an array.
    """

    mesh: Mesh
    distances: FloatArray
    covered: BoolArray
    coverage: float
    tolerance: float
    confidence: float

    def __repr__(self) -> str:
        return (
            f"Registration({self.mesh.n_vertices} vertices, {self.coverage:.1%} on the scan, "
            f"confidence {self.confidence:.2f})"
        )


def register(
    template: MeshLike,
    scan: MeshLike,
    match: Match | npt.ArrayLike | None = None,
    *,
    progress: Progress | None = None,
) -> Registration:
    """Lay a template onto a scan: the template's vertices and faces on the scan's surface.

    What is known of the template, its skeleton, its landmarks, its statistics, is then known of
    the scan. Where the scan has nothing, as behind holes or on the side that no camera saw, the
    template goes on smoothly in its own shape.

    Parameters
    ----------
    template, scan : mesh-like
        Anything :func:`unbend.as_mesh` accepts, with faces. Units, positions, poses and
        proportions may differ.
    match : Match or (n_template,) array_like of int, optional
        From template to scan; or the scan's vertex of each template vertex, -1 where there is
        none. By default :func:`unbend.match` finds it.
    progress : callable, optional
        Called with a stage's name and the share of it that is done.

    Returns
    -------
    Registration

    Raises
    ------
    MeshError
        If a mesh cannot be used, or has only one side.
    InputError
        If a shape has no faces, or the match does not fit the shapes.

    Warns
    -----
    UnbendWarning
        Of a match that is in disorder, see :class:`unbend.Match`.

    See Also
    --------
    unbend.transfer : Carries values instead of a mesh.

    References
    ----------
    Sorkine & Alexa, "As-rigid-as-possible surface modeling", SGP 2007; Amberg, Romdhani &
    Vetter, "Optimal step nonrigid ICP algorithms for surface registration", CVPR 2007.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend import register
    >>> from unbend.datasets import make_sphere
    >>> ball = make_sphere(3)
    >>> egg = 50 * ball.vertices * [1, 1, 1.3]
    >>> found = register(ball, (egg, ball.faces), np.arange(len(egg)))
    >>> found.mesh, round(found.coverage, 3)
    (Mesh(642 vertices, 1280 faces), 1.0)
    """
    template, scan = as_mesh(template), as_mesh(scan)
    for mesh in (template, scan):
        if mesh.is_point_cloud:
            raise InputError(f"{mesh.name}: registering needs faces, and this is a point cloud")
    if match is None:
        match = find_match(template, scan, barycentric=True, progress=progress)
    elif isinstance(match, Match):
        warn_of_disorder(match)
    goal = positions_on_target(match, scan)
    if len(goal) != template.n_vertices:
        raise InputError(
            f"the map has {len(goal)} rows, but {template.name} has {template.n_vertices} vertices"
        )
    images = as_point_map(match)
    on_surface = np.zeros(scan.n_vertices, dtype=bool)
    on_surface[scan.faces] = True
    used = np.unique(template.faces)
    matched = (images[used] >= 0) & on_surface[images[used]]
    if matched.sum() < 4:
        raise InputError(
            f"fewer than 4 vertices of {template.name} have a partner on {scan.name}: "
            "nothing to go by"
        )
    goal = goal[used]
    rest, faces = template.vertices[used], np.searchsorted(used, _wound(template))
    areas = vertex_areas(template)[used]
    area = float(areas.sum())
    if not 0 < area < np.inf:
        raise MeshError(f"{template.name}: its area is {area:g}; give coordinates in another unit")
    # Both at the unit in which the template has unit area, as large as it is on the scan.
    size = np.sqrt(area) * _stretch(rest, goal, matched, faces)
    middle = goal[matched].mean(axis=0)
    surface = ElasticSurface((rest - rest.mean(axis=0)) / np.sqrt(area), faces, areas / area)
    seen = np.where(on_surface[:, None], scan.vertices - middle, 0) / size
    ground = make_ground(seen, _wound(scan))
    fit = Fit(surface, ground, images[used], (goal - middle) / size, matched)
    fit.run(progress)

    vertices = _carried_along(template.vertices, rest, fit.places * size + middle)
    vertices[used] = fit.places * size + middle
    off, there = fit.distances()
    tolerance = _COVERED * fit.edge
    distances = np.full(len(vertices), np.nan)
    distances[used] = off * size
    covered = np.zeros(len(vertices), dtype=bool)
    covered[used] = there & (off <= tolerance)
    mesh = Mesh(vertices, template.faces, name=f"{template.name} on {scan.name}")
    shares = vertex_areas(mesh)
    return Registration(
        mesh=mesh,
        distances=distances,
        covered=covered,
        coverage=float(shares[covered].sum() / shares.sum()),
        tolerance=tolerance * size,
        confidence=match.confidence if isinstance(match, Match) else float("nan"),
    )


def _wound(mesh: Mesh) -> IntArray:
    faces = wind_alike(mesh.vertices, mesh.faces)
    if faces is None:
        raise MeshError(
            f"{mesh.name}: the surface has only one side, like a Möbius strip, so inside and "
            "outside cannot be told apart on it; repair the mesh"
        )
    return faces


def _stretch(rest: FloatArray, goal: FloatArray, matched: BoolArray, faces: IntArray) -> float:
    """How much longer things are on the scan than on the template."""
    known = faces[matched[faces].all(axis=1)]
    if len(known):
        areas = (vertex_areas(Mesh(points, known)) for points in (rest, np.nan_to_num(goal)))
        before, after = (float(np.sqrt(one.sum())) for one in areas)
    else:  # partners are scattered
        before, after = _spread(rest[matched]), _spread(goal[matched])
    return after / before if before > 0 and after > 0 else 1.0


def _spread(points: FloatArray) -> float:
    return float(np.linalg.norm(points - points.mean(axis=0)))


def _carried_along(vertices: FloatArray, rest: FloatArray, places: FloatArray) -> FloatArray:
    """Move vertices that no face uses as the whole moves, by a similarity."""
    scale = _spread(places) / _spread(rest)
    turn, shift = procrustes(scale * rest, places, reflect=False)
    return np.asarray(scale * vertices @ turn.T + shift)
