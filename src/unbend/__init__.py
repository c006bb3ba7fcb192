"""Pose-free canonical forms of deformable 3-D shapes.

The names below are the public API. They are loaded on first use, so that importing the
package (and the command line's ``--help``) stays fast.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from unbend.mesh import Mesh as Mesh
    from unbend.mesh import as_mesh as as_mesh

__version__ = "0.1.0"

_HOME = {
    "Mesh": "mesh",
    "as_mesh": "mesh",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"unbend.{_HOME[name]}"), name)
    raise AttributeError(f"module 'unbend' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
