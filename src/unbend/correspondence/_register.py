"""Registration of a template to a scan: see `_fitting.py` for the method."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from unbend._display import confidence_told
from unbend._types import BoolArray, FloatArray, IntArray, Progress, StrPath
from unbend.correspondence._fitting import Fit
from unbend.correspondence._projection import make_target
from unbend.correspondence._transfer import as_point_map, positions_on_target, warn_of_match
from unbend.deformation import ElasticSurface
from unbend.errors import InputError, MeshError
from unbend.io import COLOR_SUFFIXES, SCALAR_SUFFIXES, MeshLike, as_mesh, value_colors, write_mesh
from unbend.matching import Match
from unbend.matching import match as find_match
from unbend.mesh import (
    Mesh,
    find_components,
    has_earlier_twin,
    orient_consistently,
    proper_faces,
    used_vertices,
    vertex_areas,
)
from unbend.preparation import join_seams, surface_of_points

_COVERED = 0.1  # mean edges that a vertex on the scan may lie off it
_SPECK = 1e-6  # of the area, of a component too small to deform: it follows what is nearest


@dataclass(frozen=True, eq=False)
class Registration:
    """A template registered to a scan.

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
    scan_coverage : float
        Share of the scan's area that lies within a mean edge of `mesh`, 0 to 1. It is low where the
        template lacks what the scan has.
    tolerance : float
        A tenth of the mean edge of `mesh`, in the scan's unit.
    confidence : float
        Of the match, see :class:`unbend.Match`; NaN where it was given as an array.
    """

    mesh: Mesh
    distances: FloatArray
    covered: BoolArray
    coverage: float
    scan_coverage: float
    tolerance: float
    confidence: float

    def __repr__(self) -> str:
        return (
            f"Registration({self.mesh.n_vertices} vertices, {self.coverage:.1%} on the scan, "
            f"confidence {confidence_told(self.confidence)})"
        )


def register(
    template: MeshLike,
    scan: MeshLike,
    match: Match | npt.ArrayLike | None = None,
    *,
    progress: Progress | None = None,
) -> Registration:
    """Register a template to a scan: deform it so that it lies on the scan's surface.

    Whatever is known of the template's vertices, such as a skeleton or landmarks, is then known of
    the scan. Where the scan has no surface, such as in holes or on the side that no camera saw,
    the template continues smoothly in its own shape. Vertices that no face uses, such as joints of
    a skeleton or nodes inside a solid, move with the surface around them.

    Parameters
    ----------
    template, scan : mesh-like
        Anything :func:`unbend.as_mesh` accepts. The template needs faces; a surface is
        reconstructed for a scan that is a point cloud. Units, positions, poses and
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
        If the template has no faces, or the match does not fit the shapes.

    Warns
    -----
    UnbendWarning
        Of a match that is wrong in part, or whose parts differ in size, or that is a
        reflection, see :class:`unbend.Match`.

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
    template, scan = as_mesh(template, "template"), as_mesh(scan, "scan")
    check_template(template)
    if match is None:
        scan = surface_of_points(scan).mesh if scan.is_point_cloud else scan
        match = find_match(template, scan, barycentric=True, progress=progress)
    else:
        warn_of_match(match, template)
    goal = positions_on_target(match, scan, template)
    images = as_point_map(match)
    if scan.is_point_cloud:
        points = surface_of_points(scan)
        images = np.where(images < 0, -1, points.vertex_of_point[images])
        scan = points.mesh
    whole, number = join_seams(template)
    scan, of_scan = join_seams(scan)
    images = np.where(images < 0, -1, of_scan[images])
    used = np.unique(proper_faces(whole.faces))
    rest, faces = whole.vertices[used], np.searchsorted(used, _oriented(whole))
    areas = vertex_areas(whole)[used]
    area = float(areas.sum())
    if not 0 < area < np.inf:
        raise MeshError(f"{template.name}: its area is {area:g}; give coordinates in another unit")
    parts = find_components(faces, len(used)).of_vertex
    large = (np.bincount(parts, areas) > _SPECK * area)[parts]
    goal = goal[used]
    matched = np.isin(images[used], scan.faces) & large & np.isfinite(goal).all(axis=1)
    if matched.sum() < 4:
        raise InputError(
            f"fewer than 4 vertices of {template.name} have a partner on {scan.name}, "
            "too few to register it"
        )
    # In units in which the template, scaled to the scan, has unit area.
    size = np.sqrt(area) * _scale(rest, goal, matched, faces)
    middle = goal[matched].mean(axis=0)
    before = (whole.vertices - rest.mean(axis=0)) / np.sqrt(area)
    surface = ElasticSurface(before[used], faces, areas / area)
    seen = np.nan_to_num(used_vertices(scan) - middle) / size
    target = make_target(seen, _oriented(scan))
    fit = Fit(surface, target, images[used], (goal - middle) / size, matched)
    fit.run(progress)
    places = np.full_like(before, np.nan)
    places[used] = fit.places
    unused = np.setdiff1d(number, used)  # but for copies along seams
    places[unused] = fit.carried(before[unused])
    vertices = places * size + middle
    tolerance = _COVERED * fit.edge
    off, near = fit.distances(tolerance)
    distances = np.full(len(vertices), np.nan)
    distances[used] = off * size
    covered = np.zeros(len(vertices), dtype=bool)
    covered[used] = near
    vertices, distances, covered = vertices[number], distances[number], covered[number]
    mesh = Mesh(vertices, template.faces, name=f"template on {scan.name}")
    return Registration(
        mesh=mesh,
        distances=distances,
        covered=covered,
        coverage=float(np.average(covered, weights=vertex_areas(mesh))),
        scan_coverage=fit.target_coverage(),
        tolerance=tolerance * size,
        confidence=match.confidence if isinstance(match, Match) else float("nan"),
    )


