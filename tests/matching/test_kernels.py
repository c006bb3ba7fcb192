"""The matcher's compiled loops against plain NumPy, on small input; run uncompiled too."""

import numpy as np
import pytest
import scipy.sparse as sp

from unbend import Mesh
from unbend.alignment import nearest_rotation
from unbend.datasets import make_sphere
from unbend.matching import _kernels as kernels
from unbend.matching._shape import make_shape
from unbend.mesh import vertex_normals

pytestmark = pytest.mark.kernels


def _graph(mesh: Mesh) -> sp.csr_matrix:
    """Edges of a mesh with weights of their own, as registration has them."""
    ones = np.ones((mesh.n_vertices, 2))
    return make_shape(mesh.vertices, mesh.faces, ones[:, 0], ones[0], ones).spokes


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


@pytest.mark.parametrize("d", [1, 3, 6])
def test_every_chosen_point_is_the_farthest_from_those_before_it(d: int) -> None:
    points = np.random.default_rng(d).normal(size=(60, d))
    chosen = kernels.farthest_points(points, 20, 7)
    assert chosen[0] == 7
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    for i in range(1, 20):
        to_chosen = apart[chosen[:i]].min(axis=0)
        assert to_chosen[chosen[i]] == pytest.approx(to_chosen.max())
    assert len(np.unique(kernels.farthest_points(points, 60, 0))) == 60


def test_of_points_that_are_equally_far_the_first_is_chosen() -> None:
    points = np.array([[0.0, 0], [3, 4], [1, 1], [5, 0], [-4, 3], [0, -5]])
    np.testing.assert_array_equal(kernels.farthest_points(points, 3, 0), [0, 1, 4])


def _walk(left: np.ndarray, right: np.ndarray, guess: np.ndarray, graph) -> np.ndarray:
    steps = graph.indptr, graph.indices
    return kernels.walk(left, right, guess, *steps, *steps)


@pytest.mark.usefixtures("rows_of_a_task")
def test_a_walk_ends_where_no_neighbour_is_closer_and_goes_only_downhill() -> None:
    mesh = make_sphere(1)
    n, graph = mesh.n_vertices, _graph(mesh)
    rng = np.random.default_rng(0)
    left, right = rng.normal(size=(2, n, 4))
    guess = rng.integers(n, size=n)
    found = _walk(left, right, guess, graph)
    apart = np.linalg.norm(left[:, None] - right, axis=2)
    near = graph.toarray() > 0
    for i in range(n):
        starts = [guess[i], *guess[near[i]]]
        assert apart[i, found[i]] <= apart[i, starts].min()
        assert apart[i, found[i]] <= apart[i, near[found[i]]].min()


def test_a_walk_stays_where_nothing_is_closer() -> None:
    mesh = make_sphere(1)
    same = np.ones((mesh.n_vertices, 3))
    guess = np.random.default_rng(0).integers(mesh.n_vertices, size=mesh.n_vertices)
    np.testing.assert_array_equal(_walk(same, same, guess, _graph(mesh)), guess)


def test_on_a_ball_a_walk_finds_the_nearest_point_from_anywhere() -> None:
    # On a round triangulated ball whoever is not nearest has a neighbour that is nearer.
    ball = make_sphere(2)
    turned = ball.vertices @ _rotations(1, 1.0, 1)[0].T
    found = _walk(turned, ball.vertices, np.zeros(ball.n_vertices, dtype=np.int64), _graph(ball))
    apart = np.linalg.norm(turned[:, None] - ball.vertices, axis=2)
    np.testing.assert_allclose(np.take_along_axis(apart, found[:, None], 1)[:, 0], apart.min(1))


@pytest.mark.usefixtures("rows_of_a_task")
def test_sums_over_edges() -> None:
    mesh = make_sphere(1)
    graph = _graph(mesh)
    edges = graph.indptr, graph.indices, graph.data
    posed = mesh.vertices + 0.3 * np.random.default_rng(0).normal(size=mesh.vertices.shape)
    weights = graph.toarray()
    rest_edges, posed_edges = (p[None, :] - p[:, None] for p in (mesh.vertices, posed))
    np.testing.assert_allclose(
        kernels.edge_covariances(*edges, mesh.vertices, posed),
        np.einsum("ij,ija,ijb->iab", weights, rest_edges, posed_edges),
        atol=1e-12,
    )
    turns = _rotations(mesh.n_vertices, 2.0, 1)
    both = (turns[:, None] + turns) / 2
    np.testing.assert_allclose(
        kernels.rotated_divergence(*edges, mesh.vertices, turns),
        np.einsum("ij,ijab,ijb->ia", weights, both, -rest_edges),
        atol=1e-12,
    )


