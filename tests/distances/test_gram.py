import numpy as np
import pytest

import dense
from unbend import Mesh, diagnose, distance, laplacian, spectrum
from unbend.datasets import make_sphere
from unbend.distances import gram_metric
from unbend.errors import InputError, SolverError
from unbend.linalg.pseudoinverse import green_operator
from unbend.spectral import make_surface

TIME = 0.2
FILTERS = {
    "biharmonic": lambda values: values**-2,
    "commute-time": lambda values: values**-1,
    "diffusion": lambda values: np.exp(-2 * TIME * values),
}


def options(kind):
    return {"distance": kind, "time": TIME} if kind == "diffusion" else {"distance": kind}


@pytest.fixture(scope="module")
def blob(blob):
    """The blob at unit area, where a diffusion time is what it says."""
    return Mesh(blob.vertices / np.sqrt(laplacian(blob).areas.sum()), blob.faces)


@pytest.fixture(scope="module", params=FILTERS)
def kind(request):
    return request.param


def test_from_sources_equals_the_dense_formula(blob, kind):
    expected = dense.distances(dense.kernel(laplacian(blob), FILTERS[kind]))
    found = distance(blob, [0, 77, 300], **options(kind))
    # Near 0 a distance is the square root of what rounding leaves of a difference.
    np.testing.assert_allclose(found, expected[[0, 77, 300]], atol=1e-6 * expected.max())


@pytest.mark.parametrize("kind", ["biharmonic", "commute-time"])
def test_the_diagonal_is_solved_for_once(blob, kind):
    """Sources one at a time, as farthest-point sampling asks for them."""
    surface = make_surface(blob)
    green = green_operator(surface.operator.stiffness, surface.operator.areas)
    columns = []

    def counted(block):
        columns.append(block.shape[1])
        return green(block)

    metric = gram_metric(kind, surface, TIME, counted)
    rows = [metric.from_sources(np.array([source])) for source in (3, 90, 5)]
    assert (np.vstack(rows)[:, [3, 90, 5]].diagonal() == 0).all()
    assert sum(columns) <= blob.n_vertices + 3 * 2


def test_all_eigenpairs_truncate_nothing(blob, kind):
    everything = distance(blob, 5, **options(kind), n_eigenpairs=blob.n_vertices)
    exact = distance(blob, 5, **options(kind))
    np.testing.assert_allclose(everything, exact, atol=1e-6 * exact.max())


def test_truncation_is_the_printed_sum(blob, kind):
    k = 12
    found = spectrum(blob, k)
    weights = np.sqrt(FILTERS[kind](found.eigenvalues[1:]))
    embedding = found.eigenfunctions[:, 1:] * weights
    expected = np.linalg.norm(embedding - embedding[9], axis=1)
    truncated = distance(blob, 9, **options(kind), n_eigenpairs=k)
    np.testing.assert_allclose(truncated[0], expected, atol=1e-9 * expected.max())


def test_is_a_metric(blob, kind):
    every = distance(blob, np.arange(0, 642, 40), **options(kind))[:, ::40]
    np.testing.assert_allclose(every, every.T, atol=1e-6 * every.max())
    np.testing.assert_allclose(np.diag(every), 0, atol=1e-6 * every.max())
    through = (every[:, :, None] + every[None, :, :]).min(axis=1)
    assert (every <= through + 1e-6 * every.max()).all()


@pytest.mark.parametrize(
    ("kind", "power"), [("biharmonic", 1), ("commute-time", 0), ("geodesic", 1), ("diffusion", -1)]
)
def test_scaling_the_mesh_scales_the_distance(blob, kind, power):
    small = distance(blob, 3, distance=kind)
    large = distance((blob.vertices * 10, blob.faces), 3, distance=kind)
    np.testing.assert_allclose(large, small * 10.0**power, rtol=1e-5, atol=1e-5 * large.max())


def test_too_short_a_diffusion_time_is_refused_with_the_shortest(real_data):
    mesh = real_data / "tosca_remeshed" / "cat0.off"
    with pytest.raises(InputError, match=r"use .* of the area or more"):
        distance(mesh, 0, distance="diffusion", time=1e-9)


def test_a_diffusion_time_is_right_until_it_is_refused(blob):
    """Where it is long, the first eigenfunctions that differ from it alone are left."""
    mesh = Mesh(blob.vertices / np.sqrt(diagnose(blob).area), blob.faces)
    pairs = spectrum(mesh, 16)
    longest = 660 / (2 * pairs.eigenvalues[1])
    found = distance(mesh, 0, distance="diffusion", time=longest)[0]
    filtered = np.exp(-longest * pairs.eigenvalues[1:])
    apart = (pairs.eigenfunctions[:, 1:] - pairs.eigenfunctions[0, 1:]) * filtered
    np.testing.assert_allclose(found / found.max(), np.linalg.norm(apart / found.max(), axis=1))
    with pytest.raises(InputError, match="all distances vanish; use"):
        distance(mesh, 0, distance="diffusion", time=1.02 * longest)


def test_the_constant_eigenfunction_tells_no_distance(blob):
    with pytest.raises(InputError, match="n_eigenpairs must be at least 2"):
        distance(blob, 0, n_eigenpairs=1)


def test_geodesic_cannot_be_truncated(blob):
    with pytest.raises(InputError, match="n_eigenpairs is for spectral"):
        distance(blob, 0, distance="geodesic", n_eigenpairs=10)


@pytest.mark.parametrize(
    ("kind", "spoil", "message"),
    [
        ("biharmonic", lambda solved: solved + 1e-3 * np.roll(solved, 1, axis=0), "two ways"),
        ("commute-time", lambda solved: -solved, "not positive semi-definite"),
    ],
)
def test_a_kernel_that_is_none_is_an_error_with_the_figure(blob, monkeypatch, kind, spoil, message):
    def wrong(stiffness, areas):
        right = green_operator(stiffness, areas)
        return lambda block: spoil(right(block))

    monkeypatch.setattr("unbend.distances._gram.green_operator", wrong)
    with pytest.raises(SolverError, match=message):
        distance(blob, [0, 9], distance=kind)


@pytest.mark.parametrize("length", [1, 30])
@pytest.mark.parametrize("time", [0.1, 0.02, 0.005])
def test_as_many_eigenpairs_as_a_diffusion_time_needs(length, time):
    """A long surface has far more low eigenvalues than its area alone says."""
    sphere = make_sphere(2)
    mesh = Mesh(sphere.vertices * [1, 1, length], sphere.faces)
    mesh = Mesh(mesh.vertices / np.sqrt(laplacian(mesh).areas.sum()), mesh.faces)
    kernel = dense.kernel(laplacian(mesh), lambda values: np.exp(-2 * time * values))
    expected = dense.distances(kernel)
    found = distance(mesh, [0, 50], distance="diffusion", time=time)
    np.testing.assert_allclose(found, expected[[0, 50]], atol=1e-10 * expected.max())
