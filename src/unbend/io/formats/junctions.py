"""T-junctions: corners of triangles within edges of others, along which a surface comes apart."""

from __future__ import annotations

from itertools import chain

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from unbend._types import FloatArray, IntArray
from unbend.mesh import find_edges

_BESIDE = 1e-5  # of the extent, that a corner is at most beside an edge: text has six digits


def divide_at_junctions(points: FloatArray, faces: IntArray) -> tuple[IntArray, int]:
    """Divide triangles at corners of others that lie within their boundary edges.

    Only where the boundary runs along the edge at that corner too, as on both sides of a slit.
    Returns the triangles (m, 3), and how many edges were divided.
    """
    n_divided = 0
    while True:
        sides, corners, shares = _junctions(points, faces)
        chosen = np.unique(sides)
        chosen = chosen[np.unique(chosen // 3, return_index=True)[1]]  # a side of each triangle
        if not len(chosen):
            return faces, n_divided
        n_divided += len(chosen)
        start, end, tip = (faces[chosen // 3, (chosen + i) % 3] for i in range(3))
        # Parts of a triangle begin at the start of the side and at every corner within it.
        taken = np.isin(sides, chosen)
        row = np.append(np.arange(len(chosen)), np.searchsorted(chosen, sides[taken]))
        order = np.lexsort((np.append(np.zeros(len(chosen)), shares[taken]), row))
        row, first = row[order], np.append(start, corners[taken])[order]
        is_last = np.append(row[1:] != row[:-1], True)
        second = np.where(is_last, end[row], np.roll(first, -1))
        parts = np.column_stack([first, second, tip[row]])
        faces = np.vstack([np.delete(faces, chosen // 3, axis=0), parts])


def _junctions(points: FloatArray, faces: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Sides of triangles, corners of others within them, and where, from 0 to 1 along the side."""
    edges = find_edges(faces, len(points))
    sides = np.flatnonzero(edges.n_faces[edges.of_side] == 1)
    start, end = faces.ravel()[sides], faces[:, [1, 2, 0]].ravel()[sides]
    along = points[end] - points[start]
    lengths = np.linalg.norm(along, axis=1)
    beside = _BESIDE * float(np.linalg.norm(np.ptp(points, axis=0)))
    apart = 10 * beside  # from the ends: nearer corners are theirs, written anew

    def offsets(row: IntArray, vertices: IntArray) -> tuple[FloatArray, FloatArray]:
        """How far along the sides of these rows vertices are, and how far beside their lines."""
        direction = along[row] / lengths[row, None]
        off = points[vertices] - points[start[row]]
        far = np.einsum("ij,ij->i", off, direction)
        return far, np.linalg.norm(off - far[:, None] * direction, axis=1)

    long = np.flatnonzero(lengths > 2 * apart)
    tips = faces[:, [2, 0, 1]].ravel()[sides[long]]
    long = long[offsets(long, tips)[1] > beside]  # not of flat triangles
    rim = np.unique([start, end])
    middles = (points[start] + points[end])[long] / 2
    near = cKDTree(points[rim]).query_ball_point(middles, lengths[long] / 2)
    row = np.repeat(long, [len(some) for some in near])
    corners = rim[np.fromiter(chain.from_iterable(near), dtype=np.int64, count=len(row))]
    far, away = offsets(row, corners)
    within = (away <= beside) & (far > apart) & (lengths[row] - far > apart)
    row, corners, far = row[within], corners[within], far[within]
    # Does one of the boundary edges from these corners run along the side, too?
    ends = np.append(start, end), np.append(end, start)
    joined = csr_array((np.ones(2 * len(sides)), ends), shape=(len(points), len(points)))
    number, others = joined[corners].nonzero()
    _, away = offsets(row[number], others)
    runs = np.bincount(number, away <= beside, len(corners)) > 0
    row = row[runs]
    return sides[row], corners[runs], far[runs] / lengths[row]
