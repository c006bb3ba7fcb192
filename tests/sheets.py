"""A flat square, a torus, a lopsided egg, a blob and a ball with a twist, of which all is known."""

import numpy as np

from unbend import Mesh
from unbend.datasets import make_sphere


def make_sheet(side: int) -> Mesh:
    """Make the unit square of so many vertices a side, row by row, facing up."""
    line = np.linspace(0, 1, side)
    x, y = (part.ravel() for part in np.meshgrid(line, line, indexing="ij"))
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    lower = np.stack([corner, corner + side, corner + 1], axis=1)
    upper = np.stack([corner + side, corner + side + 1, corner + 1], axis=1)
    return Mesh(np.stack([x, y, 0 * x], axis=1), np.concatenate([lower, upper]))


def make_torus(m: int, n: int) -> Mesh:
    """Make a torus of m by n vertices, which has double eigenvalues."""
    i, j = (one.ravel() for one in np.mgrid[:m, :n])
    here, right, above = i * n + j, (i + 1) % m * n + j, i * n + (j + 1) % n
    across = (i + 1) % m * n + (j + 1) % n
    u, v = 2 * np.pi * i / m, 2 * np.pi * j / n
    ring = 2 + np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), np.sin(v)], axis=1)
    faces = np.stack([here, right, across, here, across, above], axis=1).reshape(-1, 3)
    return Mesh(points, faces, name="torus")


def make_egg(level: int, hand: int = 1) -> Mesh:
    """Make a ball, lopsided but for left and right, or with -1 what a mirror makes of it.

    Vertices of a coarser one are first.
    """
    ball = make_sphere(level)
    return Mesh(lopsided(ball.vertices) * [hand, 1, 1], ball.faces[:, ::hand])


def lopsided(points: np.ndarray) -> np.ndarray:
    """Move points of the unit ball to those of the egg."""
    x, y, z = points.T
    return np.stack([x * (1.3 + 0.4 * y + 0.2 * z), y, 0.7 * z + 0.2 * y**2], axis=1)


def make_blob(
    level: int, bend: float = 0.0, lengths: tuple[float, float, float] = (2.0, 1.2, 0.7)
) -> Mesh:
    """Make a ball with three limbs and without symmetry; limbs may be bent.

    Vertices of a coarser one are first.
    """
    ball = make_sphere(level)
    points = ball.vertices.copy()
    directions = (1, 0.2, 0), (0, 1, 0.3), (-0.5, -0.4, 1)
    for direction, length in zip(directions, lengths, strict=True):
        limb = np.array(direction) / np.linalg.norm(direction)
        far = length * np.exp(-6 * (1 - ball.vertices @ limb))[:, None]
        points += far * (limb + bend * far * np.roll(limb, 1))
    return Mesh(points, ball.faces, name="blob")


def make_twisted_ball(level: int) -> tuple[Mesh, np.ndarray]:
    """Make a ball that has, strictly, one side only, and name the three vertices of its twist.

    The faces around a vertex are gone, and the opposite vertices of the hexagon they leave are one.
    """
    ball = make_sphere(level)
    middle = ball.n_vertices - 1
    around = ball.faces[(ball.faces == middle).any(axis=1)]
    rest = ball.faces[(ball.faces != middle).all(axis=1)]
    after = {a: b for face in around for a, b in _sides(face) if middle not in (a, b)}
    ring = [int(around[0][around[0] != middle][0])]
    while len(ring) < 6:
        ring.append(int(after[ring[-1]]))
    for k in range(3):
        rest[rest == ring[k + 3]] = ring[k]
    used, faces = np.unique(rest, return_inverse=True)
    return Mesh(ball.vertices[used], faces.reshape(-1, 3)), np.searchsorted(used, ring[:3])


def cut_along_seam(mesh: Mesh) -> tuple[Mesh, np.ndarray]:
    """Give faces on the side of greater x their own vertices on the border, after the others.

    Returns the seam's vertices, of which those added are the copies, too.
    """
    beyond = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > mesh.vertices[:, 0].mean()
    seam = np.intersect1d(mesh.faces[beyond], mesh.faces[~beyond])
    number = np.arange(mesh.n_vertices)
    number[seam] = mesh.n_vertices + np.arange(len(seam))
    faces = np.where(beyond[:, None], number[mesh.faces], mesh.faces)
    return Mesh(np.concatenate([mesh.vertices, mesh.vertices[seam]]), faces), seam


def _sides(face: np.ndarray) -> list[tuple[int, int]]:
    return [(int(face[k]), int(face[(k + 1) % 3])) for k in range(3)]
