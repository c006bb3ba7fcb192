"""Compiled loops of deformation against plain NumPy, on small input; run uncompiled too."""

import numpy as np
import pytest
import scipy.sparse as sp

from unbend import Mesh
from unbend.alignment import nearest_rotation
from unbend.datasets import make_sphere
from unbend.deformation import ElasticSurface
from unbend.deformation import _kernels as kernels
from unbend.mesh import faces_around, vertex_normals

pytestmark = pytest.mark.kernels


def _graph(mesh: Mesh) -> sp.csr_matrix:
    """Edges of a mesh with weights of their own."""
    return ElasticSurface(mesh.vertices, mesh.faces, np.ones(mesh.n_vertices)).edge_weights


def _rotations(count: int, angle: float, seed: int) -> np.ndarray:
    """Turns by up to an angle, by Rodrigues' formula."""
    axes = np.random.default_rng(seed).normal(size=(count, 3))
    axes *= angle / np.linalg.norm(axes, axis=1).max()
    return np.array([_turn(axis) for axis in axes])


def _turn(axis: np.ndarray) -> np.ndarray:
    angle = np.linalg.norm(axis)
    x, y, z = axis / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@pytest.fixture(params=[5, 1024])
def rows_of_a_task(request, monkeypatch) -> None:
    """How rows are spread over tasks is no matter of theirs."""
    monkeypatch.setattr(kernels, "_ROWS", request.param)


@pytest.mark.usefixtures("rows_of_a_task")
def test_sums_over_edges() -> None:
    mesh = make_sphere(1)
    graph = _graph(mesh)
    posed = mesh.vertices + 0.3 * np.random.default_rng(0).normal(size=mesh.vertices.shape)
    weights = graph.toarray()
    rest_edges, posed_edges = (p[None, :] - p[:, None] for p in (mesh.vertices, posed))
    np.testing.assert_allclose(
        kernels.edge_covariances(graph, mesh.vertices, posed),
        np.einsum("ij,ija,ijb->iab", weights, rest_edges, posed_edges),
        atol=1e-12,
    )
    turns = _rotations(mesh.n_vertices, 2.0, 1)
    both = (turns[:, None] + turns) / 2
    np.testing.assert_allclose(
        kernels.rotated_divergence(graph, mesh.vertices, turns),
        np.einsum("ij,ijab,ijb->ia", weights, both, -rest_edges),
        atol=1e-12,
    )


@pytest.mark.usefixtures("rows_of_a_task")
def test_several_poses_side_by_side_are_as_each_alone() -> None:
    mesh = make_sphere(1)
    graph, n, poses = _graph(mesh), mesh.n_vertices, 3
    rng = np.random.default_rng(0)
    posed = mesh.vertices[:, None] + 0.3 * rng.normal(size=(n, poses, 3))
    turns = np.stack([_rotations(n, 2.0, i) for i in range(poses)], axis=1)
    rows, weights = rng.integers(n, size=(n, poses)), rng.random((n, poses))
    covariances = kernels.edge_covariances(graph, mesh.vertices, posed)
    squares = kernels.edge_squares(graph, posed)
    divergence = kernels.rotated_divergence(graph, mesh.vertices, turns)
    sums, total = kernels.scatter(rows, weights, mesh.vertices, n)
    for i in range(poses):
        one, ways = np.ascontiguousarray(posed[:, i]), np.ascontiguousarray(rows[:, i])
        alone = kernels.edge_covariances(graph, mesh.vertices, one)
        np.testing.assert_array_equal(covariances[:, i], alone)
        np.testing.assert_allclose(squares[:, i], kernels.edge_squares(graph, one))
        own = kernels.edge_covariances(graph, one, one)
        np.testing.assert_allclose(squares[:, i], np.trace(own, axis1=1, axis2=2))
        alone = kernels.rotated_divergence(graph, mesh.vertices, np.ascontiguousarray(turns[:, i]))
        np.testing.assert_array_equal(divergence[:, i], alone)
        each = kernels.scatter(ways, np.ascontiguousarray(weights[:, i]), mesh.vertices, n)
        np.testing.assert_array_equal(sums[:, i], each[0])
        np.testing.assert_array_equal(total[:, i], each[1])


@pytest.mark.usefixtures("rows_of_a_task")
def test_normals_of_several_poses() -> None:
    mesh = make_sphere(1)
    posed = mesh.vertices[:, None] * np.random.default_rng(0).uniform(0.5, 2, size=(1, 2, 3))
    posed[:, 1] = 1.0  # no face has an area
    rows = np.full((mesh.n_vertices, 2, 7), 9.0)
    fans = faces_around(mesh.faces, mesh.n_vertices)
    kernels.normals_into(rows, 2, posed, mesh.faces, *fans)
    expected = vertex_normals(posed[:, 0], mesh.faces)
    np.testing.assert_allclose(rows[:, 0, 2:5], expected, atol=1e-12)
    np.testing.assert_array_equal(rows[:, 1, 2:5], 0)
    assert (rows[..., [0, 1, 5, 6]] == 9).all()


def test_a_surface_turned_as_a_whole_solves_its_own_system() -> None:
    mesh = make_sphere(1)
    graph = _graph(mesh)
    turn = _rotations(1, 2.0, 3)[0]
    turns = np.tile(turn, (mesh.n_vertices, 1, 1))
    stiffness = sp.diags(np.asarray(graph.sum(axis=1)).ravel()) - graph
    np.testing.assert_allclose(
        kernels.rotated_divergence(graph, mesh.vertices, turns),
        stiffness @ (mesh.vertices @ turn.T),
        atol=1e-12,
    )


def test_weighted_rows_are_added_up_where_they_go() -> None:
    rng = np.random.default_rng(0)
    rows, weights, values = rng.integers(6, size=40), rng.random(40), rng.normal(size=(40, 3))
    sums, total = kernels.scatter(rows, weights, values, 8)
    np.testing.assert_allclose(total, np.bincount(rows, weights, 8), atol=1e-12)
    expected = np.zeros((8, 3))
    np.add.at(expected, rows, weights[:, None] * values)
    np.testing.assert_allclose(sums, expected, atol=1e-12)


@pytest.mark.usefixtures("rows_of_a_task")
def test_rotations_turn_to_those_that_explain_best() -> None:
    rng = np.random.default_rng(0)
    truth = _rotations(30, 3.0, 0)
    stretch = rng.normal(size=(30, 3, 3))
    stretch = stretch @ stretch.transpose(0, 2, 1) + 0.3 * np.eye(3)
    covariances = stretch @ truth.transpose(0, 2, 1)  # R C is the stretch, turned: trace greatest
    expected = nearest_rotation(covariances.transpose(0, 2, 1))
    np.testing.assert_allclose(expected, truth, atol=1e-9)
    rotations = _rotations(30, 0.5, 1) @ truth

    def trace(turns: np.ndarray) -> np.ndarray:
        return np.einsum("nab,nba->n", turns, covariances)

    before = trace(rotations)
    for _ in range(40):
        kernels.turn_rotations(covariances, rotations)
        after = trace(rotations)
        assert (after >= before - 1e-9).all()
        before = after
    np.testing.assert_allclose(rotations, truth, atol=1e-5)
    np.testing.assert_allclose(np.linalg.det(rotations), 1)


def test_a_rotation_without_a_covariance_stays() -> None:
    turns = _rotations(4, 1.0, 0)
    left = turns.copy()
    kernels.turn_rotations(np.zeros((4, 3, 3)), left)
    np.testing.assert_array_equal(left, turns)
