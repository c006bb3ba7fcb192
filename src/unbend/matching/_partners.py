"""Which vertices have a partner on the other shape, and which lie beyond its boundary.

What a partial shape lacks was cut off along its boundary. So the outline of a patch without partner
must lie near that boundary and be about as long. Otherwise the patch is not missing from the other
shape but badly matched, and keeps its partners.
"""

from __future__ import annotations

import numpy as np

from unbend._types import BoolArray, FloatArray, IntArray
from unbend.matching import _constants as constants
from unbend.matching._shape import Shape
from unbend.mesh import label_linked


def cycle_consistent(shape: Shape, forward: IntArray, backward: IntArray) -> BoolArray:
    """Whether there and back again, (n, p) by so many maps, is near where it began."""
    returned = np.take_along_axis(backward, forward, axis=0)
    off = np.linalg.norm(shape.vertices[:, None] - shape.vertices[returned], axis=-1)
    return np.asarray(off < constants.EDGES * shape.edge)


def keep_matched(
    shape: Shape,
    goal: Shape,
    overlap: BoolArray,
    size: FloatArray,
    point_maps: IntArray,
    near: float,
) -> BoolArray:
    """Leave without partner only what the goal's boundary may have cut off.

    ``overlap`` (n, p) tells which vertices have a partner by each of p point maps, in whose poses
    the shape is ``size`` (p,) times as long. The image of an outline may be ``near``, a distance,
    to the boundary.
    """
    n, n_maps = overlap.shape
    # Patches: of vertices without partner, and joined by edges; those of each map by themselves.
    edges = shape.edge_weights.tocoo()
    joined, of_map = np.nonzero(~(overlap[edges.row] | overlap[edges.col]))
    links = np.stack([edges.row, edges.col])[:, joined] * n_maps + of_map
    patch = label_linked(links, n * n_maps).reshape(n, n_maps)
    # An outline leads through the middles of the sides between who has a partner and who not.
    count = overlap[shape.faces].sum(axis=1)
    crossed, of_map = np.nonzero((count == 1) | (count == 2))
    corners, column = shape.faces[crossed], of_map[:, None]
    inside = overlap[corners, column]
    alone = inside == (count[crossed, of_map] == 1)[:, None]
    others = shape.vertices[corners[~alone].reshape(-1, 2)]
    lengths = np.linalg.norm(others[:, 0] - others[:, 1], axis=1) / 2
    outside = patch[corners[np.arange(len(corners)), inside.argmin(axis=1)], of_map]
    outline = np.bincount(outside, lengths, patch.max() + 1)[patch]
    off = np.where(inside, goal.boundary_distances[point_maps[corners, column]], np.inf)
    nearest = np.full(patch.max() + 1, np.inf)
    np.minimum.at(nearest, outside, off.min(axis=1))
    longest = constants.OUTLINE * goal.boundary_length / size
    none = (outline > longest) | ((outline > 0) & (nearest[patch] > near))
    return np.asarray(overlap | none)