def check_template(template: Mesh) -> None:
    """Raise InputError if a template is a point cloud, before it is matched."""
    if template.is_point_cloud:
        raise InputError(f"{template.name}: a template needs faces, and this is a point cloud")


def write_registration(
    path: StrPath, registration: Registration, *, like: StrPath | None = None
) -> None:
    """Write the mesh of a registration, coloured by the distance of its vertices from the scan.

    Vertices farther than the tolerance are yellow. .ply and .vtp files have the values
    ``distance``, too; .off and .stl files have no colours. With `like`, the template's .obj file,
    its lines are kept, and there are no colours. Raises FileError if the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    distances, tolerance = registration.distances, registration.tolerance
    colored = suffix in COLOR_SUFFIXES and like is None
    write_mesh(
        path,
        registration.mesh,
        scalars={"distance": distances} if suffix in SCALAR_SUFFIXES else None,
        colors=value_colors(distances, limits=(0, tolerance)) if colored else None,
        like=like,
    )


def _oriented(mesh: Mesh) -> IntArray:
    proper = proper_faces(mesh.faces)
    faces = orient_consistently(mesh.vertices, proper[~has_earlier_twin(proper)])
    if faces is None:
        raise MeshError(
            f"{mesh.name}: the surface has only one side, like a Möbius strip, so inside and "
            "outside cannot be told apart on it; repair the mesh"
        )
    return faces


def _scale(rest: FloatArray, goal: FloatArray, matched: BoolArray, faces: IntArray) -> float:
    """Ratio of lengths on the scan to lengths on the template."""
    known = faces[matched[faces].all(axis=1)]
    if len(known):
        areas = (vertex_areas(Mesh(points, known)) for points in (rest, np.nan_to_num(goal)))
        before, after = (float(np.sqrt(one.sum())) for one in areas)
    else:  # partners are scattered
        before, after = _extent(rest[matched]), _extent(goal[matched])
    return after / before if before > 0 and after > 0 else 1.0


def _extent(points: FloatArray) -> float:
    return float(np.linalg.norm(points - points.mean(axis=0)))
