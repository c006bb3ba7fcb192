"""Reading and writing meshes."""

from __future__ import annotations

import os

from unbend.mesh import Mesh


def read_mesh(path: str | os.PathLike[str]) -> Mesh:
    """Read a mesh."""
    raise OSError(path)
