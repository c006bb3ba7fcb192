"""From meshes to the matcher's arrays, and back to the meshes' vertices."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from unbend._memory import check_memory
from unbend._parallel import run_all
from unbend._text import plural
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.deformation import closest_faces
from unbend.errors import InputError, MeshError, heard, warn
from unbend.io import MeshLike, as_mesh
from unbend.matching import _constants as constants
from unbend.matching._shape import Shape, longest_piece, make_shape
from unbend.mesh import (
    LIKELY_OUTWARD,
    Mesh,
    find_components,
    find_edges,
    measure_corners,
    orient_consistently,
    outwardness,
    proper_faces,
    vertex_areas,
)
from unbend.mesh.refinement import refine
from unbend.preparation import describe_seams, join_seams, restrict, surface_of_points
from unbend.spectral import Surface, eigenpairs, make_surface

# Vertices of all meshes, above which the spectrum of one keeps every core busy and those of several
# at once would take more memory than time.
_SIDE_BY_SIDE = 200_000
_LONGEST = constants.LIMB / 4  # Longer edges are split: a map says nothing of what is between.
_NEARLY_LARGEST = 0.75  # With so large a share of its vertices, another mesh may change the order.
_WIDER = 1.1  # times the area of the component with most vertices, from which another is wider


class Input(NamedTuple):
    """A mesh or a point cloud that is to be matched.

    What stands for a vertex of the mesh is itself, or on smaller components and in a point cloud
    the nearest vertex of `shape`; -1 at vertices that no face uses, at outliers, and on smaller
    components farther away than a limb is thick.
    """

    surface: Surface  # its largest component, or that of points; checked, split where coarse
    shape: Shape  # the same, as the matcher takes it
    kept: IntArray  # (k,) the mesh's vertex, or nearest point, that each of the first of `shape` is
    representatives: IntArray  # (n,) what stands for each vertex of the mesh
    away: FloatArray  # (n,) how far from it that is, in square roots of the area
    areas: FloatArray  # (n,) of the mesh or the cloud's surface, smaller components included
    own_faces: IntArray | None  # (m,) the mesh's face that each of `shape` lies on; of points, None
    own_corners: IntArray  # (m, 3) the vertices of `shape` that are its corners, in its winding
    corners: FloatArray | BoolArray  # (m, 3, 3) where on it each corner is, as weights of these
    uncut: Input | None = None  # the mesh as it is, if `surface` has parts of it cut apart

    def local(self, vertices: IntArray) -> IntArray:
        """Turn vertices of the mesh into those of `shape` that stand for them."""
        name = self.surface.mesh.name
        found = self.representatives[vertices]
        if (found < 0).any():
            vertex = vertices[found < 0][0]
            why = "not on its surface"
            if self.away[vertex] > constants.LIMB:
                why = "far from the largest component, which is matched"
            raise InputError(f"{name}: vertex {vertex} is {why}; name another")
        return found

    def on_own_faces(self, faces: IntArray, weights: FloatArray) -> tuple[IntArray, FloatArray]:
        """Turn points on faces of `shape` into points on faces of a mesh that has faces."""
        assert self.own_faces is not None
        return self.own_faces[faces], np.einsum("ikj,ik->ij", self.corners[faces], weights)

    def on_uncut_faces(
        self, faces: IntArray, weights: FloatArray, partners: IntArray
    ) -> tuple[IntArray, FloatArray]:
        """Turn points on faces of `shape` into the nearest on faces of `uncut` around its vertices.

        These are the partners (n,), given as vertices of `shape`.
        """
        assert self.uncut is not None
        whole, places = self.uncut, self.surface.mesh.vertices
        points = np.einsum("ij,ijk->ik", weights, places[self.shape.faces[faces]])
        nearest = whole.representatives[self.kept[partners]]
        around = whole.surface.mesh.vertices, whole.shape.faces, whole.shape.fans, nearest
        return closest_faces(points, *around)


class _Checked(NamedTuple):
    """The surface of a mesh's largest component or of points."""

    surface: Surface
    faces: IntArray  # of the surface, oriented consistently
    outward: float  # how surely they face outward
    kept: IntArray  # this and the following as of an Input
    representatives: IntArray
    away: FloatArray
    areas: FloatArray
    own_faces: IntArray | None
    own_corners: IntArray
    corners: FloatArray | BoolArray


def prepare_shape(
    mesh: MeshLike, n_eigenpairs: int, partial: bool = False, columns: int = 0
) -> Input:
    """Check a mesh, compute its eigenpairs and normalise it; see :func:`prepare_shapes`."""
    (checked,) = _outward([_check(as_mesh(mesh))])
    _check_memory([checked], columns)
    return prepare(checked, n_eigenpairs, partial)


