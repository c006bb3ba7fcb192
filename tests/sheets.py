"""A flat square, of which all is known."""

import numpy as np

from unbend import Mesh


def make_sheet(side: int) -> Mesh:
    """Make the unit square of so many vertices a side, row by row, facing up."""
    line = np.linspace(0, 1, side)
    x, y = (part.ravel() for part in np.meshgrid(line, line, indexing="ij"))
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    lower = np.stack([corner, corner + side, corner + 1], axis=1)
    upper = np.stack([corner + side, corner + side + 1, corner + 1], axis=1)
    return Mesh(np.stack([x, y, 0 * x], axis=1), np.concatenate([lower, upper]))
