"""What the tests share: where the real shapes are, and a few surfaces of our own."""

import functools
import gc
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from sheets import make_blob
from unbend import Mesh
from unbend.datasets import make_sphere, shape
from unbend.report import new_figure
from unbend.spectral import use_cache

# Examples are drawn the same way in every run: a failure can be repeated.
settings.register_profile("unbend", deadline=None, derandomize=True, max_examples=20)
settings.load_profile("unbend")

# Files of tests of several seconds each.
LONG = {
    *("test_accuracy.py", "test_benchmarks.py", "test_bodies.py", "test_docs.py"),
    *("test_endurance.py", "test_engine.py", "test_reproducible.py"),
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with long tests: no worker ends with one while the others have nothing to do."""
    items.sort(key=lambda item: item.path.name not in LONG)


def pytest_collection_finish() -> None:
    """Let garbage be looked for among what tests make, not among all modules and tests as well."""
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep the tests out of the user's cache."""
    os.environ["UNBEND_CACHE_DIR"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session", autouse=True)
def _bodies_made_once() -> Iterator[None]:
    """Keep every body at rest, not the last few: meshing one takes longer than most tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shape, "_rest_body", functools.cache(shape._rest_body.__wrapped__))
        yield


@pytest.fixture(scope="module", autouse=True)
def _coarse_figures(request: pytest.FixtureRequest) -> Iterator[None]:
    """Draw figures with few pixels, except where their looks are tested."""
    with pytest.MonkeyPatch.context() as patch:
        if "report" not in request.path.parts:
            patch.setitem(new_figure.__kwdefaults__, "dpi", 30)
        yield


@pytest.fixture
def no_cache() -> Iterator[None]:
    """Read no eigenpairs from disk, and keep none."""
    with use_cache(gib=0):
        yield


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real shapes that UNBEND_DATA names."""
    folder = os.environ.get("UNBEND_DATA")
    if not folder:
        pytest.skip("UNBEND_DATA is not set: no real shapes to test on")
    return Path(folder)


@pytest.fixture(scope="module")
def screenshots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of pictures of pages: what UNBEND_SCREENSHOTS names, or one for the tests."""
    folder = os.environ.get("UNBEND_SCREENSHOTS")
    if not folder:
        return tmp_path_factory.mktemp("screenshots")
    Path(folder).mkdir(parents=True, exist_ok=True)
    return Path(folder)


@pytest.fixture(scope="session")
def blob() -> Mesh:
    """A closed surface of 642 vertices without symmetry: a sphere with three limbs."""
    return make_blob(3)


@pytest.fixture
def blob_and_ball(blob: Mesh) -> Mesh:
    """Two components: the blob, whose vertices are first, and a smaller ball beside it."""
    ball = make_sphere(2)
    return Mesh(
        np.vstack([blob.vertices, ball.vertices + 9]),
        np.vstack([blob.faces, ball.faces + blob.n_vertices]),
    )


@pytest.fixture(scope="session")
def moebius_strip() -> Mesh:
    """A surface with one side."""
    n = 60
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)[:, None]
    across = np.linspace(-0.4, 0.4, 5)
    radius = 1 + across * np.cos(angle / 2)
    points = [radius * np.cos(angle), radius * np.sin(angle), across * np.sin(angle / 2)]
    row, column = (one.ravel() for one in np.mgrid[:n, :4])
    after = np.where(row == n - 1, 0, row + 1) * 5
    here, here_up = row * 5 + column, row * 5 + column + 1
    there = after + np.where(row == n - 1, 4 - column, column)
    there_up = after + np.where(row == n - 1, 3 - column, column + 1)
    faces = np.stack([here, there, here_up, here_up, there, there_up], axis=1).reshape(-1, 3)
    return Mesh(np.stack(points, axis=2).reshape(-1, 3), faces)