def prepare_shapes(
    meshes: Sequence[MeshLike], n_eigenpairs: int, partial: Sequence[bool], columns: int = 0
) -> list[Input]:
    """Check meshes one after the other; then, if they are not large, prepare them side by side.

    Raises MeshError if there is not the memory for so many columns of numbers for each vertex.
    """
    checked = _outward([_check(as_mesh(mesh)) for mesh in meshes])
    _check_memory(checked, columns)
    inward, outward = sorted((checked[0], checked[-1]), key=lambda one: one.outward)
    if inward.outward < -LIKELY_OUTWARD and outward.outward > LIKELY_OUTWARD:
        one, other = inward.surface.mesh.name, outward.surface.mesh.name
        warn(
            f"the faces of {one} seem to be oriented inward, as far as its holes show, and those "
            f"of {other} outward; if so, the map exchanges left and right: turn the faces of one"
        )
    tasks = [
        functools.partial(prepare, one, n_eigenpairs, part)
        for one, part in zip(checked, partial, strict=True)
    ]
    if sum(one.surface.n_vertices for one in checked) > _SIDE_BY_SIDE:
        return [task() for task in tasks]
    return run_all(tasks)


def _check_memory(checked: Sequence[_Checked], columns: int) -> None:
    names = " and ".join(one.surface.mesh.name for one in checked)
    check_memory(names, sum(one.surface.n_vertices for one in checked), columns)


def led(inputs: Sequence[Input], pairs: IntArray) -> list[Input]:
    """Give landmarks (l, 2) to the shapes; if there are none, these stay the same objects."""
    if not len(pairs):
        return list(inputs)
    return [
        one._replace(shape=one.shape.led(one.local(vertices)))
        for one, vertices in zip(inputs, pairs.T, strict=True)
    ]


def _check(mesh: Mesh) -> _Checked:
    if mesh.is_point_cloud:
        return check_points(mesh)
    joined, number = join_seams(mesh)
    largest, kept, own_faces = _largest(mesh, joined, number)
    surface = make_surface(largest)
    kept = kept[surface.prepared.kept]
    own_faces = own_faces[surface.prepared.kept_faces]
    faces = orient_consistently(surface.mesh.vertices, surface.mesh.faces)
    if faces is None:
        raise MeshError(
            f"{mesh.name}: the surface has only one side, like a Möbius strip, so left and right "
            "cannot be told apart on it; repair the mesh"
        )
    outward = outwardness(surface.mesh.vertices, faces)
    found = np.full(mesh.n_vertices, -1)
    found[kept] = np.arange(len(kept))
    others = np.setdiff1d(proper_faces(joined.faces), kept)
    found[others] = cKDTree(mesh.vertices[kept]).query(mesh.vertices[others])[1]
    found = found[number]
    away = _away(mesh, surface, kept, found)
    found[away > constants.LIMB] = -1
    own_corners = found[joined.faces[own_faces]]
    corners = faces[:, :, None] == own_corners[:, None, :]
    places = outward, kept, found, away, vertex_areas(mesh)
    checked = surface, faces, *places, own_faces, own_corners, corners
    return _without_long_edges(_Checked(*checked))


def _outward(shapes: list[_Checked]) -> list[_Checked]:
    """Turn faces that are oriented inward: for sure, or likely, if those of another are for sure.

    Of two open cups, the deeper one may be sure, and both are from one program.
    """
    least = -LIKELY_OUTWARD if min(one.outward for one in shapes) < -1 else -1.0
    for i, one in enumerate(shapes):
        if one.outward < least:
            warn(
                f"{one.surface.mesh.name}: its faces are oriented inward; they are turned. If its "
                "coordinates are mirrored instead, as by exchanging two axes, the map exchanges "
                "left and right"
            )
            shapes[i] = one._replace(
                faces=one.faces[:, ::-1], outward=-one.outward, corners=one.corners[:, ::-1]
            )
    return shapes


def check_points(cloud: Mesh) -> _Checked:
    found = surface_of_points(cloud)
    faces, point, vertex = found.mesh.faces, found.point_of_vertex, found.vertex_of_point
    areas = np.zeros(cloud.n_vertices)
    areas[point] = vertex_areas(found.mesh)
    off = vertex < 0
    if off.mean() > constants.SMALLEST_PART:  # more than outliers
        areas[off] = areas.sum() / (~off).sum()
        told = f"{off.sum():,} of {len(off):,} points are not on the largest piece of its surface"
        warn(f"{cloud.name}: {told}, which is matched: -1 in a map")
    elif off.any():
        verb = "point is" if off.sum() == 1 else "points are"
        warn(f"{cloud.name}: {off.sum()} {verb} not on its surface: -1 in a map")
    surface = make_surface(found.mesh)
    away = _away(cloud, surface, point, vertex)
    corners = np.broadcast_to(np.eye(3, dtype=bool), (len(faces), 3, 3))
    checked = surface, faces, np.inf, point, vertex, away, areas, None, faces, corners
    return _without_long_edges(_Checked(*checked))


