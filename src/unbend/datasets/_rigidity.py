"""Take the stretch out of a posed skin, as blended bone motions bend a limb like rubber.

A few steps of as-rigid-as-possible deformation (Sorkine, Alexa 2007), held close to the posed skin,
give most of the lost edge lengths back.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from unbend._types import FloatArray, IntArray
from unbend.alignment import nearest_rotation

_REACH = 0.2  # features of the pose larger than this are kept
_N_STEPS = 12


def restore_lengths(rest: FloatArray, posed: FloatArray, faces: IntArray) -> FloatArray:
    """Move posed vertices (n, 3) so that edges come closer to their resting lengths."""
    tails, heads, weights, areas = _cotangents(rest, faces)
    n = len(rest)
    adjacency = sparse.csr_array((weights, (tails, heads)), shape=(n, n))
    degrees = np.asarray(adjacency.sum(axis=1))
    hold = areas / _REACH**2
    solve = splu(
        sparse.csc_array(sparse.diags_array(degrees + hold) - adjacency),
        permc_spec="MMD_AT_PLUS_A",
        options={"SymmetricMode": True},
    ).solve
    edges = rest[tails] - rest[heads]
    to_tail = sparse.csr_array((weights, (tails, np.arange(len(tails)))), shape=(n, len(tails)))
    moved = posed
    for _ in range(_N_STEPS):
        now = moved[tails] - moved[heads]
        covariance = to_tail @ (now[:, :, None] * edges[:, None, :]).reshape(-1, 9)
        turns = nearest_rotation(covariance.reshape(-1, 3, 3))
        wanted = 0.5 * np.einsum("eij,ej->ei", turns[tails] + turns[heads], edges)
        moved = solve(to_tail @ wanted + hold[:, None] * posed)
    return np.asarray(moved)


def _cotangents(
    vertices: FloatArray, faces: IntArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Directed edges with half their cotangent weight (at least a little), and vertex areas."""
    tails, heads, weights = [], [], []
    areas = np.zeros(len(vertices))
    for i in range(3):
        apex, p, q = faces[:, i], faces[:, (i + 1) % 3], faces[:, (i + 2) % 3]
        u, v = vertices[p] - vertices[apex], vertices[q] - vertices[apex]
        twice = np.linalg.norm(np.cross(u, v), axis=1)
        weight = np.clip(0.5 * np.einsum("fi,fi->f", u, v) / np.maximum(twice, 1e-12), 0.02, 5)
        tails += [p, q]
        heads += [q, p]
        weights += [weight, weight]
        areas += np.bincount(apex, twice / 6, len(vertices))
    return np.concatenate(tails), np.concatenate(heads), np.concatenate(weights), areas
