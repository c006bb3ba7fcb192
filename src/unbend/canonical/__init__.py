"""Canonical forms: a surface embedded so that its poses look alike."""

from typing import TYPE_CHECKING, Any

from unbend.canonical._canonical_form import CanonicalForm, canonical_form, sampled_canonical_form
from unbend.canonical._interpolation import distance_coefficients, interpolate
from unbend.canonical._mds import sampled_scaling
from unbend.canonical._pose import check_form, lay_into_pose
from unbend.canonical._sampling import farthest_point_sampling, shape_end, spread_samples

if TYPE_CHECKING:
    from unbend.canonical.estimator import SpectralMDS as SpectralMDS

__all__ = [
    "CanonicalForm",
    "SpectralMDS",
    "canonical_form",
    "check_form",
    "distance_coefficients",
    "farthest_point_sampling",
    "interpolate",
    "lay_into_pose",
    "sampled_canonical_form",
    "sampled_scaling",
    "shape_end",
    "spread_samples",
]


if not TYPE_CHECKING:  # type checkers would take any name for one of these

    def __getattr__(name: str) -> Any:
        """Import scikit-learn, which is slow, on first use of the estimator."""
        if name == "SpectralMDS":
            from unbend.canonical.estimator import SpectralMDS

            return SpectralMDS
        raise AttributeError(f"module 'unbend.canonical' has no attribute {name!r}")