def _without_long_edges(given: _Checked) -> _Checked:
    """Split long edges if they surround most of the area of a whole shape; parts get no better.

    A shape counts as whole if no rim is longer than `LIMB`; a missing face leaves a shorter one.
    """
    mesh, size = given.surface.mesh, np.sqrt(given.surface.area)
    _, squares, areas = measure_corners(mesh.vertices, given.faces)
    if areas[squares.max(axis=1) > (_LONGEST * size) ** 2].sum() < areas.sum() / 2:
        return given
    edges = find_edges(given.faces, mesh.n_vertices)
    if longest_piece(mesh.vertices, edges.ends[edges.n_faces == 1]) > constants.LIMB * size:
        return given
    found = refine(mesh.vertices, given.faces, _LONGEST * size)
    with heard():  # all was told of the mesh itself
        surface = make_surface(Mesh(found.vertices, found.faces, name=mesh.name))
    return given._replace(
        surface=surface,
        faces=found.faces,
        own_faces=None if given.own_faces is None else given.own_faces[found.parents],
        own_corners=given.own_corners[found.parents],
        corners=found.corners @ given.corners[found.parents],
    )


def _away(mesh: Mesh, surface: Surface, kept: IntArray, representatives: IntArray) -> FloatArray:
    """How far vertices (n,) are from those that stand for them, in square roots of the area."""
    away, used = np.zeros(mesh.n_vertices), representatives >= 0
    off = mesh.vertices[used] - mesh.vertices[kept[representatives[used]]]
    away[used] = np.linalg.norm(off, axis=1) / np.sqrt(surface.area)
    return away


def prepare(checked: _Checked, n_eigenpairs: int, partial: bool) -> Input:
    surface = checked.surface
    pairs = eigenpairs(surface, min(n_eigenpairs, surface.n_vertices // 2))
    found = pairs.areas, pairs.eigenvalues, pairs.eigenfunctions
    shape = make_shape(surface.mesh.vertices, checked.faces, *found, partial)
    return Input(surface, shape, *checked[3:])


def expand(point_map: IntArray, overlap: BoolArray, source: Input, target: Input) -> IntArray:
    """Turn a map to kept vertices into one between all vertices of the meshes, -1 where none."""
    images = np.where(overlap, target.kept[point_map], -1)
    return np.asarray(expand_rows(images, source, -1))


def expand_rows(rows: Any, source: Input, missing: float) -> Any:
    """From vertices in use to all vertices, the rest marked as missing."""
    full = rows[source.representatives]
    full[source.representatives < 0] = missing
    return full


def _largest(mesh: Mesh, joined: Mesh, number: IntArray) -> tuple[Mesh, IntArray, IntArray]:
    """Take the largest component, its vertices and its faces; say so if there are more."""
    components = find_components(joined.faces, mesh.n_vertices)
    n_others = len(components.n_vertices) - 1
    if n_others < 1:
        return mesh, np.arange(mesh.n_vertices), np.arange(mesh.n_faces)
    if seams := describe_seams(number):
        warn(f"{mesh.name}: {seams}")
    choice = ""
    if wider := wider_component(joined):
        choice = f"; component {wider} has a larger area: if that is the body, match it instead"
    elif components.n_vertices[1] > _NEARLY_LARGEST * components.n_vertices[0]:
        choice = "; component 1 is nearly as large, so another file's largest may be another part"
    warn(
        f"{mesh.name}: its largest component is matched, {components.n_vertices[0]:,} of "
        f"{plural(mesh.n_vertices, 'vertex')}; {plural(n_others, 'smaller component')} "
        f"{'takes' if n_others == 1 else 'take'} the partners of the nearest vertices "
        f"there, or none where far away{choice}"
    )
    return restrict(joined, components.of_vertex == 0)


def wider_component(mesh: Mesh) -> int:
    """Component of the largest area, if clearly more than that with most vertices; or 0."""
    components = find_components(mesh.faces, mesh.n_vertices)
    areas = np.bincount(components.of_vertex + 1, vertex_areas(mesh))[1:]
    return int(areas.argmax()) if areas.max(initial=0) > _WIDER * areas[:1].sum() else 0
