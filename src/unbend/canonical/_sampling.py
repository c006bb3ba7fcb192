"""Farthest-point sampling in any distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from unbend._arrays import array_of, check_whole, first_largest
from unbend._types import FloatArray, IntArray
from unbend.choices import DistanceKind, LaplacianKind
from unbend.distances import diffusion_time, make_metric
from unbend.errors import InputError
from unbend.io import MeshLike
from unbend.spectral import Spectrum, eigenpairs, local_ids, make_surface


def farthest_point_sampling(
    mesh: MeshLike,
    n_samples: int,
    *,
    distance: DistanceKind = "geodesic",
    start: int | None = None,
    time: float | None = None,
    laplacian: LaplacianKind = "auto",
    component: str | int | None = None,
) -> IntArray:
    """Spread vertices evenly: each one is the farthest from those before it.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    n_samples : int
        At most the number of vertices in use.
    distance : str, default="geodesic"
        See :func:`unbend.distance`.
    start : int, optional
        First sample; by default, where the first non-constant eigenfunction is largest in
        magnitude, at an end of the shape, whatever its pose and the order of vertices.
    time, component
        See :func:`unbend.distance`.
    laplacian : {"auto", "cotangent", "robust"}, default="auto"
        Of spectral distances and of the default for `start`; see :func:`unbend.laplacian`.

    Returns
    -------
    (n_samples,) ndarray of int64
        Vertex ids in the order of their choice. Of those equally far, within a millionth, the
        lowest is taken.

    Raises
    ------
    InputError
        If `n_samples` or `start` is out of range, or an option is given that the distance cannot
        use.
    MeshError
        If the mesh cannot be used.

    References
    ----------
    Gonzalez, "Clustering to minimize the maximum intercluster distance", 1985.

    Examples
    --------
    >>> from unbend import farthest_point_sampling
    >>> from unbend.datasets import make_sphere
    >>> len(farthest_point_sampling(make_sphere(2), 10))
    10
    """
    unused = start is not None and laplacian != "auto"  # else an eigenfunction chooses the start
    diffused = diffusion_time(distance, time, laplacian=unused)
    surface = make_surface(mesh, laplacian=laplacian, component=component)
    metric = make_metric(distance, surface, time=diffused, sources=True)
    if start is None:
        first = shape_end(eigenpairs(surface, 2))
    else:
        if array_of(start, "start").ndim != 0:
            raise InputError(f"start must be one vertex, not {start!r}")
        first = int(local_ids(surface, start)[0])
    samples, _ = spread_samples(metric.from_sources, surface.n_vertices, n_samples, first)
    return np.asarray(surface.prepared.kept[samples])


def spread_samples(
    from_sources: Callable[[IntArray], FloatArray], n_vertices: int, n_samples: int, start: int
) -> tuple[IntArray, FloatArray]:
    """Sample farthest points by a function that gives the distances from a source.

    Returns the vertices (p,) and the distances between them (p, p).
    """
    check_whole(n_samples, "the number of samples", 1, n_vertices)
    indices = np.empty(n_samples, dtype=np.int64)
    distances = np.zeros((n_samples, n_samples))
    nearest = np.full(n_vertices, np.inf)
    following = start
    for i in range(n_samples):
        indices[i] = following
        row = from_sources(indices[i : i + 1])[0]
        distances[i, :i] = distances[:i, i] = row[indices[:i]]
        np.minimum(nearest, row, out=nearest)
        nearest[following] = -np.inf  # never twice, not even among coincident points
        following = int(first_largest(nearest))
    return indices, distances


def shape_end(spectrum: Spectrum) -> int:
    """Vertex where the first non-constant eigenfunction is largest in magnitude."""
    return int(first_largest(np.abs(spectrum.eigenfunctions[:, 1])))
