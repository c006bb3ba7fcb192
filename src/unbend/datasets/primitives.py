"""Shapes whose spectra and distances are known in closed form."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from unbend._arrays import check_whole
from unbend._types import FloatArray, IntArray
from unbend.mesh import Mesh, find_edges


def make_sphere(subdivisions: int = 4) -> Mesh:
    """Make a unit sphere by subdividing an icosahedron.

    Parameters
    ----------
    subdivisions : int, default=4
        0 to 10. Each one quadruples the faces; there are ``10 * 4**subdivisions + 2`` vertices.

    Returns
    -------
    Mesh

    Raises
    ------
    InputError
        If `subdivisions` is out of range.

    Notes
    -----
    The Laplacian of the smooth sphere has the eigenvalue l (l + 1), 2 l + 1 times, for every l.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> make_sphere(1)
    Mesh(42 vertices, 80 faces)
    """
    check_whole(subdivisions, "subdivisions", 0, 10)
    vertices, faces = _icosahedron()
    for _ in range(subdivisions):
        vertices, faces = _split_edges(vertices, faces)
    return Mesh(vertices, faces, name="sphere")


def _icosahedron() -> tuple[FloatArray, IntArray]:
    golden = (1 + np.sqrt(5)) / 2
    signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    flat = np.column_stack([np.zeros(4), signs * [1, golden]])
    vertices = np.concatenate([np.roll(flat, shift, axis=1) for shift in range(3)])
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    # Its faces are those of its convex hull; turn them all outward.
    faces = ConvexHull(vertices).simplices.astype(np.int64)
    inward = np.linalg.det(vertices[faces]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces


def _split_edges(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Split each face into four at the middles of its edges, moved onto the unit sphere."""
    edges = find_edges(faces, len(vertices))
    middles = vertices[edges.ends].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    a, b, c = faces.T
    ab, bc, ca = edges.of_side.reshape(-1, 3).T + len(vertices)
    quarters = np.hstack([(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]).T
    return np.concatenate([vertices, middles]), quarters
