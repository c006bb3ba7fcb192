"""Which vertices of a mesh a coarser one puts together."""

from __future__ import annotations

import numpy as np

from unbend._types import IntArray
from unbend.errors import InputError, MissingExtraError
from unbend.mesh import Mesh


def aggregate_vertices(mesh: Mesh, n_coarse: int) -> IntArray:
    """Simplify a mesh by edge collapses, and say which vertex each one is collapsed into.

    Vertices that are put together are connected on the surface: a leg never joins the leg beside
    it, however near.

    Parameters
    ----------
    mesh : Mesh
        All vertices in use.
    n_coarse : int
        Vertices of the coarse mesh, about.

    Returns
    -------
    (n,) ndarray of int64
        Number of the coarse vertex, from 0 on, each in use.

    Raises
    ------
    InputError
        If the mesh is a point cloud.
    MissingExtraError
        If fast-simplification is not installed.

    References
    ----------
    Garland & Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997.

    Examples
    --------
    >>> from unbend.coarsening import aggregate_vertices
    >>> from unbend.datasets import make_sphere
    >>> aggregates = aggregate_vertices(make_sphere(4), 300)
    >>> len(aggregates), bool(250 < aggregates.max() < 350)
    (2562, True)
    """
    if mesh.is_point_cloud:
        raise InputError(f"{mesh.name}: max_vertices needs faces, and this is a point cloud")
    try:
        import fast_simplification
    except ImportError:
        raise MissingExtraError("fast-simplification", "large") from None
    arrays = np.array(mesh.vertices), np.array(mesh.faces)
    reduction = 1 - n_coarse / mesh.n_vertices
    collapses = fast_simplification.simplify(*arrays, reduction, return_collapses=True)[2]
    into = fast_simplification.replay_simplification(*arrays, collapses)[2]
    result: IntArray = np.unique(into, return_inverse=True)[1].astype(np.int64)
    return result
