"""The part of a mesh that computations run on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from unbend._arrays import coarse_steps, count_repeats, first_equal_row, is_whole
from unbend._text import plural
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.errors import InputError, MeshError
from unbend.io import MeshLike, as_mesh
from unbend.mesh import (
    Components,
    Edges,
    Mesh,
    count_non_manifold_vertices,
    find_components,
    find_edges,
    has_earlier_twin,
    has_repeated_index,
    measure_faces,
    proper_faces,
)

_LEAST_VERTICES = 4  # a shape in three dimensions has no fewer
# Times as far from the middle as most vertices are, that few are: positions are probably wrong.
_STRAY, _FEW = 1e4, 0.01
_NO_RESULT = "no values (NaN) and no partners (-1)"
_LEAST_SIZE, _MOST_SIZE = 1e-60, 1e60  # whose fourth powers double precision can hold


@dataclass(frozen=True, eq=False)
class Prepared:
    """The part of a mesh that computations run on."""

    mesh: Mesh  # the mesh that was given if all of it is kept
    kept: IntArray  # (n_kept,) vertices of the original mesh, increasing
    kept_faces: IntArray  # (m_kept,) faces of the original mesh, increasing
    number: IntArray  # (n_original,) the vertex that stands for each: itself, except at seams
    robust_needed: bool  # what is kept has flaws that the cotangent Laplacian cannot take
    notes: tuple[str, ...] = ()  # a sentence for each thing that was done or found

    def expand(self, values: FloatArray) -> FloatArray:
        """Give every original vertex, (n_original, ...), the value of what stands for it or NaN."""
        if len(self.kept) == len(self.number):
            return values
        expanded = np.full((len(self.number), *values.shape[1:]), np.nan)
        expanded[self.kept] = values
        return expanded[self.number]


def prepare(mesh: Mesh, *, component: str | int | None = None, connected: bool = True) -> Prepared:
    """Select the vertices that computations can run on, or say why there are none.

    Vertices that no face uses are left out, as are the components that were not chosen, faces that
    name a vertex twice, and faces of the same vertices as an earlier one, which would count the
    surface twice. Nothing else is: other degenerate faces stay, and vertices keep their order.

    The component is "largest", or a number: 0 is the largest. `connected` says that the computation
    needs a single one, so that seams are joined before components are told apart. Raises MeshError
    if no face has an area, fewer than 4 vertices are left, there are several components while one
    is needed and none was chosen, or the mesh is less than 1e-60 or more than 1e60 across;
    InputError if there is no such component.
    """
    if mesh.is_point_cloud:
        return _prepare_points(mesh, component)
    joined, number = join_seams(mesh)
    seams = describe_seams(number, connected)
    mesh, number = (joined, number) if connected else (mesh, np.arange(mesh.n_vertices))
    components = find_components(mesh.faces, mesh.n_vertices)
    n_components = len(components.n_vertices)
    if not n_components:
        raise _no_area(mesh.name)
    chosen = _chosen(component, n_components, mesh.name)
    if chosen is None and connected and n_components > 1:
        raise MeshError(
            f"{mesh.name}: the mesh has {n_components} separate components "
            f"(with {_sizes(components)}); keep one with --component largest "
            '(in Python: component="largest")'
        )
    notes = [seams] if seams else []
    keep = components.of_vertex >= 0
    if n_unused := int((~keep[number]).sum()):
        verb = "gets" if n_unused == 1 else "get"
        notes.append(f"{plural(n_unused, 'unreferenced vertex')} {verb} {_NO_RESULT}")
    if chosen is not None and n_components > 1:
        keep = components.of_vertex == chosen
        notes.append(
            f"component {chosen} of {n_components} was kept, {components.n_vertices[chosen]:,} of "
            f"{plural(mesh.n_vertices, 'vertex')}; the others get {_NO_RESULT}"
        )
    working, kept, kept_faces = restrict(mesh, keep)
    if len(kept) < _LEAST_VERTICES:
        raise MeshError(
            f"{mesh.name}: faces use only {plural(len(kept), 'vertex')}; a shape needs at least "
            f"{_LEAST_VERTICES}"
        )
    degenerate = measure_faces(working.vertices, working.faces)[0]
    if degenerate.all():
        raise _no_area(mesh.name)
    check_size(working)
    edges = find_edges(working.faces, working.n_vertices)
    problems = _problems(working, edges, int(degenerate.sum()))
    # Repeated faces are more than two at an edge, more than one fan at a vertex, or all there is.
    lone = (components.n_vertices == 3) & (components.n_faces > 1)
    if (problems or lone.any()) and (twice := has_earlier_twin(working.faces)).any():
        repeats = plural(int(twice.sum()), "face")
        notes.append(f"{repeats} left out, for repeating the vertices of another")
        working = Mesh(working.vertices, working.faces[~twice], name=mesh.name, notes=mesh.notes)
        kept_faces, degenerate = kept_faces[~twice], degenerate[~twice]
        edges = find_edges(working.faces, working.n_vertices)
        problems = _problems(working, edges, int(degenerate.sum()))
    if n_improper := int(has_repeated_index(mesh.faces).sum()):
        notes.append(f"{plural(n_improper, 'face')} left out, for naming a vertex twice")
    if problems:
        notes.append(f"robust Laplacian, because of {' and '.join(problems)}")
    if wrong := describe_positions(working, kept):
        notes.append(wrong)
    return Prepared(working, kept, kept_faces, number, bool(problems), tuple(notes))


def only_component(mesh: MeshLike, component: str | int | None) -> Mesh:
    """Keep the faces of one connected component, and every vertex.

    Parameters
    ----------
    mesh : mesh-like
    component : int or "largest" or None
        Components are numbered from 0, the one with the most vertices first. None keeps all faces.

    Returns
    -------
    Mesh

    Raises
    ------
    InputError
        If there is no such component.

    Examples
    --------
    >>> from unbend import Mesh
    >>> from unbend.preparation import only_component
    >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    >>> tetrahedron = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [9, 9, 9]]
    >>> only_component(Mesh(tetrahedron, faces), 0).n_faces
    4
    """
    mesh = as_mesh(mesh)
    if component is None:
        return mesh
    prepared = prepare(mesh, component=component)
    faces = mesh.faces[np.isin(prepared.number[mesh.faces], prepared.kept).all(axis=1)]
    return Mesh(mesh.vertices, faces, name=mesh.name, notes=mesh.notes)


def _prepare_points(mesh: Mesh, component: str | int | None) -> Prepared:
    _chosen(component, 1, mesh.name)
    repeats = count_repeats(mesh.vertices)
    distinct = mesh.n_vertices - repeats
    if distinct < _LEAST_VERTICES:
        raise MeshError(
            f"{mesh.name}: the points have only {plural(distinct, 'different position')}; a shape "
            f"needs at least {_LEAST_VERTICES}"
        )
    check_size(mesh)
    notes = [f"{plural(repeats, 'point')} at the position of another"] if repeats else []
    kept = np.arange(mesh.n_vertices)
    if wrong := describe_positions(mesh, kept):
        notes.append(wrong)
    return Prepared(mesh, kept, kept[:0], kept, False, tuple(notes))


def describe_positions(mesh: Mesh, numbers: IntArray) -> str:
    """Say so if a position, of those in use, is probably wrong, or all are rounded too much.

    All are if they are 32-bit numbers too far from the origin for detail. The numbers (n,) are
    those that vertices have for the user.
    """
    away = np.linalg.norm(mesh.vertices - np.median(mesh.vertices, axis=0), axis=1)
    most = np.median(away)
    if most > 0 and 0 < (away > _STRAY * most).mean() < _FEW:
        return (
            f"vertex {numbers[away.argmax()]} is {away.max() / most:.1g} times as far from the "
            "middle as most are; if that is wrong, correct it, or leave it out"
        )
    coarse = coarse_steps(mesh.vertices)
    with np.errstate(over="ignore"):
        if coarse is None or (mesh.vertices.astype(np.float32) != mesh.vertices).any():
            return ""
    step, apart = coarse
    return (
        f"positions are rounded to about {step:.1g}, and vertices are about {apart:.1g} apart; "
        "move the shape to the origin before saving it"
    )


def join_seams(mesh: Mesh) -> tuple[Mesh, IntArray]:
    """Give boundary vertices at one position one vertex, as where a texture cut a surface open.

    Returns the mesh, whose faces name the first of such vertices, and for each vertex (n,) the one
    that they name instead: itself, except at seams.
    """
    number = np.arange(mesh.n_vertices)
    if mesh.is_point_cloud or not count_repeats(mesh.vertices):
        return mesh, number
    edges = find_edges(proper_faces(mesh.faces), mesh.n_vertices)
    boundary = np.unique(edges.ends[edges.n_faces == 1])
    number[boundary] = boundary[first_equal_row(mesh.vertices[boundary])]
    return Mesh(mesh.vertices, number[mesh.faces], name=mesh.name, notes=mesh.notes), number


def describe_seams(number: IntArray, joined: bool = True) -> str:
    """Say so if :func:`join_seams`, whose `number` is given, found some."""
    n_doubled = int((number != np.arange(len(number))).sum())
    if not n_doubled:
        return ""
    verb = "has" if n_doubled == 1 else "have"
    return f"{plural(n_doubled, 'boundary vertex')} {verb} the position of another one: " + (
        "the surface is joined there, as at the seams of a texture"
        if joined
        else "the surface is cut open there; merge them if it should be whole"
    )


def check_area(mesh: Mesh) -> None:
    """Raise MeshError for a mesh of which no face has an area."""
    if measure_faces(mesh.vertices, mesh.faces)[0].all():
        raise _no_area(mesh.name)


def check_size(mesh: Mesh) -> None:
    """Refuse a mesh, all in use, if double precision cannot hold its size to the 4th power."""
    if not mesh.n_vertices:
        raise MeshError(f"{mesh.name}: there are no vertices")
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    size = float((high / 2 - low / 2).max()) * 2  # / 2: no difference overflows
    if not _LEAST_SIZE <= size <= _MOST_SIZE:
        raise MeshError(
            f"{mesh.name}: it is {size:.0e} across; give coordinates in a unit in which that is "
            f"between {_LEAST_SIZE:g} and {_MOST_SIZE:g}"
        )


def _no_area(name: str) -> MeshError:
    return MeshError(
        f"{name}: every face is degenerate (a point or a line); give a mesh whose faces have an "
        "area"
    )


def _chosen(component: str | int | None, n_components: int, name: str) -> int | None:
    if component is None:
        return None
    if component == "largest":
        return 0
    if not is_whole(component):
        raise InputError(f"component must be 'largest' or a whole number, not {component!r}")
    if not 0 <= component < n_components:
        raise InputError(
            f"{name}: there is no component {component}; the mesh has "
            f"{plural(n_components, 'component')}, numbered from 0, the most vertices first"
        )
    return int(component)


def _sizes(components: Components) -> str:
    *sizes, last = map(str, components.n_vertices[:5])
    more = len(components.n_vertices) - 5
    return f"{', '.join(sizes)} and {last} vertices{f', and {more} more' if more > 0 else ''}"


def restrict(mesh: Mesh, keep: BoolArray) -> tuple[Mesh, IntArray, IntArray]:
    """Keep some components: their vertices, in their order, and the proper faces between them.

    `keep` (n,) must be equal for all vertices of a face that names three. Returns the part, and the
    indices in the mesh of its vertices and of its faces.
    """
    kept = np.flatnonzero(keep).astype(np.int64)
    kept_faces = np.flatnonzero(keep[mesh.faces[:, 0]] & ~has_repeated_index(mesh.faces))
    if len(kept) == mesh.n_vertices and len(kept_faces) == mesh.n_faces:
        return mesh, kept, kept_faces
    number = np.cumsum(keep) - 1
    faces = number[mesh.faces[kept_faces]]
    part = Mesh(mesh.vertices[kept], faces, name=mesh.name, notes=mesh.notes)
    return part, kept, kept_faces


def _problems(mesh: Mesh, edges: Edges, n_degenerate: int) -> list[str]:
    found = (
        (n_degenerate, "degenerate face"),
        (int((edges.n_faces > 2).sum()), "non-manifold edge"),
        (count_non_manifold_vertices(mesh.faces, edges), "non-manifold vertex"),
    )
    return [plural(number, noun) for number, noun in found if number]
