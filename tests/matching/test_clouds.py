"""Point clouds are matched like the meshes that they are sampled from."""

import numpy as np
import pytest

from testshapes.measures import along_edges, area
from testshapes.scanning import sample_points
from unbend import Match, Mesh, match, transfer
from unbend.errors import InputError, UnbendWarning


def mean_error(mesh: Mesh, images: np.ndarray, truth: np.ndarray) -> float:
    """Mean distance along edges, in square roots of the area."""
    known = np.random.default_rng(0).permutation(np.flatnonzero(images >= 0))[:100]
    away = along_edges(mesh, truth[known])
    return float(away[np.arange(len(known)), images[known]].mean() / np.sqrt(area(mesh)))


@pytest.fixture(scope="module")
def found(blob: Mesh) -> Match:
    return match(blob.vertices, blob, barycentric=True)


def test_a_cloud_of_a_mesh_s_own_vertices_matches_it(blob: Mesh, found: Match) -> None:
    n = blob.n_vertices
    every = np.arange(n)
    assert found.source_to_target.shape == (n,)
    assert found.target_to_source.shape == (n,)
    assert mean_error(blob, found.source_to_target, every) < 0.03
    assert mean_error(blob, found.target_to_source, every) < 0.03
    assert found.confidence > 0.9
    assert found.faces is not None
    assert found.faces.shape == (n,)


def test_values_are_carried_from_points_to_a_mesh(blob: Mesh, found: Match) -> None:
    cloud = Mesh(blob.vertices)
    carried = transfer(cloud.vertices, found, kind="scalar", source=cloud, target=blob)
    apart = np.linalg.norm(carried - blob.vertices, axis=1)
    assert apart.mean() < 0.03 * np.sqrt(area(blob))


def test_two_noisy_clouds_match_each_other(blob: Mesh) -> None:
    """The result has no faces, for the target has none."""
    one, other = (sample_points(blob, 1000, noise=0.01, random_state=seed) for seed in (1, 2))
    found = match(one.mesh, other.mesh, barycentric=True)
    images = np.where(found.source_to_target >= 0, other.origin[found.source_to_target], -1)
    assert (images >= 0).mean() > 0.98
    assert mean_error(blob, images, one.origin) < 0.04
    assert found.confidence > 0.9
    assert found.faces is None


def test_outliers_have_no_partner(blob: Mesh) -> None:
    n = blob.n_vertices
    far = np.array([[1, 2, 3], [3, 1, 2]]) * np.ptp(blob.vertices)
    cloud = Mesh(np.vstack([blob.vertices, far]), name="cloud")
    with pytest.warns(UnbendWarning, match="cloud: 2 points are not on its surface: -1 in a map"):
        found = match(cloud, blob, refine=False)
    np.testing.assert_array_equal(found.source_to_target[n:], -1)
    assert (found.source_to_target[:n] >= 0).all()
    assert (found.target_to_source < n).all()
    with (
        pytest.warns(UnbendWarning),
        pytest.raises(InputError, match=f"cloud: vertex {n} is not on its surface"),
    ):
        match(cloud, blob, landmarks=[[n, 0]])


def test_of_two_bodies_one_is_matched_and_the_other_counts(blob: Mesh) -> None:
    both = np.vstack([blob.vertices, blob.vertices + np.array([8, 0, 0])])
    with pytest.warns(UnbendWarning, match="642 of 1,284 points are not on the largest piece"):
        found = match(both, blob, refine=False)
    assert (found.source_to_target >= 0).sum() == blob.n_vertices
    assert found.overlap_source == pytest.approx(0.5)
    assert found.overlap_target == 1
