"""A mesh made ready for computation: one connected surface of unit area and its Laplacian."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse.csgraph as csgraph

from unbend._types import IntArray
from unbend.choices import AreaKind, LaplacianKind
from unbend.errors import InputError, MeshError, SolverError, warn
from unbend.io import MeshLike, as_mesh
from unbend.mesh import Mesh, vertex_ids
from unbend.preparation import Prepared, prepare
from unbend.spectral._laplacian import Laplacian, choose_kind, operator_of


@dataclass(frozen=True, eq=False)
class Surface:
    """What every computation on a mesh starts from."""

    prepared: Prepared  # the vertices in use, and where they stand in the whole mesh
    operator: Laplacian  # of the vertices in use, with areas that sum to one
    area: float  # in squared units of length
    area_kind: str  # "voronoi" or "barycentric"

    @property
    def mesh(self) -> Mesh:
        """The part of the mesh that is in use, in its own unit of length."""
        return self.prepared.mesh

    @property
    def n_vertices(self) -> int:
        """Number of vertices in use."""
        return len(self.operator.areas)


def make_surface(
    mesh: MeshLike,
    *,
    laplacian: LaplacianKind = "auto",
    area_kind: AreaKind = "voronoi",
    component: str | int | None = None,
    connected: bool = True,
) -> Surface:
    """Check a mesh, choose its component, and build its Laplacian at unit area.

    `connected` says that a single component is needed. Warns of each thing that was done to it.
    """
    prepared = prepare(as_mesh(mesh), component=component, connected=connected)
    for note in prepared.notes:
        warn(f"{prepared.mesh.name}: {note}")
    kind = choose_kind(laplacian, prepared)
    operator = operator_of(prepared.mesh, prepared.kept_faces, kind, area_kind)
    area = float(operator.areas.sum())
    name = prepared.mesh.name
    # The cotangent Laplacian joins what the faces join; others look further or less far.
    look = connected and operator.kind != "cotangent"
    pieces = csgraph.connected_components(operator.stiffness, directed=False)[0] if look else 1
    if pieces > 1:
        raise MeshError(
            f"{name}: its Laplacian falls into {pieces} pieces; bridge the gaps between its points"
        )
    unit = Laplacian(operator.stiffness, operator.areas / area, operator.kind)
    return Surface(prepared, unit, area, area_kind)


@contextmanager
def named(surface: Surface) -> Iterator[None]:
    """Let errors of solvers name the mesh, and say what may help."""
    try:
        yield
    except SolverError as error:
        sentence = f"{surface.mesh.name}: {error}"
        if surface.operator.kind == "cotangent":
            sentence += '; if its faces are very thin, mesh it anew, or try the "robust" Laplacian'
        raise SolverError(sentence) from error


def local_ids(surface: Surface, vertices: Any) -> IntArray:
    """Turn vertex ids of the whole mesh, at least one, into ids among the vertices in use."""
    kept = surface.prepared.kept
    ids = vertex_ids(vertices, len(surface.prepared.number), surface.mesh.name)
    if not len(ids):
        raise InputError(f"{surface.mesh.name}: name at least one vertex")
    joined = surface.prepared.number[ids]
    local = np.minimum(np.searchsorted(kept, joined), len(kept) - 1)
    unused = kept[local] != joined
    if unused.any():
        raise InputError(
            f"{surface.mesh.name}: vertex {ids[unused][0]} is not part of the surface; "
            "no face of the chosen component uses it"
        )
    return local.astype(np.int64)
