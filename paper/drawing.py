"""What the figures of shapes share: which way is up, and one colour for one point."""

import numpy as np

from paper.collection import Collection
from unbend._arrays import nearest_rows
from unbend._types import FloatArray
from unbend.mesh import Mesh
from unbend.report import pattern_colors

# From the files' axes to those of pictures, y up: TOSCA's shapes stand along z, our own along y.
_UPRIGHT = {"TOSCA": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])}


def upright(shapes: Collection, name: str) -> Mesh:
    """Read a shape and turn it for a picture, at unit area."""
    mesh = shapes.mesh(name)
    corners = mesh.vertices[mesh.faces]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(sides, axis=1).sum() / 2
    turn = _UPRIGHT.get(shapes.title, np.eye(3))
    return Mesh(mesh.vertices @ turn.T / np.sqrt(area), mesh.faces, name=name)


def colors_of(shapes: Collection, first: str, name: str) -> FloatArray:
    """Colours (n, 3) of a shape's vertices: what the same points of the first shape have."""
    painted = 0.3 + 0.7 * pattern_colors(shapes.mesh(first).vertices)  # forms are seen edge-on
    if name == first:
        return painted
    truth = shapes.truth(first, name)
    vertices = shapes.mesh(name).vertices
    # Vertices that the ground truth does not name look like the nearest that it does.
    nearest = nearest_rows(np.nan_to_num(vertices), vertices[truth.target_points])
    return np.asarray(painted[truth.source_points[nearest]])
