"""Canonical forms as a scikit-learn estimator."""

from __future__ import annotations

from inspect import signature
from typing import Any, Literal

from unbend._arrays import check_choice
from unbend._types import FloatArray, Progress
from unbend.canonical._canonical_form import canonical_form, sampled_canonical_form
from unbend.choices import DistanceKind, Interpolation, LaplacianKind, Weighting
from unbend.errors import MissingExtraError

try:
    from sklearn.base import BaseEstimator
except ImportError:

    class BaseEstimator:  # type: ignore[no-redef]
        """Stand-in without scikit-learn, which raises an error when it is called."""

        def __new__(cls, *args: Any, **kwargs: Any) -> Any:
            """Raise an error that names scikit-learn."""
            raise MissingExtraError("scikit-learn")


class SpectralMDS(BaseEstimator):  # type: ignore[misc]
    """Canonical form of one mesh, in scikit-learn's conventions.

    Parameters
    ----------
    method : {"exact", "sampled"}, default="exact"
        Which function is behind it.
    n_samples, n_eigenpairs, mu, interpolation
        Of the sampled method only; see :func:`unbend.sampled_canonical_form`.
    n_components, distance, weighting, time, laplacian, component, keep_scale, random_state, \
    progress
        As for :func:`unbend.canonical_form`.

    Attributes
    ----------
    form_ : CanonicalForm
    embedding_, eigenvalues_, stress_ : (n, d) and (d,) ndarrays of float64, float
        Its `points`, `eigenvalues` and `stress`.

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
        method: Literal["exact", "sampled"] = "exact",
        n_samples: int = 200,
        n_eigenpairs: int = 100,
        mu: float = 1e4,
        interpolation: Interpolation = "projection",
        weighting: Weighting = "uniform",
        time: float | None = None,
        laplacian: LaplacianKind = "auto",
        component: str | int | None = None,
        keep_scale: bool = False,
        random_state: int = 0,
        progress: Progress | None = None,
    ) -> None:
        self.n_components = n_components
        self.distance = distance
        self.method = method
        self.n_samples = n_samples
        self.n_eigenpairs = n_eigenpairs
        self.mu = mu
        self.interpolation = interpolation
        self.weighting = weighting
        self.time = time
        self.laplacian = laplacian
        self.component = component
        self.keep_scale = keep_scale
        self.random_state = random_state
        self.progress = progress

    def fit(self, X: Any, y: Any = None) -> SpectralMDS:
        """Compute the canonical form of one mesh-like X; `y` is ignored. Returns the estimator."""
        check_choice(self.method, "method", ("exact", "sampled"))
        make = canonical_form if self.method == "exact" else sampled_canonical_form
        known = signature(make).parameters
        options = self.get_params(deep=False).items()
        self.form_ = make(X, **{name: value for name, value in options if name in known})
        self.embedding_ = self.form_.points
        self.eigenvalues_ = self.form_.eigenvalues
        self.stress_ = self.form_.stress
        return self

    def fit_transform(self, X: Any, y: Any = None) -> FloatArray:
        """Compute the canonical form of a mesh and return its points, (n, d)."""
        return self.fit(X).embedding_
