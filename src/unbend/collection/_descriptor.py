"""What describes a shape whatever its pose: numbers to compare."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from unbend.mesh import Mesh
from unbend.spectral import eigenpairs, make_surface

DESCRIPTOR_VERSION = "eigenvalues-1"


def describe(mesh: Mesh) -> npt.NDArray[np.float32]:
    """Leading eigenvalues of the largest component at unit area."""
    surface = make_surface(mesh, component="largest")
    values = eigenpairs(surface, min(31, surface.n_vertices // 2), cache=False).eigenvalues[-30:]
    return np.resize(np.sqrt(values / values.max()), 30).astype(np.float32)
