"""What the tests share: where the real shapes are, and a few surfaces of our own."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from unbend import Mesh
from unbend.datasets import make_sphere

# Examples are drawn the same way in every run: a failure can be repeated.
settings.register_profile("unbend", deadline=None, derandomize=True, max_examples=20)
settings.load_profile("unbend")


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep the tests out of the user's cache."""
    os.environ["UNBEND_CACHE_DIR"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real shapes that UNBEND_DATA names."""
    folder = os.environ.get("UNBEND_DATA")
    if not folder:
        pytest.skip("UNBEND_DATA is not set: no real shapes to test on")
    return Path(folder)


@pytest.fixture(scope="session")
def blob() -> Mesh:
    """A closed surface of 642 vertices without symmetry: a sphere with three limbs."""
    sphere = make_sphere(3)
    points = sphere.vertices.copy()
    for direction, length in (((1, 0.2, 0), 2.0), ((0, 1, 0.3), 1.2), ((-0.5, -0.4, 1), 0.7)):
        limb = np.array(direction) / np.linalg.norm(direction)
        points += length * np.exp(-6 * (1 - sphere.vertices @ limb))[:, None] * limb
    return Mesh(points, sphere.faces, name="blob")
