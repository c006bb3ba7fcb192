"""An elastic surface: truths that its definition gives."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.transform import Rotation

from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.deformation import TURNING, ElasticSurface, _surface, cached
from unbend.mesh import vertex_areas
from unbend.spectral import laplacian


def _surface_of(mesh: Mesh) -> ElasticSurface:
    areas = vertex_areas(mesh)
    points = mesh.vertices - areas @ mesh.vertices / areas.sum()
    return ElasticSurface(points / np.sqrt(areas.sum()), mesh.faces, areas / areas.sum())


def test_edge_weights_are_the_cotangents_of_the_laplacian() -> None:
    ball = make_sphere(2)  # no angle is obtuse: no weight is clipped
    surface = _surface_of(ball)
    expected = laplacian(ball).stiffness.toarray()
    np.testing.assert_allclose(surface.stiffness.toarray(), expected, atol=1e-4)
    np.testing.assert_allclose(surface.stiffness @ np.ones(ball.n_vertices), 0, atol=1e-9)


def test_weights_of_thin_and_obtuse_triangles_are_clipped(blob: Mesh) -> None:
    flat = _surface_of(Mesh(blob.vertices * [1, 1, 0.001], blob.faces))
    assert (flat.edge_weights.data.min(), flat.edge_weights.data.max()) == (1e-3, 1e3)


def test_squared_edges_sum_to_four_times_the_area() -> None:
    """The Dirichlet energy of a surface's own coordinates is its area."""
    assert _surface_of(make_sphere(2)).edge_squares.sum() == pytest.approx(4)


def test_averages_keep_constants_and_the_total(blob: Mesh) -> None:
    surface = _surface_of(blob)
    values = np.random.default_rng(0).normal(size=(blob.n_vertices, 2))
    for length in (TURNING, 0.15):
        np.testing.assert_allclose(surface.averaged(surface.areas, length), 1, atol=1e-8)
        averaged = surface.averaged(surface.areas[:, None] * values, length)
        np.testing.assert_allclose(surface.areas @ averaged, surface.areas @ values)
        assert (np.ptp(averaged, axis=0) < np.ptp(values, axis=0)).all()
        assert surface.system(1.0, length**2) is surface.system(1.0, length**2)


def test_eigenfunctions_are_damped_by_their_wavelength() -> None:
    ball = make_sphere(3)
    surface, operator = _surface_of(ball), laplacian(ball)
    areas = operator.areas / operator.areas.sum()
    values, basis = scipy.linalg.eigh(operator.stiffness.toarray(), np.diag(areas))
    surface = replace(surface, areas=areas)
    for length in (TURNING, 0.15, 0.5):
        averaged = surface.averaged(surface.areas[:, None] * basis, length)
        expected = basis / (1 + length**2 * values)
        np.testing.assert_allclose(averaged, expected, atol=1e-4)


def test_a_pull_without_stiffness_leads_to_the_goal(blob: Mesh) -> None:
    surface = _surface_of(blob)
    pulled = surface.system(200.0)
    np.testing.assert_allclose(pulled.solve(200 * surface.areas), 1, atol=1e-8)
    assert surface.system(200.0) is pulled
    goal = np.random.default_rng(0).normal(size=blob.n_vertices)
    each = surface.system_of(200 * surface.areas)
    np.testing.assert_allclose(each.solve(goal), pulled.solve(goal), atol=1e-9)


