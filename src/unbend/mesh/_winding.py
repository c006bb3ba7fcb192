"""Which way round faces are: all alike, where a surface has two sides."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import splu

from unbend._arrays import sum_rows
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.mesh._topology import find_edges, label_linked, measure_faces, other_sides

# A twist is a flaw of the mesh, not of the nature of the surface, if the seam along which faces
# disagree is at most so long, in sqrt(area): less than a limb's girth.
_SEAM = 0.1
LIKELY_OUTWARD = 0.05  # how surely faces face outward, or inward, if they seem to
_FLAT = 1e-9  # volume, in cubes of the radius, that is rounding
_SHIFT = 1e-6  # keeps a matrix definite whose least eigenvalue may be less
_STEPS = 20  # of inverse iteration


def orient_consistently(vertices: FloatArray, faces: IntArray) -> IntArray | None:
    """Orient faces consistently: faces that share an edge walk along it in opposite directions.

    Of each connected part, the fewer faces are turned. Edges of more than two faces connect none.
    Returns None for a non-orientable surface, such as a Möbius strip. A scan or a decimated mesh
    may have a twist smaller than any detail, which makes it, strictly, non-orientable. Faces then
    still disagree along a short seam there.
    """
    m = len(faces)
    edges = find_edges(faces, len(vertices))
    twin = other_sides(edges)
    is_loop = (edges.ends[:, 0] == edges.ends[:, 1])[edges.of_side]
    sides = np.flatnonzero((twin > np.arange(3 * m)) & ~is_loop)
    pairs = np.column_stack([sides, twin[sides]]) // 3
    disagree = edges.n_upward[edges.of_side[sides]] != 1
    as_they_are, opposite = _part_of_each(pairs, disagree, m)
    votes = np.bincount(as_they_are, minlength=2 * m)
    turn = votes[as_they_are] < votes[opposite]
    turn |= (votes[as_they_are] == votes[opposite]) & (as_they_are > opposite)
    twisted = as_they_are == opposite
    for part in np.unique(as_they_are[twisted]):
        members = np.flatnonzero(as_they_are == part)
        inside = as_they_are[pairs[:, 0]] == part
        local = np.searchsorted(members, pairs[inside])
        turn[members] = _least_disagreement(local, disagree[inside], len(members))
    seam = sides[disagree ^ turn[pairs[:, 0]] ^ turn[pairs[:, 1]]]
    if len(seam) and _length(vertices, edges.ends[edges.of_side[seam]], faces) > _SEAM:
        return None
    return np.asarray(np.where(turn[:, None], faces[:, ::-1], faces))


def outwardness(vertices: FloatArray, faces: IntArray) -> float:
    """How surely consistently oriented faces face outward: 1 and more, whatever closes their holes.

    From -1 on they face inward for sure. It is the volume that they enclose, over how far it may be
    off: each hole is closed by a fan around the middle of its rim, of length L. What else may close
    it lies within about L / 4 of there and has no more area than a disc of that rim (isoperimetric
    inequality): it adds at most L^3 / 48 pi.
    """
    if not len(faces):
        return 0.0
    tiny, used = np.finfo(float).tiny, np.unique(faces)
    points = np.zeros(vertices.shape)  # of radius 1: no square overflows or vanishes
    points[used] = vertices[used] / max(np.abs(vertices[used]).max(), tiny)
    points[used] -= points[used].mean(axis=0)
    points /= max(np.linalg.norm(points, axis=1).max(), tiny)
    edges = find_edges(faces, len(points))
    open_ = edges.n_faces[edges.of_side] == 1
    rim = np.stack([faces.ravel()[open_], faces[:, [1, 2, 0]].ravel()[open_]])
    hole = label_linked(rim, len(points))[rim[0]]
    counts = np.maximum(np.bincount(hole), 1)
    a, b = points[rim]
    middles = sum_rows(hole, a, len(counts)) / counts[:, None]
    lengths = np.bincount(hole, np.linalg.norm(b - a, axis=1))
    fans = np.stack([b, a, middles[hole]])
    corners = np.concatenate([points[faces].transpose(1, 0, 2), fans], axis=1)
    volume = np.einsum("ij,ij->", corners[0], np.cross(corners[1], corners[2])) / 6
    return float(volume / ((lengths**3).sum() / (48 * np.pi) + _FLAT))


def _part_of_each(pairs: IntArray, disagree: BoolArray, m: int) -> tuple[IntArray, IntArray]:
    """Label each of m faces, as it is and turned, by what it winds alike with.

    Both labels are one where a way over the surface leads from a face to the same one, turned.
    """
    one, other = pairs.T
    turned = disagree * m  # face i as it is, i + m as it would be, turned
    tails = np.concatenate([one, one + m])
    heads = np.concatenate([other + turned, other + m - turned])
    labels = label_linked((tails, heads), 2 * m)
    return labels[:m], labels[m:]


def _least_disagreement(pairs: IntArray, disagree: BoolArray, m: int) -> BoolArray:
    """Which of m connected faces to turn so that few pairs disagree; at most half of them.

    The signs of the eigenvector to the least eigenvalue of the signed Laplacian of the faces.
    """
    links = csr_matrix((np.where(disagree, -1.0, 1.0), tuple(pairs.T)), shape=(m, m))
    links = links + links.T
    laplacian = diags(abs(links) @ np.ones(m) + _SHIFT) - links
    inverse = splu(laplacian.tocsc())
    vector = np.random.default_rng(0).normal(size=m)
    for _ in range(_STEPS):
        vector = inverse.solve(vector)  # grows by less than 1 / _SHIFT
    turn = np.asarray(vector < 0)
    return turn if 2 * turn.sum() <= m else ~turn


def _length(vertices: FloatArray, ends: IntArray, faces: IntArray) -> float:
    """Length of edges, in sqrt(area) of the surface."""
    tiny = np.finfo(float).tiny
    with np.errstate(over="ignore"):  # vertices that no face uses may be anywhere
        points = vertices / max(np.abs(vertices[faces]).max(), tiny)  # no square overflows
    length = np.linalg.norm(np.diff(points[ends], axis=1)[:, 0], axis=1).sum()
    return float(length / np.sqrt(max(measure_faces(points, faces)[1], tiny)))
