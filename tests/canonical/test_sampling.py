import numpy as np
import pytest

from unbend import Mesh, distance, farthest_point_sampling
from unbend.canonical._sampling import spread_samples
from unbend.datasets import make_octopus, make_quadruped, make_sphere
from unbend.errors import InputError, UnbendWarning


@pytest.mark.parametrize(
    "options",
    [
        {"distance": "biharmonic"},
        {"distance": "geodesic"},
        {"distance": "commute-time"},
        {"distance": "diffusion"},
        {"distance": "diffusion", "time": 0.04},
        {"distance": "biharmonic", "laplacian": "robust"},
    ],
)
def test_each_sample_is_the_farthest_from_those_before(blob, options):
    blob = Mesh(blob.vertices * [1, 1, 0.2], blob.faces)  # triangles on which Laplacians differ
    samples = farthest_point_sampling(blob, 8, **options)
    rows = distance(blob, samples, **options)
    for i in range(1, 8):
        nearest = rows[:i].min(axis=0)
        assert nearest[samples[i]] == pytest.approx(nearest.max(), rel=1e-6)


def test_one_sample_is_where_it_starts(blob):
    assert farthest_point_sampling(blob, 1, start=7).tolist() == [7]


def test_every_vertex_can_be_sampled_once(blob):
    samples = farthest_point_sampling(blob, blob.n_vertices)
    np.testing.assert_array_equal(np.sort(samples), np.arange(blob.n_vertices))


def test_does_not_depend_on_vertex_order(blob):
    order = np.random.default_rng(0).permutation(blob.n_vertices)
    permuted = Mesh(blob.vertices[order], np.argsort(order)[blob.faces])
    samples = farthest_point_sampling(blob, 10, distance="biharmonic")
    np.testing.assert_array_equal(
        order[farthest_point_sampling(permuted, 10, distance="biharmonic")], samples
    )


@pytest.mark.parametrize("kind", ["biharmonic", "geodesic"])
@pytest.mark.parametrize("make", [make_quadruped, make_octopus])
def test_what_is_rounded_in_another_way_has_the_same_samples(make, kind):
    mesh = make(n_vertices=600).mesh  # of two sides, which are equally far from its middle
    other = Mesh(mesh.vertices[:, [1, 2, 0]] * 3 + 1, mesh.faces)
    samples = farthest_point_sampling(mesh, 60, distance=kind)
    assert farthest_point_sampling(other, 60, distance=kind).tolist() == samples.tolist()


def test_starts_where_it_is_told(blob):
    assert farthest_point_sampling(blob, 3, start=17)[0] == 17
    with pytest.raises(InputError, match="no vertex 1000"):
        farthest_point_sampling(blob, 3, start=1000)
    for start in (-1, 1.0, [4, 5], []):
        with pytest.raises(InputError, match="vertex"):
            farthest_point_sampling(blob, 3, start=start)


@pytest.mark.parametrize("n_samples", [0, 643, 2.5, True])
def test_impossible_numbers_of_samples_are_refused(blob, n_samples):
    with pytest.raises(InputError, match="from 1 to 642"):
        farthest_point_sampling(blob, n_samples)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"time": 0.1}, "time is for diffusion distances, not geodesic"),
        (
            {"distance": "biharmonic", "time": 0.1},
            "time is for diffusion distances, not biharmonic",
        ),
        ({"start": 3, "laplacian": "robust"}, "laplacian is for spectral distances"),
    ],
)
def test_options_that_a_distance_cannot_use_are_refused(blob, options, message):
    with pytest.raises(InputError, match=message):
        farthest_point_sampling(blob, 3, **options)


@pytest.mark.parametrize(
    "options",
    [{"laplacian": "robust"}, {"distance": "biharmonic", "start": 3, "laplacian": "robust"}],
)
def test_the_laplacian_may_be_chosen_where_it_is_used(blob, options):
    assert len(set(farthest_point_sampling(blob, 5, **options).tolist())) == 5


def test_all_samples_are_of_the_component_chosen(blob, blob_and_ball):
    with pytest.warns(UnbendWarning, match="component 1 of 2"):
        found = farthest_point_sampling(blob_and_ball, 10, component=1)
    np.testing.assert_array_equal(
        found - blob.n_vertices, farthest_point_sampling(make_sphere(2), 10)
    )


def test_points_in_one_place_are_taken_once_each():
    found, _ = spread_samples(lambda sources: np.zeros((1, 5)), 5, 5, 2)
    assert sorted(found.tolist()) == [0, 1, 2, 3, 4]
    assert found[0] == 2


def test_distances_between_samples_come_with_them():
    places = np.array([0.0, 4.0, 1.0, 9.0, 6.0])
    samples, found = spread_samples(lambda sources: abs(places[sources, None] - places), 5, 4, 2)
    assert samples.tolist() == [2, 3, 1, 4]
    chosen = places[samples]
    np.testing.assert_array_equal(found, abs(chosen[:, None] - chosen))
