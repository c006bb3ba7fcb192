"""Canonical forms as the paper's experiments make them, and points of them for ICP."""

from __future__ import annotations

import numpy as np

from unbend._types import FloatArray
from unbend.canonical import canonical_form
from unbend.choices import DistanceKind, Method
from unbend.datasets import Collection
from unbend.reproduce.run import Arrays

N_SAMPLES = 200


def form(
    shapes: Collection, name: str, distance: DistanceKind, method: Method, n_eigenpairs: int
) -> Arrays:
    """Three-dimensional canonical form of a shape, and the seconds it took."""
    made = canonical_form(
        shapes.mesh(name),
        distance=distance,
        method=method,
        n_eigenpairs=n_eigenpairs,
        n_samples=N_SAMPLES,
        cache=False,
    )
    return {"points": made.points, "seconds": np.array(sum(made.seconds.values()))}


def some_points(points: FloatArray, most: int, seed: int) -> FloatArray:
    """Draw at most so many of the points that are finite, in their order."""
    points = points[np.isfinite(points).all(axis=1)]
    chosen = np.random.default_rng(seed).permutation(len(points))[:most]
    return np.asarray(points[np.sort(chosen)])
