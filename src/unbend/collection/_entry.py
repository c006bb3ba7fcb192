"""The row of one shape in a collection, computed from its file."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from unbend._arrays import first_largest
from unbend._types import FloatArray
from unbend.canonical import spread_samples
from unbend.collection._descriptor import DESCRIPTOR_VERSION, Basis, describe, make_basis
from unbend.collection._rows import Failure
from unbend.io import read_mesh
from unbend.mesh import vertex_areas
from unbend.report.raster import thumbnail

FORM_POINTS, FORM_COMPONENTS = 256, 3
_THUMBNAIL = 96  # pixels across

# Parameters of a row's numbers. Rows with other parameters cannot be compared.
PARAMETERS: Mapping[str, Any] = {
    "descriptor": DESCRIPTOR_VERSION,
    "form_points": FORM_POINTS,
    "form_components": FORM_COMPONENTS,
    "form_distance": "biharmonic",
    "form_weighting": "area",
}


def make_row(path: str, digest: str) -> dict[str, Any] | Failure:
    """Read a shape and compute its columns in the store; any error becomes its failure.

    `digest` is the hash of the file's bytes.
    """
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            mesh = read_mesh(path)
            basis = make_basis(mesh)
            descriptor, form = describe(basis), sample_form(basis)
        if not (np.isfinite(descriptor).all() and np.isfinite(form).all()):
            return Failure(path, "its description is not finite; try unbend check on it")
        notes = dict.fromkeys([*mesh.notes, *(str(one.message) for one in caught)])
        return {
            "id": digest,
            "path": path,
            "n_vertices": mesh.n_vertices,
            "n_faces": mesh.n_faces,
            "area": float(vertex_areas(mesh).sum()) if mesh.n_faces else 0.0,
            "notes": "; ".join(note.removeprefix(f"{mesh.name}: ") for note in notes),
            "version": DESCRIPTOR_VERSION,
            "descriptor": descriptor,
            "form": form.astype(np.float32).ravel(),
            "thumbnail": thumbnail(mesh, _THUMBNAIL),
        }
    except Exception as error:  # of any kind: other meshes go on
        return Failure.of(path, error)


def sample_form(basis: Basis) -> FloatArray:
    """Sample the canonical form at its farthest points, the same number for all shapes.

    Weighted by area, the exact form of biharmonic distances is the eigenfunctions, each divided
    by its eigenvalue. Points repeat where the surface has fewer vertices.
    """
    kept = slice(1, 1 + FORM_COMPONENTS)
    points = basis.functions[:, kept] / basis.values[kept]
    points = np.pad(points, ((0, 0), (0, FORM_COMPONENTS - points.shape[1])))
    start = int(first_largest((points**2).sum(axis=1)))
    taken = spread_samples(
        lambda sources: np.linalg.norm(points[None] - points[sources, None], axis=2),
        len(points),
        min(len(points), FORM_POINTS),
        start,
    ).indices
    return points[np.resize(taken, FORM_POINTS)]
