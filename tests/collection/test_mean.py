"""The mean of registered shapes: who counts, and that the truth comes back."""

from contextlib import contextmanager

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from unbend import Mesh
from unbend.collection import mean_shape, shape_statistics
from unbend.correspondence import Registration
from unbend.datasets import make_biped, make_octopus, rest_map
from unbend.errors import InputError, MeshError
from unbend.mesh import edge_ends, vertex_areas


@pytest.fixture(scope="module")
def shapes(blob: Mesh):
    """Blobs of different heights, turned anyhow."""
    turns = Rotation.random(5, rng=np.random.default_rng(0)).as_matrix()
    return [
        Mesh(blob.vertices * [1, 1, 1 + 0.1 * i] @ turn + i, blob.faces, name=f"s{i}")
        for i, turn in enumerate(turns)
    ]


@pytest.fixture
def registered(monkeypatch):
    """Registration along the truth, so that only what is made of it is tested."""

    def lay(template, scan):
        if scan.n_vertices != template.n_vertices:
            raise MeshError(f"{scan.name}: not of this kind")
        told = {"unsure": (0.4999, 1.0), "torn": (0.9, 0.4999)}
        confidence, coverage = told.get(scan.name, (0.9, 1.0))
        nothing = np.zeros(scan.n_vertices)
        mesh = Mesh(scan.vertices, template.faces)
        return Registration(mesh, nothing, nothing > 0, coverage, 1.0, confidence)

    monkeypatch.setattr("unbend.collection._mean.register", lay)


def test_who_does_not_match_is_left_out_and_listed(blob, shapes, registered):
    odd = [Mesh(blob.vertices, blob.faces, name=name) for name in ("unsure", "torn")]
    other = make_octopus(n_vertices=600).mesh
    told = []
    found = mean_shape([odd[0], *shapes, odd[1], other], blob, progress=lambda *at: told.append(at))
    assert found.names == tuple(f"s{i}" for i in range(5))
    assert [one.path for one in found.left_out] == ["unsure", "torn", other.name]
    reasons = [one.reason for one in found.left_out]
    assert reasons[0] == "the match's confidence is 0.4999, less than 0.5"
    assert reasons[1] == "49.99% of the template lies on it, less than 50%"
    assert "not of this kind" in reasons[2]
    assert told[-1][1] == 1
    assert told[-1][0].startswith("8 of 8 shapes, 1 failed,")
    plain = shape_statistics([one.vertices for one in shapes], weights=vertex_areas(blob))
    np.testing.assert_allclose(found.statistics.variances, plain.variances, rtol=1e-5, atol=1e-12)
    # It stands as the template does.
    turn, _ = Rotation.align_vectors(
        found.mean.vertices, blob.vertices - blob.vertices.mean(axis=0)
    )
    assert turn.magnitude() < 0.05
    np.testing.assert_array_equal(found.mean.faces, blob.faces)
    np.testing.assert_allclose(found.at(0, 3).vertices, found.statistics.at(0, 3))


def test_two_shapes_must_be_left(blob, registered):
    odd = Mesh(blob.vertices, blob.faces, name="unsure")
    with pytest.raises(InputError, match="0 are left; unsure was left out: the match's confidence"):
        mean_shape([odd, odd], (blob.vertices, blob.faces))


@pytest.mark.parametrize("share", [-0.1, 1.1, np.nan])
def test_shares_are_from_0_to_1(blob, shapes, registered, share):
    for name in ("min_confidence", "min_coverage"):
        with pytest.raises(InputError, match=f"{name} must be from 0 to 1, not"):
            mean_shape(shapes, blob, **{name: share})


def test_what_ends_a_worker_is_left_out(blob, monkeypatch):
    @contextmanager
    def engine(**_):
        yield lambda work, tasks: [[(task, None, "its worker died") for task in tasks]]

    monkeypatch.setattr("unbend.collection._mean.engine", engine)
    with pytest.raises(InputError, match="blob was left out: its worker died"):
        mean_shape([blob], blob)


def test_a_mirror_image_is_another_shape(blob, registered):
    mirrored = Mesh(blob.vertices * [-1, 1, 1], blob.faces)
    shapes = shape_statistics([blob.vertices, mirrored.vertices], weights=vertex_areas(blob))
    found = mean_shape([blob, mirrored], blob).statistics
    assert found.total_variance == pytest.approx(shapes.total_variance)


def test_registered_bodies_give_the_mean_and_the_component_of_true_ones():
    # Bodies that differ in their legs most, each meshed on its own.
    template = make_biped("standing", n_vertices=700)
    lengths = np.array([0.8, 1.0, 1.3])
    bodies = [
        make_biped("standing", n_vertices=700, meshing=i, legs=length, head=1 + 0.05 * (-1) ** i)
        for i, length in enumerate(lengths)
    ]
    found = mean_shape([one.mesh for one in bodies], template.mesh)
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
