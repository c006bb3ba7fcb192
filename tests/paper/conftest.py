"""A quick run of the experiments on a few animals of our own."""

import pytest

from paper.loading import load_tosca
from paper.run import Run
from tests.paper.folders import write_animals


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("animals")
    animals = load_tosca(write_animals(folder))
    return Run(animals, None, True, 1, folder / "store", lambda step: None)
