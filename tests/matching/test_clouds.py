"""Point clouds are matched like the meshes that they are sampled from."""

import numpy as np
import pytest

from testshapes.measures import along_edges, area
from testshapes.scanning import sample_points
from unbend import Match, Mesh, match, transfer
from unbend.datasets import make_quadruped
from unbend.errors import InputError, UnbendWarning

BODY = make_quadruped(n_vertices=2500, random_state=0)


def mean_error(mesh: Mesh, images: np.ndarray, truth: np.ndarray) -> float:
    """Mean distance along edges, in square roots of the area."""
    known = np.random.default_rng(0).permutation(np.flatnonzero(images >= 0))[:100]
    away = along_edges(mesh, truth[known])
    return float(away[np.arange(len(known)), images[known]].mean() / np.sqrt(area(mesh)))


@pytest.fixture(scope="module")
def found() -> Match:
    return match(BODY.mesh.vertices, BODY.mesh, barycentric=True)


def test_a_cloud_of_a_mesh_s_own_vertices_matches_it(found: Match) -> None:
    n = BODY.mesh.n_vertices
    every = np.arange(n)
    assert found.source_to_target.shape == (n,)
    assert found.target_to_source.shape == (n,)
    assert mean_error(BODY.mesh, found.source_to_target, every) < 0.03
    assert mean_error(BODY.mesh, found.target_to_source, every) < 0.03
    assert found.confidence > 0.9
    assert found.faces is not None
    assert found.faces.shape == (n,)


def test_values_are_carried_from_points_to_a_mesh(found: Match) -> None:
    cloud, mesh = Mesh(BODY.mesh.vertices), BODY.mesh
    carried = transfer(cloud.vertices, found, kind="scalar", source=cloud, target=mesh)
    apart = np.linalg.norm(carried - mesh.vertices, axis=1)
    assert apart.mean() < 0.03 * np.sqrt(area(mesh))


def test_two_noisy_clouds_match_each_other() -> None:
    """The result has no faces, for the target has none."""
    one, other = (sample_points(BODY.mesh, 3000, noise=0.003, random_state=seed) for seed in (1, 2))
    found = match(one.mesh, other.mesh, barycentric=True)
    images = np.where(found.source_to_target >= 0, other.origin[found.source_to_target], -1)
    assert (images >= 0).mean() > 0.98
    assert mean_error(BODY.mesh, images, one.origin) < 0.04
    assert found.confidence > 0.9
    assert found.faces is None


def test_outliers_have_no_partner() -> None:
    n = BODY.mesh.n_vertices
    far = np.array([[1, 2, 3], [3, 1, 2]]) * np.ptp(BODY.mesh.vertices)
    cloud = Mesh(np.vstack([BODY.mesh.vertices, far]), name="cloud")
    with pytest.warns(UnbendWarning, match="cloud: 2 points are not on its surface: -1 in a map"):
        found = match(cloud, BODY.mesh, refine=False)
    np.testing.assert_array_equal(found.source_to_target[n:], -1)
    assert (found.source_to_target[:n] >= 0).all()
    assert (found.target_to_source < n).all()
    with (
        pytest.warns(UnbendWarning),
        pytest.raises(InputError, match=f"cloud: vertex {n} is not on its surface"),
    ):
        match(cloud, BODY.mesh, landmarks=[[n, 0]])
