"""The mesh: vertices and faces, checked once, never changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from unbend._arrays import array_of, listed, sum_rows, unit_vectors
from unbend._display import table
from unbend._types import FloatArray, IntArray
from unbend.errors import InputError, MeshError
from unbend.mesh._topology import has_earlier_twin


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh, or a point cloud when it has no faces.

    Vertex order is never changed by unbend: row ``i`` of every per-vertex result belongs to
    row ``i`` of ``vertices``.

    Parameters
    ----------
    vertices : (n, 3) array_like of float
        Positions, in any unit of length.
    faces : (m, 3) array_like of int, optional
        0-based vertex indices of each triangle. None or empty: a point cloud.
    name : str, default="mesh"
        What messages call this mesh; the file's name when it was read from a file.
    notes : tuple of str, default=()
        What reading the mesh did to it ("12 quads split into triangles").

    Attributes
    ----------
    vertices : (n, 3) ndarray of float64, read-only
    faces : (m, 3) ndarray of int64, read-only

    Raises
    ------
    MeshError
        If an array has the wrong shape, a face names a vertex that does not exist, or a vertex
        in use is not finite. (One that no face uses need not be: its row becomes NaN.)

    Examples
    --------
    >>> from unbend import Mesh
    >>> Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    Mesh(3 vertices, 1 faces)
    """

    vertices: FloatArray
    faces: IntArray
    name: str = "mesh"
    notes: tuple[str, ...] = ()

    def __init__(
        self, vertices: Any, faces: Any = None, *, name: str = "mesh", notes: tuple[str, ...] = ()
    ) -> None:
        vertices = _vertex_array(vertices, name)
        faces = _face_array(faces, len(vertices), name)
        _check_finite(vertices, faces, name)
        state = {
            "vertices": vertices,
            "faces": faces,
            "name": name,
            "notes": tuple(listed(notes, "notes")),
        }
        self.__setstate__(state)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Read-only after copying and pickling, too: both give arrays that may be written."""
        self.__dict__.update(state)
        self.vertices.setflags(write=False)
        self.faces.setflags(write=False)

    @property
    def n_vertices(self) -> int:
        """Number of vertices, unreferenced ones included."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of triangles; 0 for a point cloud."""
        return len(self.faces)

    @property
    def is_point_cloud(self) -> bool:
        """Whether the mesh has no faces."""
        return len(self.faces) == 0

    def __repr__(self) -> str:
        if self.is_point_cloud:
            return f"Mesh({self.n_vertices} points)"
        return f"Mesh({self.n_vertices} vertices, {self.n_faces} faces)"

    def _repr_html_(self) -> str:
        if self.is_point_cloud:
            return table([("point cloud", self.name), ("points", f"{self.n_vertices:,}")])
        sizes = f"{self.n_vertices:,} vertices, {self.n_faces:,} faces"
        return table([("mesh", self.name), ("size", sizes)])


def _vertex_array(vertices: Any, name: str) -> FloatArray:
    if np.ma.is_masked(vertices):
        raise MeshError(f"{name}: some coordinates are masked; fill them, or leave such points out")
    try:
        given = np.asarray(vertices)
        array = np.array(given.real, dtype=np.float64, order="C")
    except (TypeError, ValueError, RuntimeError) as error:
        raise MeshError(f"{name}: vertices are not an array of numbers ({error})") from None
    if given.dtype.kind not in "iufO":
        raise MeshError(f"{name}: vertices must be real numbers, not {given.dtype}")
    if array.ndim != 2 or array.shape[1] != 3:
        raise MeshError(f"{name}: vertices must have shape (n, 3), not {array.shape}")
    return array


