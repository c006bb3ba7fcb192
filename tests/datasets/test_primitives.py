import numpy as np
import pytest

from unbend import diagnose
from unbend.datasets import make_sphere
from unbend.errors import InputError


@pytest.mark.parametrize("subdivisions", [0, 1, 3])
def test_sphere_is_closed_round_and_turned_outward(subdivisions):
    sphere = make_sphere(subdivisions)
    health = diagnose(sphere)
    assert sphere.n_vertices == 10 * 4**subdivisions + 2
    assert health.closed
    assert health.genus == 0
    assert health.inconsistent_edges == 0
    np.testing.assert_allclose(np.linalg.norm(sphere.vertices, axis=1), 1)
    assert (np.linalg.det(sphere.vertices[sphere.faces]) > 0).all()


def test_sphere_s_triangles_are_nearly_equal():
    sphere = make_sphere(4)
    volumes = np.linalg.det(sphere.vertices[sphere.faces])
    assert volumes.max() < 2.2 * volumes.min()


@pytest.mark.parametrize("subdivisions", [-1, 1.0, "2", 11])
def test_subdivisions_are_a_small_whole_number(subdivisions):
    with pytest.raises(InputError, match="subdivisions must be a whole number from 0 to 10"):
        make_sphere(subdivisions)
