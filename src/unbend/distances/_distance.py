"""Distances on a surface, all behind one protocol: from sources, and between samples."""

from __future__ import annotations

from typing import Any

import numpy as np

from unbend._types import FloatArray
from unbend.choices import DIFFUSION_TIME, DistanceKind, LaplacianKind
from unbend.distances._geodesic import geodesic_metric
from unbend.distances._gram import gram_metric, truncated_metric
from unbend.distances._metric import (
    GEODESIC,
    Metric,
    diffusion_time,
    length_power,
    refuse_of_geodesics,
)
from unbend.errors import InputError
from unbend.io import MeshLike
from unbend.spectral import Surface, eigenpairs, local_ids, make_surface


def make_metric(
    kind: DistanceKind, surface: Surface, *, time: float = DIFFUSION_TIME, sources: bool = False
) -> Metric:
    """Set up the exact distance of a given kind on a surface, at unit area.

    `sources` says that distances from sources will be asked for: one factorisation then serves all.
    """
    if kind in GEODESIC:
        return geodesic_metric(surface, exact=kind == "geodesic-exact")
    return gram_metric(kind, surface, time, sources=sources)


def distance(
    mesh: MeshLike,
    sources: Any,
    *,
    distance: DistanceKind = "geodesic",
    n_eigenpairs: int | None = None,
    time: float | None = None,
    laplacian: LaplacianKind = "auto",
    component: str | int | None = None,
) -> FloatArray:
    """Distances from given vertices to all vertices of a mesh.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    sources : int or (s,) array_like of int
        0-based vertex ids.
    distance : {"geodesic", "geodesic-exact", "biharmonic", "commute-time", "diffusion"}
        ``"geodesic"``, the default, is the robust heat method, as a tape measure to a percent or
        so; ``"geodesic-exact"`` needs pygeodesic. Biharmonic, commute-time and diffusion distances
        are exact: no eigenpair is left out.
    n_eigenpairs : int, optional
        Truncate a spectral distance to this many eigenpairs (Eq. 1 to 3) instead.
    time : float, optional
        Diffusion time of the diffusion distance, in units of the area; 0.1 by default.
    laplacian : {"auto", "cotangent", "robust"}, default="auto"
        Of spectral distances; see :func:`unbend.laplacian`. The heat method has its own.
    component : "largest" or int, optional
        Which component of a mesh that has several.

    Returns
    -------
    (s, n) ndarray of float64
        In the mesh's unit of length for biharmonic and geodesic distances, without unit for
        commute time, per unit of length for diffusion. NaN at vertices outside the component.

    Raises
    ------
    InputError
        If a name, a source or a number is out of range, or an option is given that the distance
        cannot use.
    MeshError
        If the mesh cannot be used; the message names the vertex or face.

    Notes
    -----
    Biharmonic and commute-time distances need the whole diagonal of their kernel. It is computed
    from the factor by selected inversion, which takes about as long as the factorisation; each
    source then takes two solves, or one.

    References
    ----------
    Lipman, Rustamov and Funkhouser, "Biharmonic distance", ACM TOG 29(3), 2010. Crane,
    Weischedel and Wardetzky, "Geodesics in heat", ACM TOG 32(5), 2013.

    Examples
    --------
    >>> from unbend import distance
    >>> from unbend.datasets import make_sphere
    >>> distance(make_sphere(2), 0).shape
    (1, 162)
    """
    diffused = diffusion_time(distance, time)
    refuse_of_geodesics(
        distance, n_eigenpairs=n_eigenpairs is not None, laplacian=laplacian != "auto"
    )
    surface = make_surface(mesh, laplacian=laplacian, component=component)
    local = local_ids(surface, sources)
    if n_eigenpairs is None:
        metric = make_metric(distance, surface, time=diffused, sources=True)
    else:
        if n_eigenpairs == 1:
            raise InputError(
                "n_eigenpairs must be at least 2: the first eigenfunction is constant and has no "
                "distances"
            )
        metric = truncated_metric(distance, eigenpairs(surface, n_eigenpairs), diffused)
    found = metric.from_sources(local) * np.sqrt(surface.area) ** length_power(distance)
    return np.asarray(surface.prepared.expand(found.T).T)
