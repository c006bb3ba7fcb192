"""Colours follow points, whatever the numbering."""

from dataclasses import replace

import numpy as np
import pytest

from paper.drawing import colors_of, upright
from paper.loading import load_tosca
from tests.paper.folders import write_animals
from unbend import write_map


@pytest.fixture(scope="module")
def animals(tmp_path_factory: pytest.TempPathFactory):
    return load_tosca(write_animals(tmp_path_factory.mktemp("animals")))


def test_shapes_of_tosca_stand_up_at_unit_area(animals):
    mesh, file = upright(animals, "dog0"), animals.mesh("dog0")
    corners = mesh.vertices[mesh.faces]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(sides, axis=1).sum() / 2 == pytest.approx(1)
    size = np.ptp(mesh.vertices[:, 0]) / np.ptp(file.vertices[:, 0])
    assert mesh.vertices[:, 1] == pytest.approx(size * file.vertices[:, 2])  # z is up in TOSCA
    assert upright(replace(animals, title="ours"), "dog0").vertices[:, 1] == pytest.approx(
        size * file.vertices[:, 1]
    )


def test_shapes_numbered_alike_share_their_colours(animals):
    assert (colors_of(animals, "dog0", "dog1") == colors_of(animals, "dog0", "dog0")).all()


def test_colours_follow_the_ground_truth(animals, tmp_path):
    n = animals.mesh("dog0").n_vertices
    rows = np.random.default_rng(0).permutation(n)
    write_map(tmp_path / "dog0.vts", rows)
    write_map(tmp_path / "dog1.vts", np.arange(n))
    meshed = replace(animals, corres=tmp_path)
    colors = colors_of(meshed, "dog0", "dog1")
    assert (colors == colors_of(meshed, "dog0", "dog0")[rows]).all()
