"""Synthetic meshes of any size."""

import numpy as np

from unbend import Mesh
from unbend.datasets import make_quadruped
from unbend.mesh import find_edges


def quadruped(n: int) -> Mesh:
    mesh = make_quadruped(n_vertices=n).mesh
    return Mesh(mesh.vertices, mesh.faces, name="quadruped")


def subdivide(mesh: Mesh, name: str) -> Mesh:
    """Split every triangle into four."""
    edges = find_edges(mesh.faces, mesh.n_vertices)
    middle = mesh.vertices[edges.ends].mean(axis=1)
    a, b, c = mesh.faces.T
    ab, bc, ca = (mesh.n_vertices + edges.of_side.reshape(-1, 3)).T
    faces = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return Mesh(
        np.vstack([mesh.vertices, middle]),
        np.vstack([np.stack(corners, axis=1) for corners in faces]),
        name=name,
    )