def _face_array(faces: Any, n_vertices: int, name: str) -> IntArray:
    if np.ma.is_masked(faces):
        raise MeshError(f"{name}: some faces are masked; leave such faces out")
    try:
        array = np.asarray([] if faces is None else faces)
    except ValueError:
        raise MeshError(
            f"{name}: faces name different numbers of vertices; triangulate them first"
        ) from None
    if array.size == 0:
        return np.empty((0, 3), dtype=np.int64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise MeshError(
            f"{name}: faces must have shape (m, 3), not {array.shape}; triangulate them first"
        )
    if not np.issubdtype(array.dtype, np.integer):
        raise MeshError(f"{name}: faces must be whole numbers (vertex indices), not {array.dtype}")
    # Faces of another mesh are shared: they never change.
    may_change = array.flags.writeable or array.base is not None
    faces = array.astype(np.int64, order="C", copy=may_change)
    outside = (faces < 0) | (faces >= n_vertices)
    if outside.any():
        face = np.flatnonzero(outside)[0] // 3
        raise MeshError(
            f"{name}: face {face} names vertex {array[outside][0]}, but the vertices are numbered "
            f"0 to {n_vertices - 1}; correct or remove that face"
        )
    return np.asarray(faces)


def _check_finite(vertices: FloatArray, faces: IntArray, name: str) -> None:
    infinite = ~np.isfinite(vertices).all(axis=1)
    used = np.full(len(vertices), len(faces) == 0)
    used[faces] = True
    bad = infinite & used
    if bad.any():
        vertex = int(bad.argmax())
        position = ", ".join(f"{x:g}" for x in vertices[vertex])
        n_others = int(bad.sum()) - 1
        others = f", and {n_others:,} more like it" if n_others else ""
        raise MeshError(
            f"{name}: vertex {vertex} is at ({position}), which is not a finite position; "
            f"correct or remove that vertex{others}"
        )
    vertices[infinite] = np.nan


def vertex_ids(vertices: Any, n: int, name: str) -> IntArray:
    """Check vertex numbers, one or a list, from 0 to ``n - 1``; return them as (s,) int64."""
    ids = np.atleast_1d(array_of(vertices, f"{name}: vertex ids"))
    if ids.ndim != 1 or not np.issubdtype(ids.dtype, np.integer):
        raise InputError(f"{name}: vertex ids must be a list of whole numbers, counted from 0")
    outside = (ids < 0) | (ids >= n)
    if outside.any():
        raise InputError(
            f"{name}: there is no vertex {ids[outside][0]}; vertices are numbered 0 to {n - 1}"
        )
    return ids.astype(np.int64)


def used_vertices(mesh: Mesh) -> FloatArray:
    """Positions (n, 3), NaN at vertices that no face uses; all of a point cloud."""
    if mesh.is_point_cloud:
        return mesh.vertices
    positions = np.full(mesh.vertices.shape, np.nan)
    positions[mesh.faces] = mesh.vertices[mesh.faces]
    return positions


def vertex_areas(mesh: Mesh) -> FloatArray:
    """Give each vertex, (n,), a third of the area of the faces around it; 1 in a point cloud.

    Repeated faces count once.
    """
    if mesh.is_point_cloud:
        return np.ones(mesh.n_vertices)
    faces = mesh.faces[~has_earlier_twin(mesh.faces)]
    shares = np.repeat(np.linalg.norm(face_normals(mesh.vertices, faces), axis=1) / 6, 3)
    return np.asarray(np.bincount(faces.ravel(), shares, mesh.n_vertices))


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Average the faces' normals, by area, at each vertex: (n, 3) of unit length, or 0."""
    at_corners = np.repeat(face_normals(vertices, faces), 3, axis=0)
    return unit_vectors(sum_rows(faces.ravel(), at_corners, len(vertices)))


def face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Compute the normals (m, 3) of faces, of twice their areas in length."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.asarray(np.cross(b - a, c - a))


def measure_corners(
    vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Measure what the cotangents of faces are made of, without cancellation on needles.

    Returns the dot product (m, 3) of the two edges that leave each corner, the squared length (m,
    3) of the edge that faces it, and twice the area (m,) of each face. The cotangent of a corner is
    the first over the last.
    """
    corners = vertices[faces]  # (m, 3 corners, 3 coordinates)
    facing = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    squared = np.einsum("mij,mij->mi", facing, facing)
    dots = -np.einsum("mij,mij->mi", np.roll(facing, -1, axis=1), np.roll(facing, -2, axis=1))
    every = np.arange(len(faces))
    # The dot products at the two ends of an edge add up to its square. Along the shortest edge both
    # suffer from rounding, so one is computed from the other: then their sum is right.
    shortest = squared.argmin(axis=1)
    one, other = (shortest + 1) % 3, (shortest + 2) % 3
    dots[every, other] = squared[every, shortest] - dots[every, one]
    # The cross product of the two shorter edges has the smallest rounding error.
    longest = squared.argmax(axis=1)
    normals = np.cross(facing[every, (longest + 1) % 3], facing[every, (longest + 2) % 3])
    return dots, squared, np.linalg.norm(normals, axis=1)
