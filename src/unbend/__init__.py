"""Match and compare deformable 3-D shapes in any pose.

The names in ``__all__`` are what most people need. Everything else that is public lives in the
folders: ``unbend.collection``, ``unbend.report``, ``unbend.datasets`` and so on. All are loaded on
first use, so that importing the package (and the command line's ``--help``) stays fast.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from unbend import alignment as alignment
    from unbend import canonical as canonical
    from unbend import collection as collection
    from unbend import correspondence as correspondence
    from unbend import datasets as datasets
    from unbend import distances as distances
    from unbend import errors as errors
    from unbend import io as io
    from unbend import matching as matching
    from unbend import mesh as mesh
    from unbend import preparation as preparation
    from unbend import report as report
    from unbend import spectral as spectral
    from unbend.alignment import align as align
    from unbend.canonical import canonical_form as canonical_form
    from unbend.canonical import farthest_point_sampling as farthest_point_sampling
    from unbend.canonical import lay_into_pose as lay_into_pose
    from unbend.canonical import sampled_canonical_form as sampled_canonical_form
    from unbend.correspondence import evaluate as evaluate
    from unbend.correspondence import morph as morph
    from unbend.correspondence import read_match as read_match
    from unbend.correspondence import register as register
    from unbend.correspondence import similarity as similarity
    from unbend.correspondence import transfer as transfer
    from unbend.correspondence import write_match as write_match
    from unbend.distances import distance as distance
    from unbend.io import as_mesh as as_mesh
    from unbend.io import read_map as read_map
    from unbend.io import read_mesh as read_mesh
    from unbend.io import write_map as write_map
    from unbend.io import write_mesh as write_mesh
    from unbend.matching import Match as Match
    from unbend.matching import match as match
    from unbend.matching import symmetry as symmetry
    from unbend.mesh import Mesh as Mesh
    from unbend.preparation import diagnose as diagnose
    from unbend.report import plot as plot
    from unbend.spectral import laplacian as laplacian
    from unbend.spectral import spectrum as spectrum

__version__ = "0.2.0"

_FOLDERS = {
    "alignment": "align",
    "canonical": "canonical_form farthest_point_sampling lay_into_pose sampled_canonical_form",
    "collection": "",
    "correspondence": "evaluate morph read_match register similarity transfer write_match",
    "datasets": "",
    "distances": "distance",
    "errors": "",
    "io": "as_mesh read_map read_mesh write_map write_mesh",
    "matching": "Match match symmetry",
    "mesh": "Mesh",
    "preparation": "diagnose",
    "report": "plot",
    "spectral": "laplacian spectrum",
}
_HOME = {name: folder for folder, names in _FOLDERS.items() for name in names.split()}

__all__ = sorted(_HOME)


if not TYPE_CHECKING:  # type checkers would take any name for one of these

    def __getattr__(name: str) -> Any:
        if name in _HOME:
            return getattr(importlib.import_module(f"unbend.{_HOME[name]}"), name)
        if name in _FOLDERS:
            return importlib.import_module(f"unbend.{name}")
        raise AttributeError(f"module 'unbend' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({"__all__", "__doc__", "__version__", *_HOME, *_FOLDERS})
