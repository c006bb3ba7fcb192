"""What the triangles of a surface add to its Laplacian."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from unbend._types import FloatArray, IntArray, SparseMatrix


def assemble_stiffness(faces: IntArray, weights: FloatArray, n: int) -> SparseMatrix:
    """Assemble W from half-cotangents: corner c of a face weighs the edge that faces it."""
    index = faces.astype(np.int32)
    tails = np.roll(index, -1, axis=1).ravel()
    heads = np.roll(index, -2, axis=1).ravel()
    weight = weights.ravel()
    diagonal = np.bincount(tails, weight, n) + np.bincount(heads, weight, n)
    every = np.arange(n, dtype=np.int32)
    entries = np.concatenate([-weight, -weight, diagonal])
    rows = np.concatenate([tails, heads, every])
    columns = np.concatenate([heads, tails, every])
    return sp.csr_array(sp.coo_array((entries, (rows, columns)), shape=(n, n)))


def mixed_voronoi(
    squared: FloatArray, cotangents: FloatArray, face_areas: FloatArray
) -> FloatArray:
    """Share of each face that belongs to each of its corners (Meyer et al. 2003, fig. 4)."""
    product = squared * cotangents
    # A corner's Voronoi cell reaches the midpoints of the two edges that meet there.
    voronoi = (np.roll(product, -1, axis=1) + np.roll(product, -2, axis=1)) / 8
    obtuse = cotangents < 0
    clipped = np.where(obtuse, face_areas[:, None] / 2, face_areas[:, None] / 4)
    return np.asarray(np.where(obtuse.any(axis=1, keepdims=True), clipped, voronoi))
