"""The mean of registered shapes: who counts, and that the truth comes back."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from unbend import Mesh
from unbend.collection import mean_shape, shape_statistics
from unbend.correspondence import Registration, register
from unbend.datasets import make_biped, make_octopus, rest_map
from unbend.errors import InputError, UnbendWarning
from unbend.mesh import edge_ends, vertex_areas


@pytest.fixture(scope="module")
def shapes(blob: Mesh):
    """Blobs of different heights, turned anyhow."""
    turns = Rotation.random(5, rng=np.random.default_rng(0)).as_matrix()
    return [
        Mesh(blob.vertices * [1, 1, 1 + 0.1 * i] @ turn + i, blob.faces, name=f"s{i}")
        for i, turn in enumerate(turns)
    ]


def registered(mesh, confidence=0.9, coverage=1.0, name=None):
    """A registration along the truth, so that only what is made of it is tested."""
    nothing = np.zeros(mesh.n_vertices)
    mesh = Mesh(mesh.vertices, mesh.faces, name=name or mesh.name)
    return Registration(mesh, nothing, nothing > 0, coverage, 1.0, confidence)


def test_who_does_not_match_is_left_out_and_listed(blob, shapes):
    unsure = registered(blob, confidence=0.4999, name="unsure")
    torn = registered(blob, coverage=0.4999, name="torn")
    found = mean_shape([unsure, *map(registered, shapes), torn], blob)
    assert found.names == tuple(f"s{i}" for i in range(5))
    assert [one.path for one in found.left_out] == ["unsure", "torn"]
    reasons = [one.reason for one in found.left_out]
    assert reasons[0] == "the match's confidence is 0.4999, less than 0.5"
    assert reasons[1] == "49.99% of the template lies on it, less than 50%"
    plain = shape_statistics([one.vertices for one in shapes], weights=vertex_areas(blob))
    np.testing.assert_allclose(found.statistics.variances, plain.variances, rtol=1e-5, atol=1e-12)
    # It stands as the template does.
    turn, _ = Rotation.align_vectors(
        found.mean.vertices, blob.vertices - blob.vertices.mean(axis=0)
    )
    assert turn.magnitude() < 0.05
    np.testing.assert_array_equal(found.mean.faces, blob.faces)
    np.testing.assert_allclose(found.at(0, 3).vertices, found.statistics.at(0, 3))


def test_two_shapes_must_be_left(blob):
    odd = registered(blob, confidence=0.4999, name="unsure")
    with pytest.raises(InputError, match="0 are left; unsure was left out: the match's confidence"):
        mean_shape([odd, odd], (blob.vertices, blob.faces))


def test_registrations_of_another_template_are_refused(blob, shapes):
    other = registered(make_octopus(n_vertices=600).mesh)
    with pytest.raises(InputError, match="is not registered to blob"):
        mean_shape([registered(shapes[0]), other], blob)


def test_a_map_that_was_given_is_trusted(blob, shapes):
    found = mean_shape([registered(one, confidence=np.nan) for one in shapes], blob)
    assert len(found.names) == 5


def test_sizes_of_different_units_are_told_unless_they_are_removed(blob, shapes):
    given = [
        *map(registered, shapes),
        registered(Mesh(1000 * blob.vertices, blob.faces), name="mm"),
    ]
    with pytest.warns(UnbendWarning, match=r"mm is 1,\d+ times as large as s0: .*--scale"):
        mean_shape(given, blob)
    mean_shape(given, blob, scale=True)


@pytest.mark.parametrize("share", [-0.1, 1.1, np.nan])
def test_shares_are_from_0_to_1(blob, shapes, share):
    for name in ("min_confidence", "min_coverage"):
        with pytest.raises(InputError, match=f"{name} must be from 0 to 1, not"):
            mean_shape(map(registered, shapes), blob, **{name: share})


def test_a_mirror_image_is_another_shape(blob):
    mirrored = Mesh(blob.vertices * [-1, 1, 1], blob.faces)
    shapes = shape_statistics([blob.vertices, mirrored.vertices], weights=vertex_areas(blob))
    found = mean_shape([registered(blob), registered(mirrored)], blob).statistics
    assert found.total_variance == pytest.approx(shapes.total_variance)


def test_registered_bodies_give_the_mean_and_the_component_of_true_ones():
    # Bodies that differ in their legs most, each meshed on its own.
    template = make_biped("standing", n_vertices=500)
    lengths = np.array([0.8, 1.0, 1.3])
    bodies = [
        make_biped("standing", n_vertices=500, meshing=i, legs=length, head=1 + 0.05 * (-1) ** i)
        for i, length in enumerate(lengths)
    ]
    found = mean_shape([register(template.mesh, one.mesh) for one in bodies], template.mesh)
    assert found.left_out == ()
    weights = vertex_areas(template.mesh)
    true = shape_statistics(
        [one.mesh.vertices[rest_map(template, one)] for one in bodies], weights=weights
    )
    assert abs(np.corrcoef(found.statistics.scores[:, 0], true.scores[:, 0])[0, 1]) > 0.99
    assert abs(np.corrcoef(found.statistics.scores[:, 0], np.log(lengths))[0, 1]) > 0.99
    turn = Rotation.align_vectors(true.mean, found.mean.vertices)[0].as_matrix()
    apart = np.linalg.norm(found.mean.vertices @ turn.T - true.mean, axis=1)
    ends = true.mean[edge_ends(template.mesh.faces, len(apart))]
    edge = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()
    assert weights @ apart / weights.sum() < 0.5 * edge
