"""Shapes to try things on: synthetic animals whose true correspondences are known."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from unbend.datasets.biped import make_biped as make_biped
    from unbend.datasets.octopus import make_octopus as make_octopus
    from unbend.datasets.quadruped import make_quadruped as make_quadruped
    from unbend.datasets.shape import Shape as Shape
    from unbend.datasets.shape import rest_map as rest_map

_HOME = {
    "Shape": "shape",
    "make_biped": "biped",
    "make_octopus": "octopus",
    "make_quadruped": "quadruped",
    "rest_map": "shape",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"unbend.datasets.{_HOME[name]}"), name)
    raise AttributeError(f"module 'unbend.datasets' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
