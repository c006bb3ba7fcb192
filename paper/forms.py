"""Canonical forms as the paper's experiments make them, and points of them for ICP."""

from typing import Literal

import numpy as np

from paper.collection import Collection
from paper.run import Arrays
from unbend._types import FloatArray
from unbend.alignment import procrustes
from unbend.canonical import CanonicalForm, canonical_form, sampled_canonical_form
from unbend.choices import DistanceKind
from unbend.mesh import Mesh

N_SAMPLES = 200
Method = Literal["exact", "sampled"]


def make_form(
    mesh: Mesh,
    distance: DistanceKind,
    method: Method,
    n_eigenpairs: int,
    n_samples: int = N_SAMPLES,
) -> CanonicalForm:
    """Three-dimensional canonical form of a mesh; an exact one takes no samples."""
    if method == "exact":
        return canonical_form(mesh, distance=distance)
    return sampled_canonical_form(
        mesh, distance=distance, n_eigenpairs=n_eigenpairs, n_samples=n_samples
    )


def form(
    shapes: Collection, name: str, distance: DistanceKind, method: Method, n_eigenpairs: int
) -> Arrays:
    """Three-dimensional canonical form of a shape, and the seconds it took."""
    made = make_form(shapes.mesh(name), distance, method, n_eigenpairs)
    return {"points": made.points, "seconds": np.array(sum(made.seconds.values()))}


def some_points(points: FloatArray, most: int, seed: int) -> FloatArray:
    """Draw at most so many of the points that are finite, in their order."""
    points = points[np.isfinite(points).all(axis=1)]
    chosen = np.random.default_rng(seed).permutation(len(points))[:most]
    return np.asarray(points[np.sort(chosen)])


def difference(left: FloatArray, right: FloatArray) -> tuple[float, float]:
    """How far two forms are apart, as a share of the size of the second.

    Parameters
    ----------
    left, right : (n, 3) ndarray of float64
        Row i corresponds to row i; rows that are not finite do not count.

    Returns
    -------
    rigid : float
        Root mean square distance after the best rotation, reflection and translation, over the
        root mean square distance of the second from its centre.
    scaled : float
        The same, with the best scale of the first, too: what is left is a change of shape.

    Examples
    --------
    >>> import numpy as np
    >>> from paper.forms import difference
    >>> points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]])
    >>> [round(one, 6) for one in difference(1.1 * points, 5 - points)]
    [0.1, 0.0]
    """
    there = np.isfinite(left).all(axis=1) & np.isfinite(right).all(axis=1)
    left, right = left[there], right[there]
    rotation, _ = procrustes(left, right)
    moved = (left - left.mean(axis=0)) @ rotation.T
    fixed = right - right.mean(axis=0)
    size = np.linalg.norm(fixed)
    scale = (moved * fixed).sum() / (moved**2).sum()
    return (
        float(np.linalg.norm(moved - fixed) / size),
        float(np.linalg.norm(scale * moved - fixed) / size),
    )
