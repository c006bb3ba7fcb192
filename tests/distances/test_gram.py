import re

import numpy as np
import pytest

import dense
from unbend import Mesh, diagnose, distance, farthest_point_sampling, laplacian, spectrum
from unbend.datasets import make_sphere
from unbend.distances import _gram, make_metric
from unbend.errors import InputError, MeshError, SolverError, UnbendWarning
from unbend.linalg.factorization import Factorization
from unbend.linalg.pseudoinverse import green_and_diagonal
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
def test_the_diagonal_is_not_solved_for(blob, kind, monkeypatch):
    """Nor computed again for each source, as farthest-point sampling asks for them."""
    mesh, columns = blob, []
    monkeypatch.setattr("unbend.linalg.pseudoinverse._COMPILED_PAYS", 0)
    solve = Factorization.solve

    def counted(self, rhs):
        columns.append(rhs[:1].size)
        return solve(self, rhs)

    monkeypatch.setattr(Factorization, "solve", counted)
    metric = make_metric(kind, make_surface(mesh), sources=True)
    rows = [metric.from_sources(np.array([source])) for source in (3, 90, 5)]
    assert sum(columns) <= 2 + 3 * 2
    assert len(farthest_point_sampling(mesh, 4, distance=kind, start=0)) == 4
    expected = dense.distances(dense.kernel(make_surface(mesh).operator, FILTERS[kind]))
    np.testing.assert_allclose(np.vstack(rows), expected[[3, 90, 5]], atol=1e-6 * expected.max())


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
    with pytest.raises(InputError, match="all distances vanish; use") as refused:
        distance(mesh, 0, distance="diffusion", time=1.02 * longest)
    advised = float(re.search(r"use (\S+) or less", str(refused.value))[1])
    assert 0.9 * longest < advised < 1.02 * longest
    distance(mesh, 0, distance="diffusion", time=advised)


def test_the_constant_eigenfunction_tells_no_distance(blob):
    with pytest.raises(InputError, match="n_eigenpairs must be at least 2"):
        distance(blob, 0, distance="biharmonic", n_eigenpairs=1)


@pytest.mark.parametrize(
    ("kind", "spoil", "message"),
    [
        ("biharmonic", lambda solved: solved + 1e-3 * np.roll(solved, 1, axis=0), "two comp"),
        ("commute-time", lambda solved: -solved, "not positive semi-definite"),
    ],
)
def test_a_kernel_that_is_none_is_an_error_with_the_figure(blob, monkeypatch, kind, spoil, message):
    def wrong(*operator, **options):
        right, diagonal = green_and_diagonal(*operator, **options)
        return lambda block: spoil(right(block)), spoil(diagonal)

    monkeypatch.setattr("unbend.distances._gram.green_and_diagonal", wrong)
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
    # Squares, because the root of a rounding error is large.
    bound = 1e-10 * expected.max() ** 2
    np.testing.assert_allclose(found**2, expected[[0, 50]] ** 2, atol=bound)


@pytest.mark.parametrize("operator", ["cotangent", "robust"])
def test_all_that_a_metric_offers_is_of_one_kernel(blob, kind, operator):
    surface = make_surface(blob, laplacian=operator)
    kernel = dense.kernel(surface.operator, FILTERS[kind])
    metric = make_metric(kind, surface, time=TIME, sources=True)
    block = np.random.default_rng(0).standard_normal((blob.n_vertices, 3))
    np.testing.assert_allclose(
        metric.gram(block), kernel @ block, atol=1e-9 * abs(kernel @ block).max()
    )
    expected = dense.distances(kernel)
    samples = np.arange(3, 642, 8)
    between = expected[np.ix_(samples, samples)]
    np.testing.assert_allclose(metric.between(samples), between, atol=1e-6 * expected.max())
    found = metric.from_sources(samples[:4])
    np.testing.assert_allclose(found, expected[samples[:4]], atol=1e-6 * expected.max())


def test_the_laplacian_is_the_one_asked_for():
    sphere = make_sphere(2)  # made so flat that no two Laplacians agree on its triangles
    mesh = Mesh(sphere.vertices * [1, 0.7, 0.2], sphere.faces)
    for operator in ("cotangent", "robust"):
        surface = make_surface(mesh, laplacian=operator)
        expected = dense.distances(dense.kernel(surface.operator, FILTERS["biharmonic"]))[9]
        found = distance(mesh, 9, distance="biharmonic", laplacian=operator)[0] / np.sqrt(
            surface.area
        )
        np.testing.assert_allclose(found, expected, atol=1e-6 * expected.max())
    assert (
        abs(found - distance(mesh, 9, distance="biharmonic")[0] / np.sqrt(surface.area)).max()
        > 1e-3 * found.max()
    )


def test_distances_are_those_of_the_component_chosen(blob, blob_and_ball):
    with pytest.warns(UnbendWarning, match="component 1 of 2"):
        found = distance(blob_and_ball, blob.n_vertices, component=1)[0]
    assert np.isnan(found[: blob.n_vertices]).all()
    np.testing.assert_allclose(found[blob.n_vertices :], distance(make_sphere(2), 0)[0], atol=1e-9)


