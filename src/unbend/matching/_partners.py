"""Which vertices have a partner on the other shape, and which lie beyond its boundary."""

from __future__ import annotations

import numpy as np

from unbend._arrays import snap
from unbend._compiled import compiled
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.deformation import TURNING
from unbend.matching import _constants as constants
from unbend.matching._shape import Shape


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
    near: tuple[float, float],
) -> BoolArray:
    """Leave without partner only what the goal's boundary may have cut off.

    ``overlap`` (n, p) tells which vertices have a partner by each of p point maps, in whose poses
    the shape is ``size`` (p,) times as long. ``near`` says how far from the boundary the image of
    an outline may end: of a patch that is too small for a part, and of another. The finer a mesh
    is, the longer are ragged outlines: patches of a fine one are judged by smoothed outlines too.
    """
    if overlap.all():
        return overlap
    weights = shape.edge_weights
    surface = shape.faces, shape.vertices, shape.areas, weights.indptr, weights.indices
    limits = constants.OUTLINE * goal.boundary_length / size, goal.boundary_distances[point_maps]

    def judged(patches: BoolArray) -> BoolArray:
        kept = patches.copy()
        _keep_matched(*surface, kept, *limits, *near, constants.SMALLEST_PART)
        return kept

    kept = judged(overlap)
    changed = shape.areas @ (kept & ~overlap)
    if shape.edge < TURNING and changed.max() > constants.SMALLEST_PART:
        smooth = snap(shape.averaged(shape.areas[:, None] * overlap)) > 0.5
        kept &= judged(smooth)
    return kept


@compiled
def _keep_matched(  # type: ignore[no-untyped-def]
    faces, vertices, areas, start, neighbors, overlap, longest, off, close, near, small
):
    n, n_maps = overlap.shape
    patch, reached = np.empty(n, np.int64), np.empty(n, np.int64)
    # Of each patch: its area, how long its outline is, how near its image comes to the boundary.
    area, outline, nearest = np.empty(n), np.empty(n), np.empty(n)
    for m in range(n_maps):
        count = 0
        for i in range(n):
            patch[i] = -1
        for i in range(n):
            if overlap[i, m] or patch[i] >= 0:
                continue
            area[count], outline[count], nearest[count] = 0.0, 0.0, np.inf
            patch[i], reached[0], left = count, i, 1
            while left:
                left -= 1
                v = reached[left]
                area[count] += areas[v]
                for e in range(start[v], start[v + 1]):
                    w = neighbors[e]
                    if not overlap[w, m] and patch[w] < 0:
                        patch[w], reached[left] = count, w
                        left += 1
            count += 1
        if count == 0:
            continue
        # An outline leads through the middles of the sides between who has a partner and who not.
        for f in range(len(faces)):
            inside = 0
            for c in range(3):
                inside += overlap[faces[f, c], m]
            if inside in (0, 3):
                continue
            odd = 0
            while overlap[faces[f, odd], m] != (inside == 1):
                odd += 1
            u, v = faces[f, (odd + 1) % 3], faces[f, (odd + 2) % 3]
            square = 0.0
            for a in range(3):
                square += (vertices[u, a] - vertices[v, a]) ** 2
            p = max(patch[u], patch[faces[f, odd]])
            outline[p] += np.sqrt(square) / 2
            for c in range(3):
                if overlap[faces[f, c], m]:
                    nearest[p] = min(nearest[p], off[faces[f, c], m])
        for i in range(n):
            p = patch[i]
            if p >= 0 and outline[p] > 0:
                most = close if area[p] <= small else near
                overlap[i, m] = outline[p] > longest[m] or nearest[p] > most
