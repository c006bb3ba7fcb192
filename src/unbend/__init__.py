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
    from unbend.archives import read_functional_map as read_functional_map
    from unbend.archives import read_match as read_match
    from unbend.archives import write_functional_map as write_functional_map
    from unbend.archives import write_match as write_match
    from unbend.canonical import CanonicalForm as CanonicalForm
    from unbend.canonical import canonical_form as canonical_form
    from unbend.carrying import transfer as transfer
    from unbend.diagnosis import Diagnosis as Diagnosis
    from unbend.diagnosis import diagnose as diagnose
    from unbend.distances import distance as distance
    from unbend.estimator import SpectralMDS as SpectralMDS
    from unbend.evaluation import Evaluation as Evaluation
    from unbend.evaluation import evaluate as evaluate
    from unbend.interpolation import interpolate as interpolate
    from unbend.io import read_mesh as read_mesh
    from unbend.io import write_mesh as write_mesh
    from unbend.laplace import Laplacian as Laplacian
    from unbend.laplace import laplacian as laplacian
    from unbend.likeness import similarity as similarity
    from unbend.maps import invert_map as invert_map
    from unbend.maps import read_map as read_map
    from unbend.maps import write_map as write_map
    from unbend.matching import Match as Match
    from unbend.matching import match as match
    from unbend.matching import symmetry as symmetry
    from unbend.mesh import Mesh as Mesh
    from unbend.mesh import as_mesh as as_mesh
    from unbend.morphing import morph as morph
    from unbend.sampling import farthest_point_sampling as farthest_point_sampling
    from unbend.spectra import Spectrum as Spectrum
    from unbend.spectra import spectrum as spectrum
    from unbend.value_files import read_values as read_values
    from unbend.value_files import write_values as write_values

__version__ = "0.1.0"

_HOME = {
    "Alignment": "alignment",
    "CanonicalForm": "canonical",
    "Diagnosis": "diagnosis",
    "Evaluation": "evaluation",
    "Laplacian": "laplace",
    "Match": "matching",
    "Mesh": "mesh",
    "SpectralMDS": "estimator",
    "Spectrum": "spectra",
    "align": "alignment",
    "as_mesh": "mesh",
    "canonical_form": "canonical",
    "diagnose": "diagnosis",
    "distance": "distances",
    "evaluate": "evaluation",
    "farthest_point_sampling": "sampling",
    "interpolate": "interpolation",
    "invert_map": "maps",
    "laplacian": "laplace",
    "match": "matching",
    "morph": "morphing",
    "procrustes": "alignment",
    "read_functional_map": "archives",
    "read_map": "maps",
    "read_match": "archives",
    "read_mesh": "io",
    "read_values": "value_files",
    "similarity": "likeness",
    "spectrum": "spectra",
    "symmetry": "matching",
    "transfer": "carrying",
    "write_functional_map": "archives",
    "write_map": "maps",
    "write_match": "archives",
    "write_mesh": "io",
    "write_values": "value_files",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"unbend.{_HOME[name]}"), name)
    raise AttributeError(f"module 'unbend' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
