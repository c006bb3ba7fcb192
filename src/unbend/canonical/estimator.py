"""Canonical forms as a scikit-learn estimator, for people who compose."""

from __future__ import annotations

from typing import Any

from unbend._types import FloatArray, Progress
from unbend.canonical._canonical_form import canonical_form
from unbend.choices import Detail, DistanceKind, Interpolation, LaplacianKind, Method, Weighting
from unbend.errors import MissingExtraError

try:
    from sklearn.base import BaseEstimator
except ImportError:

    class BaseEstimator:  # type: ignore[no-redef]
        """Stands in where scikit-learn is missing: the name can be had, an estimator cannot."""

        def __new__(cls, *args: Any, **kwargs: Any) -> Any:
            """Say what is missing."""
            raise MissingExtraError("scikit-learn")


class SpectralMDS(BaseEstimator):  # type: ignore[misc]
    """Canonical form of one mesh, in scikit-learn's conventions.

    Parameters
    ----------
    n_components, distance, method, weighting, n_eigenpairs, n_samples, mu, interpolation, time, \
    laplacian, component, keep_scale, random_state, detail, progress
        As for :func:`unbend.canonical_form`.

    Attributes
    ----------
    embedding_ : (n, d) ndarray of float64
        The canonical form, one row per vertex.
    eigenvalues_ : (d,) ndarray of float64
        Of the Gram matrix.
    stress_ : float
        Normalised stress.
    form_ : CanonicalForm
        The whole result; with `detail`, its `surface` too.

    See Also
    --------
    unbend.canonical_form : The function behind it.

    Notes
    -----
    `X` is one mesh: a path, a Mesh, a (vertices, faces) pair, or an (n, 3) array, which is a
    point cloud. As in :class:`sklearn.manifold.MDS`, there is no ``transform``: a form belongs
    to the mesh it was computed from.

    Examples
    --------
    >>> from unbend.canonical import SpectralMDS
    >>> from unbend.datasets import make_sphere
    >>> SpectralMDS(n_components=3).fit_transform(make_sphere(2)).shape
    (162, 3)
    """

    def __init__(
        self,
        n_components: int = 3,
        *,
        distance: DistanceKind = "biharmonic",
        method: Method = "auto",
        weighting: Weighting = "uniform",
        n_eigenpairs: int | None = None,
        n_samples: int | None = None,
        mu: float | None = None,
        interpolation: Interpolation | None = None,
        time: float | None = None,
        laplacian: LaplacianKind = "auto",
        component: str | int | None = None,
        keep_scale: bool = False,
        random_state: int = 0,
        detail: Detail | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.n_components = n_components
        self.distance = distance
        self.method = method
        self.weighting = weighting
        self.n_eigenpairs = n_eigenpairs
        self.n_samples = n_samples
        self.mu = mu
        self.interpolation = interpolation
        self.time = time
        self.laplacian = laplacian
        self.component = component
        self.keep_scale = keep_scale
        self.random_state = random_state
        self.detail = detail
        self.progress = progress

    def fit(self, X: Any, y: Any = None) -> SpectralMDS:
        """Compute the canonical form of a mesh.

        Parameters
        ----------
        X : mesh-like
            One mesh.
        y : None
            Ignored.

        Returns
        -------
        SpectralMDS
            Itself.
        """
        self.form_ = canonical_form(X, **self.get_params(deep=False))
        self.embedding_ = self.form_.points
        self.eigenvalues_ = self.form_.eigenvalues
        self.stress_ = self.form_.stress
        return self

    def fit_transform(self, X: Any, y: Any = None) -> FloatArray:
        """Compute the canonical form of a mesh and return its points, (n, d)."""
        return self.fit(X).embedding_
