"""Small sparse problems for the tests of the solvers."""

import numpy as np
import scipy.sparse as sp
from scipy.spatial import ConvexHull, Delaunay


def laplacian(vertices, faces):
    """Cotangent stiffness and barycentric areas."""
    n = len(vertices)
    stiffness = sp.csc_array((n, n))
    edges = [vertices[faces[:, (i + 2) % 3]] - vertices[faces[:, (i + 1) % 3]] for i in range(3)]
    face_areas = np.linalg.norm(np.cross(edges[0], edges[1]), axis=1) / 2
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        weights = -(edges[j] * edges[k]).sum(axis=1) / (4 * face_areas)
        half = sp.coo_array((weights, (faces[:, j], faces[:, k])), (n, n))
        stiffness = stiffness + half + half.T
    stiffness = sp.diags_array(stiffness.sum(axis=0)) - stiffness
    return sp.csc_array(stiffness), np.bincount(faces.ravel(), np.repeat(face_areas / 3, 3), n)


def icosphere(levels):
    """Midpoint subdivisions of the icosahedron, on the unit sphere."""
    g = (1 + 5**0.5) / 2
    vertices = np.array(
        [[s * a, t * b, 0] for a, b in [(1, g)] for s in (1, -1) for t in (1, -1)], dtype=float
    )
    vertices = np.concatenate([np.roll(vertices, shift, axis=1) for shift in range(3)])
    faces = ConvexHull(vertices).simplices
    for _ in range(levels):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
        unique, inverse = np.unique(edges, axis=0, return_inverse=True)
        middle = (inverse.reshape(3, -1) + len(vertices)).T
        vertices = np.concatenate([vertices, vertices[unique].mean(axis=1)])
        a, b, c = faces.T
        ab, bc, ca = middle.T
        faces = np.concatenate(
            [np.stack(f, 1) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
        vertices /= np.linalg.norm(vertices, axis=1)[:, None]
    return vertices, faces


def square(side):
    """Flat open grid with right triangles: its eigenvalues come in pairs."""
    x, y = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side))
    i = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate(
        [np.stack([i, i + 1, i + side], 1), np.stack([i + 1, i + side + 1, i + side], 1)]
    )
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1), faces


def scattered(n, seed):
    """An open, irregular surface: a Delaunay triangulation, lifted."""
    rng = np.random.default_rng(seed)
    plane = rng.random((n, 2))
    height = 0.3 * np.sin(4 * plane[:, :1]) * np.cos(3 * plane[:, 1:])
    return np.concatenate([plane, height], axis=1), Delaunay(plane).simplices


def copies(problem, count):
    """Disjoint copies: every eigenvalue occurs ``count`` times as often."""
    stiffness, areas = problem
    return sp.csc_array(sp.block_diag([stiffness] * count)), np.tile(areas, count)