def test_a_kernel_that_does_not_fit_into_memory_is_refused(blob, monkeypatch):
    monkeypatch.setattr("unbend._memory.available_memory", lambda: 2**10)
    with pytest.raises(MeshError, match="blob: 642 vertices need about"):
        distance(Mesh(blob.vertices, blob.faces, name="blob"), 0, distance="biharmonic")


def test_a_factorisation_that_fails_names_the_mesh_once(blob, monkeypatch):
    def fails(*operator, **options):
        raise SolverError("no pivot")

    monkeypatch.setattr("unbend.distances._gram.green_and_diagonal", fails)
    with pytest.raises(SolverError, match=r"^mesh: no pivot; if its faces are [^;]*$"):
        distance(blob, 0, distance="biharmonic")


def test_unknown_kinds_and_times_without_end_are_refused(blob):
    with pytest.raises(InputError, match="distance must be one of biharmonic, commute-time"):
        distance(blob, 0, distance="euclidean")
    for time in (np.inf, np.nan, 0, -1, "long"):
        with pytest.raises(InputError, match="time must be positive, not"):
            distance(blob, 0, distance="diffusion", time=time)
        with pytest.raises(InputError, match="time must be positive, not"):
            distance(blob, 0, distance="diffusion", time=time, n_eigenpairs=9)


@pytest.mark.parametrize("time", [0.1, 0.02, 0.004])
def test_eigenpairs_that_a_diffusion_time_leaves_out_are_below_rounding(blob, time):
    values = _gram._diffusion_spectrum(make_surface(blob), time).eigenvalues
    assert len(values) == 642 or np.exp(-2 * time * (values[-1] - values[1])) <= 1e-16


def strip():
    """As long as 80 squares in a row, at unit area."""
    x, y = np.meshgrid(np.arange(81.0), [0, 1], indexing="ij")
    corner = 2 * np.arange(80)[:, None]
    faces = np.vstack([corner + np.array([0, 2, 3]), corner + np.array([0, 3, 1])])
    return Mesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1) / np.sqrt(80), faces)


@pytest.mark.parametrize("mesh", [make_sphere(2), strip()])
@pytest.mark.parametrize("time", [5e-324, 1e-6, 0.1, 0.3])
def test_the_diffusion_time_advised_is_not_too_short(mesh, time, monkeypatch):
    """Where the first eigenpairs do not suffice, as on what is long, as many as may be do."""
    monkeypatch.setattr(_gram, "_MOST_EIGENPAIRS", 24)
    advised, found = time, None
    while found is None:
        try:
            found = distance(mesh, 0, distance="diffusion", time=advised)[0]
        except InputError as refused:
            told = re.search(r"needs over 24 eigenpairs; use (\S+) of the area", str(refused))
            before, advised = advised, float(told[1])
            assert before < advised < 0.5
    if advised > time:
        with pytest.raises(InputError, match="needs over 24 eigenpairs"):
            distance(mesh, 0, distance="diffusion", time=0.8 * advised)
    surface = make_surface(mesh)
    kernel = dense.kernel(surface.operator, lambda values: np.exp(-2 * advised * values))
    expected = dense.distances(kernel)[0] / np.sqrt(surface.area)
    np.testing.assert_allclose(found, expected, atol=1e-10 * expected.max())


def test_one_vertex_where_two_ways_to_a_kernel_differ_is_enough(blob, monkeypatch):
    """By a thousandth, on another column than the first; with the figure."""
    surface = make_surface(blob)
    kernel = dense.kernel(surface.operator, FILTERS["biharmonic"]).diagonal()

    def wrong(*operator, **options):
        right, diagonal = green_and_diagonal(*operator, **options)
        return lambda block: right(block) * (1 + 1e-3 * (block[9] == 1)), diagonal

    monkeypatch.setattr("unbend.distances._gram.green_and_diagonal", wrong)
    figure = f"{1e-3 * kernel[9] / kernel.max():.1e}"
    with pytest.raises(SolverError, match=f"differ by {figure} of its largest"):
        distance(blob, [0, 9], distance="biharmonic")
    monkeypatch.undo()
    assert distance(blob, [0, 9], distance="biharmonic")[1, 9] == 0


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_what_rounding_leaves_of_a_squared_distance_is_a_share_of_the_kernel(unit):
    diagonal = np.array([1.0, 100.0]) * unit

    def apart(more):  # than what makes both points one
        kernel = np.diag(diagonal) + np.array([[0, 50.5 + more], [50.5 + more, 0]]) * unit
        return _gram._distances(kernel, diagonal, diagonal)

    np.testing.assert_array_equal(apart(2e-7), 0)
    np.testing.assert_allclose(apart(-2)[0, 1], 2 * np.sqrt(unit))
    with pytest.raises(SolverError, match=r"came out at -2.0e-05 of the kernel's largest"):
        apart(1e-3)
