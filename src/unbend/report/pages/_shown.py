"""The part of a mesh that a page shows, decimated if it is large, and its arrays as short text."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from unbend._arrays import array_of, snap
from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.errors import InputError
from unbend.mesh import Mesh
from unbend.mesh.decimation import decimate
from unbend.preparation import join_seams

MOST_VERTICES = 60_000
# Positions are exact to 2^-14 of the longest side, a fraction of a pixel on any screen.
_STEPS = 2**14


class Shown(NamedTuple):
    """The part of a mesh that a page shows."""

    mesh: Mesh
    ids: IntArray  # (m,) vertices of the mesh that are shown, ascending
    faces: IntArray  # (f, 3) of the shown vertices
    stand_ins: IntArray  # (n,) shown vertex that stands for each of the mesh's; -1 for unused ones
    n_places: int  # of the used vertices, those at a seam counted once

    @property
    def places(self) -> FloatArray:
        """Positions (m, 3) of the shown vertices."""
        return self.mesh.vertices[self.ids]

    @property
    def size(self) -> str:
        """How large the whole mesh is."""
        return f"{self.mesh.n_vertices:,} vertices, {self.mesh.n_faces:,} faces"

    @property
    def facts(self) -> list[str]:
        """Sentences on what is not shown."""
        facts, n_unused = [], int((self.stand_ins < 0).sum())
        if n_unused:
            facts.append(f"{plural(n_unused, 'vertex')}, used by no face, not shown")
        if self.is_thinned:
            told = f"{len(self.ids):,} of {self.n_places:,} vertices are drawn"
            facts.append(f"{told}; all are computed on")
        return facts

    @property
    def is_thinned(self) -> bool:
        return len(self.ids) < self.n_places

    def packed(self) -> dict[str, Any]:
        """Pack positions, faces, and the numbers that the vertices have in the mesh."""
        return {
            "places": pack_places(self.places),
            "faces": pack_whole(self.faces),
            "ids": pack_whole(self.ids),
        }

    def moved(self, places: FloatArray) -> dict[str, Any]:
        """Pack other positions (n, 3) of all vertices, and the faces there, None where all are."""
        places = places[self.ids]
        inside = np.asarray(np.isfinite(places).all(axis=1))[self.faces].all(axis=1)
        faces = None if inside.all() else pack_whole(self.faces[inside])
        return {"places": pack_places(places), "faces": faces}


def show(mesh: Mesh, most: int = MOST_VERTICES) -> Shown:
    """Choose what is shown of a mesh with faces: about `most` vertices or fewer."""
    joined, number = join_seams(mesh)
    ids, corners = np.unique(joined.faces, return_inverse=True)
    faces, parents = corners.reshape(-1, 3).astype(np.int64), np.arange(len(ids))
    kept, n_places = np.arange(len(ids)), len(ids)
    if n_places > most:
        places = mesh.vertices[ids]
        kept, faces, parents = decimate(snap(places - places.mean(axis=0)), faces, most)
    stand_ins = np.full(mesh.n_vertices, -1)
    stand_ins[ids] = parents
    return Shown(mesh, ids[kept], faces, stand_ins[number], n_places)


def checked_landmarks(
    landmarks: npt.ArrayLike | Mapping[str, Any] | None, meshes: Sequence[Mesh]
) -> list[tuple[str, list[int]]]:
    """Labels of landmarks, by default numbers from 1, and the vertex of each on each mesh.

    Raises InputError if they are not on faces.
    """
    labels = None
    if isinstance(landmarks, Mapping):
        labels, landmarks = list(landmarks), list(landmarks.values())
    rows = array_of([] if landmarks is None else landmarks, "landmarks")
    if not rows.size:
        return []
    if rows.shape[1:] != (2,) * (len(meshes) - 1) or rows.ndim < 1 or rows.dtype.kind not in "iu":
        wanted = "pairs of vertices" if len(meshes) > 1 else "vertices"
        raise InputError(f"landmarks must be {wanted}, not {rows.dtype} of shape {rows.shape}")
    rows = rows.reshape(len(rows), -1)
    for mesh, column in zip(meshes, rows.T, strict=True):
        wrong = np.setdiff1d(column, mesh.faces)
        if len(wrong):
            raise InputError(
                f"landmark {wrong[0]} is no vertex of a face of {mesh.name}, which has "
                f"{plural(mesh.n_vertices, 'vertex')}, counted from 0"
            )
    return list(zip(labels or map(str, range(1, len(rows) + 1)), rows.tolist(), strict=True))


def pack_whole(numbers: npt.NDArray[Any]) -> dict[str, Any]:
    """Pack whole numbers (n,) or (n, c) whose differences down the columns fit into 32 bits.

    Each is stored as the difference from the one before, signs folded into the lowest bit, and
    bytes of equal weight together, which compresses well. For `unpack` in page.js.
    """
    table = numbers.reshape(len(numbers), -1).astype(np.int64)
    steps = np.diff(table, axis=0, prepend=0)
    folded = np.where(steps < 0, -2 * steps - 1, 2 * steps).astype("<u4")
    planes = folded.T.reshape(-1, 1).view(np.uint8).T.tobytes()
    data = base64.b64encode(zlib.compress(planes, 9)).decode("ascii")
    return {"columns": table.shape[1], "data": data}


def pack_places(places: FloatArray, step: float | None = None) -> dict[str, Any]:
    """Pack real numbers (n, c), rounded to a whole number of steps above each column's lowest.

    The step is by default a 16,384th of the widest column's range. Rows that are not finite become
    the lowest of the others. Adds ``low`` and ``step`` to what :func:`pack_whole` returns.
    """
    finite = np.asarray(np.isfinite(places).all(axis=1))
    low = places[finite].min(axis=0) if finite.any() else np.zeros(places.shape[1])
    above = np.where(finite[:, None], places - low, 0.0)
    step = step or max(float(above.max(initial=0)), 1e-300) / _STEPS
    whole = np.rint(above / step).astype(np.int64)
    return pack_whole(whole) | {"low": low.tolist(), "step": step}
