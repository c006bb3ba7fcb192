"""The matcher's compiled loops against plain NumPy, on small input; run uncompiled too."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from unbend import Mesh
from unbend.alignment import nearest_rotation
from unbend.datasets import make_sphere
from unbend.deformation import ElasticSurface
from unbend.matching import _kernels as kernels

pytestmark = pytest.mark.kernels


def _graph(mesh: Mesh) -> sp.csr_matrix:
    return ElasticSurface(mesh.vertices, mesh.faces, np.ones(mesh.n_vertices)).edge_weights


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
    return kernels.walk(left, right, guess, graph, graph)


@pytest.mark.parametrize("rows", [5, 1024])
def test_a_walk_ends_where_no_neighbour_is_closer_and_goes_only_downhill(
    rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("unbend.deformation._kernels._ROWS", rows)
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
    turned = ball.vertices @ Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix().T
    found = _walk(turned, ball.vertices, np.zeros(ball.n_vertices, dtype=np.int64), _graph(ball))
    apart = np.linalg.norm(turned[:, None] - ball.vertices, axis=2)
    np.testing.assert_allclose(np.take_along_axis(apart, found[:, None], 1)[:, 0], apart.min(1))


def test_largest_traces_are_those_of_the_nearest_rotations() -> None:
    rng = np.random.default_rng(0)
    matrices = rng.standard_normal((40, 3, 3)) * 10.0 ** rng.integers(-9, 9, (40, 1, 1))
    turns = Rotation.random(8, random_state=0).as_matrix()
    flat = turns @ (rng.standard_normal((8, 3, 1)) * rng.standard_normal((8, 1, 3)))  # of rank 1
    equal = [np.eye(3), -np.eye(3), np.diag([1.0, 1, -1]), np.diag([2.0, 2, 1]), np.zeros((3, 3))]
    left, right = (Rotation.random(60, random_state=seed).as_matrix() for seed in (1, 2))
    alike = [left @ np.diag(one) @ right for one in ([2.0, 2, 1], [3, 0.5, 0.5])]
    matrices = np.concatenate([equal, matrices, turns, -turns, flat, *alike])
    best = nearest_rotation(matrices.transpose(0, 2, 1))
    expected = np.einsum("iab,iba->i", best, matrices)
    sizes = np.linalg.norm(matrices, axis=(1, 2))
    # What should be 0 is the root of rounding.
    assert (np.abs(kernels.largest_traces(matrices) - expected) <= 1e-7 * sizes).all()


def test_several_walks_side_by_side_are_as_each_alone() -> None:
    mesh = make_sphere(1)
    graph, n, rng = _graph(mesh), mesh.n_vertices, np.random.default_rng(0)
    rows = rng.integers(n, size=(n, 3))
    left, right = rng.normal(size=(2, n, 3, 5))
    walked = _walk(left, right, rows, graph)
    for i in range(3):
        one = (np.ascontiguousarray(each[:, i]) for each in (left, right, rows))
        np.testing.assert_array_equal(walked[:, i], _walk(*one, graph))