@pytest.mark.parametrize("sizes", ["one", "each pose", "each vertex"])
def test_a_surface_that_is_turned_and_scaled_is_at_rest(blob: Mesh, sizes: str) -> None:
    surface, n = _surface_of(blob), blob.n_vertices
    turns = Rotation.random(2, random_state=0).as_matrix()
    size = {"one": 1.0, "each pose": np.array([2.0, 0.5]), "each vertex": np.full((n, 1), 1.5)}
    scale = np.broadcast_to(size[sizes], (n, 2))[..., None]
    goal = scale * np.einsum("pij,nj->npi", turns, surface.vertices)
    rotations = np.tile(turns, (n, 1, 1, 1))
    force = 50 * surface.areas[:, None, None] * goal
    places, covariances, averaged = surface.step(
        surface.system(50.0), force, rotations, size[sizes]
    )
    np.testing.assert_allclose(places, goal, atol=1e-8)
    np.testing.assert_allclose(rotations, np.tile(turns, (n, 1, 1, 1)), atol=1e-6)
    squares = np.einsum("npba,npab->np", rotations, covariances) / scale[..., 0]
    np.testing.assert_allclose(squares[:, 0], surface.edge_squares)
    np.testing.assert_allclose(averaged.sum(axis=(2, 3)).shape, (n, 2))


def test_steps_find_the_rotation_of_a_turned_goal(blob: Mesh) -> None:
    surface, n = _surface_of(blob), blob.n_vertices
    turn = Rotation.from_rotvec([0.5, -0.8, 0.3]).as_matrix()
    goal = surface.vertices @ turn.T
    np.testing.assert_allclose(surface.fit_rotations(goal), np.tile(turn, (n, 1, 1)), atol=1e-9)
    twice = surface.fit_rotations(goal @ turn.T, rest=goal)
    np.testing.assert_allclose(twice, np.tile(turn, (n, 1, 1)), atol=1e-9)
    rotations = np.tile(np.eye(3), (n, 1, 1))
    force = 50 * surface.areas[:, None] * goal
    for _ in range(40):
        places, *_ = surface.step(surface.system(50.0), force, rotations)
    np.testing.assert_allclose(places, goal, atol=1e-5)
    np.testing.assert_allclose(rotations, np.tile(turn, (n, 1, 1)), atol=1e-4)


def test_a_longer_average_bends_less() -> None:
    """Where one half of a ball is turned, rotations change over the length of the average."""
    surface = _surface_of(make_sphere(3))
    turn = Rotation.from_rotvec([0, 0, 0.5]).as_matrix()
    upper = surface.vertices[:, 2:] > 0
    goal = np.where(upper, surface.vertices @ turn.T, surface.vertices)
    spread = [
        surface.fit_rotations(goal, length=length)[:, 0, 1].std() for length in (0.01, 0.1, 0.5)
    ]
    assert spread[0] > spread[1] > spread[2]


def test_edge_weights_may_be_given_and_join_what_no_edge_joins() -> None:
    surface = _surface_of(make_sphere(1))
    weights = surface.edge_weights.tolil()
    weights[0, 11] = weights[11, 0] = 7.0
    before = surface.stiffness
    joined = surface.with_edge_weights(weights.tocsr())
    assert joined.stiffness[0, 11] == -7
    assert joined.stiffness[0, 0] == pytest.approx(before[0, 0] + 7)
    assert surface.stiffness is before
    assert joined.system(1.0) is not surface.system(1.0)


def test_threads_share_one_factorisation(blob: Mesh, monkeypatch: pytest.MonkeyPatch) -> None:
    surface, made = _surface_of(blob), []
    factorize = _surface.factorize

    def slow(*given, **options):
        made.append(threading.get_ident())
        time.sleep(0.05)  # the other threads arrive
        return factorize(*given, **options)

    monkeypatch.setattr(_surface, "factorize", slow)
    threads = [threading.Thread(target=surface.system, args=(3.0,)) for _ in range(4)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert len(made) == 1


def test_two_surfaces_are_computed_side_by_side() -> None:
    """Either waits for the other to begin: under one lock for both, neither would end."""
    both = threading.Barrier(2)

    class Waiting:
        def __init__(self) -> None:
            self._lock = threading.RLock()

        @cached
        def found(self) -> bool:
            return both.wait(timeout=30) >= 0

    ones, results = (Waiting(), Waiting()), []
    threads = [threading.Thread(target=lambda one=one: results.append(one.found)) for one in ones]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert results == [True, True]
