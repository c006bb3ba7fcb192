"""What is wrong with a mesh."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from unbend._arrays import count_repeats
from unbend._display import Brief
from unbend.errors import MeshError
from unbend.io import MeshLike, as_mesh
from unbend.mesh import (
    LIKELY_OUTWARD,
    count_non_manifold_vertices,
    find_components,
    find_edges,
    has_earlier_twin,
    measure_faces,
    orient_consistently,
    outwardness,
    proper_faces,
)
from unbend.preparation._prepare import join_seams, prepare


@dataclass(frozen=True, repr=False)
class Diagnosis(Brief):
    """The health of a mesh, whose seams are joined, as returned by :func:`diagnose`.

    Attributes
    ----------
    n_vertices, n_faces : int
    component_vertices, component_faces : tuple of int
        Vertices and faces of each connected component, the most vertices first. Two faces are
        connected if they share a vertex. Empty for a point cloud.
    boundary_edges : int
        Edges with a single face.
    boundary_loops : int
        Connected groups of boundary edges; loops that touch at a vertex count as one.
    non_manifold_edges : int
        Edges with more than two faces.
    non_manifold_vertices : int
        Vertices whose faces form more than one fan.
    inconsistent_edges : int
        Edges whose two faces are oriented against each other.
    one_sided : bool
        Whether the surface is non-orientable, like a Möbius strip, apart from short seams at twists
        that are smaller than any detail: :func:`unbend.match` refuses it.
    inside_out : bool
        Whether most faces of a surface that is closed, or has small holes, are oriented inward:
        :func:`unbend.match` turns them.
    seems_inside_out : bool
        Whether those of a surface with larger holes seem to be, as far as these show: of a face
        scan or a limb they are, of a hollow such as a socket they may be right.
    degenerate_faces : int
        Faces that name a vertex twice, or whose height over their longest edge is at most 1e-8 of
        that edge, so that the cotangents of their angles mean nothing.
    unreferenced_vertices : int
        Vertices that no face uses; 0 for a point cloud.
    duplicate_vertices : int
        Vertices at exactly the position of an earlier one.
    seam_vertices : int
        Those among them that are on boundaries, as where a texture cut a surface open. Computations
        count each as the earlier one, and so do all other attributes.
    duplicate_faces : int
        Faces with the same three vertices as an earlier one, in any order.
    area : float
        Sum of the faces' areas, without duplicate ones, in the square of the mesh's unit of length.
    closed : bool
        Whether there are faces and every edge has at least two.
    euler_characteristic : int or None
        Vertices in use - edges + faces, not counting faces that name a vertex twice. None for a
        point cloud.
    genus : int or None
        Number of handles, where it is meaningful: one component, every edge and vertex manifold,
        consistent orientation, no face that names a vertex twice.
    edge_min, edge_median, edge_max : float
        Lengths of the edges; NaN without edges.
    robust_needed : bool
        Whether computations use the robust Laplacian, because degenerate faces or non-manifold
        edges or vertices remain once repeated faces are left out. False if nothing can be computed.
    """

    n_vertices: int
    n_faces: int
    component_vertices: tuple[int, ...]
    component_faces: tuple[int, ...]
    boundary_edges: int
    boundary_loops: int
    non_manifold_edges: int
    non_manifold_vertices: int
    inconsistent_edges: int
    one_sided: bool
    inside_out: bool
    seems_inside_out: bool
    degenerate_faces: int
    unreferenced_vertices: int
    duplicate_vertices: int
    seam_vertices: int
    duplicate_faces: int
    area: float
    closed: bool
    euler_characteristic: int | None
    genus: int | None
    edge_min: float
    edge_median: float
    edge_max: float
    robust_needed: bool

    @property
    def n_components(self) -> int:
        """Number of connected components; 0 for a point cloud."""
        return len(self.component_vertices)


def diagnose(mesh: MeshLike) -> Diagnosis:
    """Examine a mesh; nothing is changed.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError, MeshError, FileError
        See :func:`unbend.as_mesh`.

    Examples
    --------
    >>> from unbend import Mesh, diagnose
    >>> tetrahedron = Mesh(
    ...     [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    ...     [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    ... )
    >>> health = diagnose(tetrahedron)
    >>> health.closed, health.genus, health.component_vertices
    (True, 0, (4,))
    """
    mesh = as_mesh(mesh)
    joined, number = join_seams(mesh)
    vertices, faces = mesh.vertices, joined.faces
    proper = proper_faces(faces)
    edges = find_edges(proper, mesh.n_vertices)
    components = find_components(faces, mesh.n_vertices)
    degenerate, area = measure_faces(vertices, faces)
    twice, once = has_earlier_twin(faces), proper
    if twice.any():  # they add no area, and hide how the others are oriented
        once = proper_faces(faces[~twice])
        area = measure_faces(vertices, once)[1]
    n_used = int(components.n_vertices.sum())
    n_doubled = int((number != np.arange(mesh.n_vertices)).sum())
    boundary = edges.ends[edges.n_faces == 1]
    loops = edges.n_boundary_loops
    non_manifold_edges = int((edges.n_faces > 2).sum())
    non_manifold_vertices = count_non_manifold_vertices(proper, edges)
    inconsistent = int(((edges.n_faces == 2) & (edges.n_upward != 1)).sum())
    turnable = inconsistent or twice.any()
    oriented = orient_consistently(vertices, once) if turnable else once
    outward = 0.0 if oriented is None else outwardness(vertices, oriented)
    euler = n_used - len(edges.ends) + len(proper)
    surface = (
        len(components.n_vertices) == 1
        and not (non_manifold_edges or non_manifold_vertices or inconsistent)
        and len(proper) == len(faces)
    )
    lengths = np.full(1, np.nan)
    if len(edges.ends):
        x, y, z = (vertices[edges.ends[:, 1]] - vertices[edges.ends[:, 0]]).T
        lengths = np.hypot(np.hypot(x, y), z)  # neither overflows nor vanishes
    n_degenerate = int(degenerate.sum())
    robust_needed = False
    if n_degenerate or non_manifold_edges or non_manifold_vertices:
        with suppress(MeshError):
            robust_needed = prepare(joined, connected=False).robust_needed
    return Diagnosis(
        n_vertices=mesh.n_vertices,
        n_faces=mesh.n_faces,
        component_vertices=tuple(components.n_vertices.tolist()),
        component_faces=tuple(components.n_faces.tolist()),
        boundary_edges=len(boundary),
        boundary_loops=loops,
        non_manifold_edges=non_manifold_edges,
        non_manifold_vertices=non_manifold_vertices,
        inconsistent_edges=inconsistent,
        one_sided=oriented is None,
        inside_out=outward < -1,
        seems_inside_out=-1 <= outward < -LIKELY_OUTWARD,
        degenerate_faces=n_degenerate,
        unreferenced_vertices=0 if mesh.is_point_cloud else mesh.n_vertices - n_used - n_doubled,
        duplicate_vertices=count_repeats(vertices),
        seam_vertices=n_doubled,
        duplicate_faces=int(twice.sum()),
        area=area,
        closed=len(proper) > 0 and len(boundary) == 0,
        euler_characteristic=None if mesh.is_point_cloud else euler,
        genus=(2 - euler - loops) // 2 if surface else None,
        edge_min=float(lengths.min()),
        edge_median=float(np.median(lengths)),
        edge_max=float(lengths.max()),
        robust_needed=robust_needed,
    )
