"""A collection that the tests share."""

import multiprocessing
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from stones import computed_once, write_stones  # noqa: F401
from unbend.collection import Collection, _collection


@pytest.fixture(scope="session")
def stones(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of eight stones."""
    return write_stones(tmp_path_factory.mktemp("shapes") / "stones", 8)[0].parent


@pytest.fixture(scope="session")
def filled(stones: Path, tmp_path_factory: pytest.TempPathFactory) -> Collection:
    """A collection of the eight stones, only to be read."""
    collection = Collection(tmp_path_factory.mktemp("store") / "filled")
    assert collection.add(stones, workers=0).added == 8
    return collection


@pytest.fixture
def own(filled: Collection, tmp_path: Path) -> Collection:
    """A copy of the collection to change."""
    shutil.copytree(filled.path, tmp_path / "own")
    return Collection(tmp_path / "own")


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """Put an engine that does nothing into its place, and give what it will be asked for."""
    asked: dict[str, object] = {}

    @contextmanager
    def engine(**given):
        asked.update(given)
        yield lambda work, items: []

    monkeypatch.setattr(_collection, "engine", engine)
    return asked


@pytest.fixture
def forked() -> Iterator[None]:
    """Workers of Dask begin as copies of a process that has loaded what they need."""
    import dask
    from distributed.utils import get_mp_context

    if "forkserver" not in multiprocessing.get_all_start_methods():
        yield
        return
    with dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"}):
        get_mp_context().set_forkserver_preload(["distributed", "unbend.collection._engine"])
        yield
