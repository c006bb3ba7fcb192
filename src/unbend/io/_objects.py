"""Meshes of other programs, known by their attributes: none of them is imported."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from unbend._types import StrPath
from unbend.errors import InputError
from unbend.io.formats.contents import triangulate
from unbend.mesh import Mesh


class HasVertices(Protocol):
    """A mesh of trimesh or Open3D."""

    @property
    def vertices(self) -> Any:
        """Positions, (n, 3)."""


class HasPoints(Protocol):
    """A mesh of PyVista or meshio, or the points of Open3D."""

    @property
    def points(self) -> Any:
        """Positions, (n, 3)."""


MeshLike: TypeAlias = (
    Mesh | StrPath | Sequence[npt.ArrayLike] | npt.NDArray[Any] | HasVertices | HasPoints
)
"""Whatever is taken for a mesh: see :func:`as_mesh`."""


def mesh_of(given: Any) -> Mesh | None:
    """Make a mesh of an object of trimesh, Open3D, meshio, PyVista or VTK; None if it is none."""
    if hasattr(given, "vertices"):
        for faces in ("faces", "triangles"):  # trimesh; Open3D
            if hasattr(given, faces):
                return Mesh(np.asarray(given.vertices), np.asarray(getattr(given, faces)))
        if hasattr(given, "colors"):  # trimesh's points
            return Mesh(np.asarray(given.vertices))
    if hasattr(given, "to_legacy"):  # Open3D's tensors
        return mesh_of(given.to_legacy())
    if hasattr(given, "extract_surface") and not hasattr(given, "GetPolys"):  # PyVista
        raise InputError(f"{type(given).__name__} is not a surface: give its extract_surface()")
    if hasattr(given, "points") and hasattr(given, "cells_dict"):  # meshio
        points = np.asarray(given.points)
        cells = [block for block in given.cells if block.type in ("triangle", "quad", "polygon")]
        others = sorted({block.type for block in given.cells} - {one.type for one in cells})
        if others and not cells:
            raise InputError(f"a mesh of {', '.join(others)} has no surface: give its triangles")
        flat = [np.asarray(row) for block in cells for row in block.data]
        if points.shape[1] == 2:
            points = np.column_stack([points, np.zeros(len(points))])
        found = _from_polygons(points, [len(row) for row in flat], np.concatenate([[], *flat]))
        left = (f"cells left out: {', '.join(others)}",) if others else ()
        return Mesh(found.vertices, found.faces, notes=found.notes + left)
    if hasattr(given, "GetPoints") and hasattr(given, "GetPolys"):  # VTK, PyVista
        points = given.GetPoints()
        polygons = given.GetPolys()
        if given.GetNumberOfStrips():
            raise InputError("triangle strips are not read: apply vtkTriangleFilter first")
        sizes = np.diff(np.asarray(polygons.GetOffsetsArray()))
        corners = np.asarray(polygons.GetConnectivityArray())
        positions = np.asarray(points.GetData()) if points else np.empty((0, 3))
        return _from_polygons(positions, sizes, corners)
    if hasattr(given, "points") and hasattr(given, "estimate_normals"):  # Open3D's points
        return Mesh(np.asarray(given.points))
    return None


def _from_polygons(points: Any, sizes: npt.ArrayLike, corners: npt.NDArray[Any]) -> Mesh:
    faces, notes = triangulate(
        np.asarray(sizes, dtype=np.int64),
        corners.astype(np.int64),
        np.asarray(points, dtype=np.float64),
    )
    return Mesh(points, faces, notes=tuple(notes))
