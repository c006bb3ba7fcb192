"""Which vertices have a partner on the other shape, and which lie beyond its boundary.

What a partial shape lacks was cut off along its boundary. So the outline of a patch without partner
must lie near that boundary and be about as long. Otherwise the patch is not missing from the other
shape but badly matched, and keeps its partners.
"""

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
    near: float,
) -> BoolArray:
    """Leave without partner only what the goal's boundary may have cut off.

    ``overlap`` (n, p) tells which vertices have a partner by each of p point maps, in whose poses
    the shape is ``size`` (p,) times as long. The image of an outline may be ``near``, a distance,
    to the boundary. The finer a mesh is, the longer are ragged outlines: patches of a fine one are
    judged by smoothed outlines too.
    """
    if overlap.all():
        return overlap
    ends = shape.edge_weights.indptr, shape.edge_weights.indices
    limits = constants.OUTLINE * goal.boundary_length / size, goal.boundary_distances[point_maps]

    def judged(patches: BoolArray) -> BoolArray:
        kept = patches.copy()
        _keep_matched(shape.faces, shape.vertices, *ends, kept, *limits, near)
        return kept

    kept = judged(overlap)
    changed = shape.areas @ (kept & ~overlap)
    if shape.edge < TURNING and changed.max() > constants.SMALLEST_PART:
        smooth = snap(shape.averaged(shape.areas[:, None] * overlap)) > 0.5
        kept &= judged(smooth)
    return kept


@compiled
def _keep_matched(faces, vertices, start, neighbors, overlap, longest, off, near):  # type: ignore[no-untyped-def]
    n, n_maps = overlap.shape
    patch, reached = np.empty(n, np.int64), np.empty(n, np.int64)
    # Of each patch: how long its outline is, and how near its image comes to the boundary.
    outline, nearest = np.empty(n), np.empty(n)
    for m in range(n_maps):
        count = 0
        for i in range(n):
            patch[i] = -1
        for i in range(n):
            if overlap[i, m] or patch[i] >= 0:
                continue
            outline[count], nearest[count] = 0.0, np.inf
            patch[i], reached[0], left = count, i, 1
            while left:
                left -= 1
                v = reached[left]
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
            if p >= 0 and outline[p] > 0 and (outline[p] > longest[m] or nearest[p] > near):
                overlap[i, m] = True
