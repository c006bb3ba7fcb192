"""Smaller triangles, where a mesh has large ones."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from unbend._types import FloatArray, IntArray
from unbend.mesh._topology import find_edges

_ROUNDS = 12
_MOST = 20_000  # vertices that refinement makes, or 4 times as many as before: spikes need many


class Refined(NamedTuple):
    """A mesh whose first vertices are those of a coarser one."""

    vertices: FloatArray
    faces: IntArray
    parents: IntArray  # (m,) the coarser face that each face is a part of
    corners: FloatArray  # (m, 3, 3) where in its parent each corner is, as weights of its corners


def refine(vertices: FloatArray, faces: IntArray, longest: float) -> Refined:
    """Split edges until none is longer, or there are too many vertices."""
    most = max(_MOST, 4 * len(vertices))
    parents = np.arange(len(faces))
    corners = np.broadcast_to(np.eye(3), (len(faces), 3, 3))
    for _ in range(_ROUNDS):
        edges = find_edges(faces, len(vertices))
        tails, heads = vertices[edges.ends].transpose(1, 0, 2)
        long = np.linalg.norm(heads - tails, axis=1) > longest
        middle = np.where(long, len(vertices) + np.cumsum(long) - 1, -1)
        sides = middle[edges.of_side].reshape(-1, 3)
        two = (sides >= 0).sum(axis=1) == 2
        count = len(vertices) + long.sum() + two.sum()
        if not long.any() or count > most:
            break
        order = _first_sides(sides)
        faces, sides = (np.take_along_axis(one, order, axis=1) for one in (faces, sides))
        corners = np.take_along_axis(corners, order[:, :, None], axis=1)
        centres = np.where(two, count - two.sum() + np.cumsum(two) - 1, -1)
        a, b, c = vertices[faces[two]].transpose(1, 0, 2)
        vertices = np.concatenate([vertices, (tails[long] + heads[long]) / 2, _centre(a, b, c)])
        n_split = (sides >= 0).sum(axis=1)
        faces = _split(n_split, *faces.T, *sides.T, centres)
        parents = _split(n_split, *[parents] * 7)[:, 0]
        a, b, c = corners.transpose(1, 0, 2)
        middles = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corners = _split(n_split, a, b, c, *middles, _centre(a, b, c))
    return Refined(vertices, faces, parents, corners)


def _first_sides(middles: IntArray) -> IntArray:
    """Order corners so that a single middle is on the first side, and of two the last has none.

    Side ``k`` leads from corner ``k`` to the next; its middle is -1 where it stays whole.
    """
    count = (middles >= 0).sum(axis=1)
    first = np.where(count == 1, (middles >= 0).argmax(axis=1), (middles < 0).argmax(axis=1) + 1)
    return np.asarray((first[:, None] + np.arange(3)) % 3)


def _centre(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Centre of the quadrilateral that two split sides, from `a` and from `b`, leave."""
    return (3 * a + 2 * b + 3 * c) / 8


def _split(n_split: IntArray, *given: Any) -> Any:
    """Split faces at the middles of so many sides, and give each piece what its corners have.

    Given are, face by face, that of the corners, of the middles and of the centre between two.
    Two middles leave a quadrilateral, which is split at its centre. Choosing one of its diagonals
    would make the result depend on the order of the corners.
    """
    a, b, c, ab, bc, ca, m = given
    pieces = [
        [(a, b, c)],
        [(a, ab, c), (ab, b, c)],
        [(b, bc, ab), (a, ab, m), (ab, bc, m), (bc, c, m), (c, a, m)],
        [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)],
    ]
    split = []
    for number, some in enumerate(pieces):
        split += [np.stack([one[n_split == number] for one in corners], axis=1) for corners in some]
    return np.concatenate(split)
