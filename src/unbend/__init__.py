"""Pose-free canonical forms of deformable 3-D shapes.

The names below are the public API. They are loaded on first use, so that importing the
package (and the command line's ``--help``) stays fast.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from unbend.alignment import Alignment as Alignment
    from unbend.alignment import align as align
    from unbend.alignment import procrustes as procrustes
    from unbend.canonical import CanonicalForm as CanonicalForm
    from unbend.canonical import canonical_form as canonical_form
    from unbend.canonical import farthest_point_sampling as farthest_point_sampling
    from unbend.canonical import interpolate as interpolate
    from unbend.canonical.estimator import SpectralMDS as SpectralMDS
    from unbend.collection import Collection as Collection
    from unbend.collection import descriptor as descriptor
    from unbend.collection import mean_shape as mean_shape
    from unbend.collection import retrieval_measures as retrieval_measures
    from unbend.collection import shape_statistics as shape_statistics
    from unbend.correspondence import Evaluation as Evaluation
    from unbend.correspondence import Registration as Registration
    from unbend.correspondence import evaluate as evaluate
    from unbend.correspondence import morph as morph
    from unbend.correspondence import read_functional_map as read_functional_map
    from unbend.correspondence import read_match as read_match
    from unbend.correspondence import register as register
    from unbend.correspondence import similarity as similarity
    from unbend.correspondence import transfer as transfer
    from unbend.correspondence import write_functional_map as write_functional_map
    from unbend.correspondence import write_match as write_match
    from unbend.distances import distance as distance
    from unbend.io import MeshLike as MeshLike
    from unbend.io import as_mesh as as_mesh
    from unbend.io import invert_map as invert_map
    from unbend.io import read_map as read_map
    from unbend.io import read_mesh as read_mesh
    from unbend.io import read_values as read_values
    from unbend.io import write_map as write_map
    from unbend.io import write_mesh as write_mesh
    from unbend.io import write_values as write_values
    from unbend.matching import Match as Match
    from unbend.matching import match as match
    from unbend.matching import symmetry as symmetry
    from unbend.mesh import Mesh as Mesh
    from unbend.preparation import Diagnosis as Diagnosis
    from unbend.preparation import diagnose as diagnose
    from unbend.report.match_figures import match_colors as match_colors
    from unbend.report.pages import form_page as form_page
    from unbend.report.pages import match_page as match_page
    from unbend.report.pages import search_page as search_page
    from unbend.report.pages import similarity_page as similarity_page
    from unbend.spectral import Laplacian as Laplacian
    from unbend.spectral import Spectrum as Spectrum
    from unbend.spectral import laplacian as laplacian
    from unbend.spectral import spectrum as spectrum

__version__ = "0.2.0"

_HOME = {
    "Alignment": "alignment",
    "CanonicalForm": "canonical",
    "Collection": "collection",
    "Diagnosis": "preparation",
    "Evaluation": "correspondence",
    "Laplacian": "spectral",
    "Match": "matching",
    "Mesh": "mesh",
    "MeshLike": "io",
    "Registration": "correspondence",
    "SpectralMDS": "canonical.estimator",
    "Spectrum": "spectral",
    "align": "alignment",
    "as_mesh": "io",
    "canonical_form": "canonical",
    "descriptor": "collection",
    "diagnose": "preparation",
    "distance": "distances",
    "evaluate": "correspondence",
    "farthest_point_sampling": "canonical",
    "form_page": "report.pages",
    "interpolate": "canonical",
    "invert_map": "io",
    "laplacian": "spectral",
    "match": "matching",
    "match_colors": "report.match_figures",
    "match_page": "report.pages",
    "mean_shape": "collection",
    "morph": "correspondence",
    "procrustes": "alignment",
    "read_functional_map": "correspondence",
    "read_map": "io",
    "read_match": "correspondence",
    "read_mesh": "io",
    "read_values": "io",
    "register": "correspondence",
    "retrieval_measures": "collection",
    "search_page": "report.pages",
    "shape_statistics": "collection",
    "similarity": "correspondence",
    "similarity_page": "report.pages",
    "spectrum": "spectral",
    "symmetry": "matching",
    "transfer": "correspondence",
    "write_functional_map": "correspondence",
    "write_map": "io",
    "write_match": "correspondence",
    "write_mesh": "io",
    "write_values": "io",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"unbend.{_HOME[name]}"), name)
    raise AttributeError(f"module 'unbend' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
