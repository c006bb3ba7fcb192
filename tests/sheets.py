"""A flat square and a lopsided egg, of which all is known."""

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


def make_egg(level: int, hand: int = 1) -> Mesh:
    """Make a ball, lopsided but for left and right, or with -1 what a mirror makes of it.

    Vertices of a coarser one are first.
    """
    ball = make_sphere(level)
    x, y, z = ball.vertices.T
    points = np.stack([hand * x * (1.3 + 0.4 * y + 0.2 * z), y, 0.7 * z + 0.2 * y**2], axis=1)
    return Mesh(points, ball.faces[:, ::hand])