@pytest.mark.usefixtures("rows_of_a_task")
def test_several_poses_side_by_side_are_as_each_alone() -> None:
    mesh = make_sphere(1)
    graph, n, poses = _graph(mesh), mesh.n_vertices, 3
    edges = graph.indptr, graph.indices, graph.data
    rng = np.random.default_rng(0)
    posed = mesh.vertices[:, None] + 0.3 * rng.normal(size=(n, poses, 3))
    turns = np.stack([_rotations(n, 2.0, i) for i in range(poses)], axis=1)
    rows, weights = rng.integers(n, size=(n, poses)), rng.random((n, poses))
    left, right = rng.normal(size=(2, n, poses, 5))
    walked = _walk(left, right, rows, graph)
    covariances = kernels.edge_covariances(*edges, mesh.vertices, posed)
    squares = kernels.edge_squares(*edges, posed)
    divergence = kernels.rotated_divergence(*edges, mesh.vertices, turns)
    sums, total = kernels.scatter(rows, weights, mesh.vertices, n)
    for i in range(poses):
        one, ways = np.ascontiguousarray(posed[:, i]), np.ascontiguousarray(rows[:, i])
        there, back = np.ascontiguousarray(left[:, i]), np.ascontiguousarray(right[:, i])
        np.testing.assert_array_equal(walked[:, i], _walk(there, back, ways, graph))
        alone = kernels.edge_covariances(*edges, mesh.vertices, one)
        np.testing.assert_array_equal(covariances[:, i], alone)
        np.testing.assert_allclose(squares[:, i], kernels.edge_squares(*edges, one))
        own = kernels.edge_covariances(*edges, one, one)
        np.testing.assert_allclose(squares[:, i], np.trace(own, axis1=1, axis2=2))
        alone = kernels.rotated_divergence(*edges, mesh.vertices, np.ascontiguousarray(turns[:, i]))
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
    fans = kernels.faces_around(mesh.faces, mesh.n_vertices)
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
    edges = graph.indptr, graph.indices, graph.data
    np.testing.assert_allclose(
        kernels.rotated_divergence(*edges, mesh.vertices, turns),
        stiffness @ (mesh.vertices @ turn.T),
        atol=1e-12,
    )


def test_faces_around_vertices() -> None:
    faces = make_sphere(0).faces
    n = faces.max() + 2  # the last vertex has no face
    start, ring = kernels.faces_around(faces, n)
    assert start[-1] == len(ring) == faces.size
    for i in range(n):
        assert set(ring[start[i] : start[i + 1]]) == set(np.flatnonzero((faces == i).any(axis=1)))


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


def test_largest_traces_are_those_of_the_nearest_rotations() -> None:
    rng = np.random.default_rng(0)
    matrices = rng.standard_normal((40, 3, 3)) * 10.0 ** rng.integers(-9, 9, (40, 1, 1))
    turns = _rotations(8, 2.0, 0)
    flat = turns @ (rng.standard_normal((8, 3, 1)) * rng.standard_normal((8, 1, 3)))  # of rank 1
    equal = [np.eye(3), -np.eye(3), np.diag([1.0, 1, -1]), np.diag([2.0, 2, 1]), np.zeros((3, 3))]
    left, right = _rotations(60, 3.0, 1), _rotations(60, 3.0, 2)
    alike = [left @ np.diag(one) @ right for one in ([2.0, 2, 1], [3, 0.5, 0.5])]
    matrices = np.concatenate([equal, matrices, turns, -turns, flat, *alike])
    best = nearest_rotation(matrices.transpose(0, 2, 1))
    expected = np.einsum("iab,iba->i", best, matrices)
    sizes = np.linalg.norm(matrices, axis=(1, 2))
    # What should be 0 is the root of rounding.
    assert (np.abs(kernels.largest_traces(matrices) - expected) <= 1e-7 * sizes).all()
