"""Eigenpairs against dense solvers: all of them, right, and none missed."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.linalg.problems import copies, icosphere, laplacian, scattered, square
from unbend.errors import InputError, SolverError
from unbend.linalg import _inverse, lanczos
from unbend.linalg._krylov import KrylovBasis
from unbend.linalg.lanczos import largest_eigenpairs, smallest_eigenpairs


def check(stiffness, areas, k, tol=1e-8, **options):
    """Compare with LAPACK, and check the residuals and the orthonormality promised."""
    values, vectors = smallest_eigenpairs(stiffness, areas, k, tol=tol, **options)
    expected = scipy.linalg.eigh(stiffness.toarray(), np.diag(areas), eigvals_only=True)
    # Values that are zero but for rounding count like the mean distance between the first k.
    scale = max(expected[k - 1] / k, 1e-13 * expected[-1] / tol)
    assert values.shape == (k,)
    assert vectors.shape == (len(areas), k)
    assert np.abs(values - expected[:k]).max() <= max(1e-9, tol**2) * max(expected[k - 1], scale)
    assert values.min() >= 0
    assert (np.diff(values) >= 0).all()
    assert np.abs(vectors.T @ (areas[:, None] * vectors) - np.eye(k)).max() < 1e-10
    residuals = (stiffness @ vectors - areas[:, None] * vectors * values) / areas[:, None] ** 0.5
    assert (np.linalg.norm(residuals, axis=0) <= 1.1 * tol * np.maximum(values, scale)).all()
    return values, vectors


@pytest.fixture
def iterative(monkeypatch):
    """Send small problems to the iteration too."""
    monkeypatch.setattr(lanczos, "_dense_is_faster", lambda n, k: n <= k + 1)


@settings(max_examples=50, deadline=None)
@given(
    n=st.integers(12, 150),
    seed=st.integers(0, 10**6),
    share=st.floats(0.0, 0.5),
    pieces=st.integers(1, 3),
)
def test_open_surfaces_against_dense(n, seed, share, pieces):
    stiffness, areas = copies(laplacian(*scattered(n, seed)), pieces)
    k = max(1, int(share * len(areas)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lanczos, "_dense_is_faster", lambda n, k: n <= k + 1)
        check(stiffness, areas, k)


@settings(max_examples=50, deadline=None)
@given(
    n=st.integers(5, 150),
    degree=st.integers(1, 4),
    seed=st.integers(0, 10**6),
    unit=st.floats(-8, 8),
    share=st.floats(0.0, 0.4),
)
def test_graph_laplacians_against_dense(n, degree, seed, unit, share):
    """Nothing like a surface: random graphs, often in many pieces, in any unit."""
    rng = np.random.default_rng(seed)
    ends = rng.integers(0, n, (2, degree * n // 2 + 1))
    weights = 10.0**unit * rng.random(ends.shape[1])
    graph = sp.coo_array((weights, ends), (n, n)).toarray()
    graph = np.triu(graph + graph.T, 1)
    graph = graph + graph.T
    stiffness = sp.csc_array(np.diag(graph.sum(axis=0)) - graph)
    areas = 10.0 ** (-unit) * (0.1 + rng.random(n))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lanczos, "_dense_is_faster", lambda n, k: n <= k + 1)
        check(stiffness, areas, max(1, int(share * n)))


@pytest.mark.parametrize("k", [1, 10, 50, 100])
def test_icosphere_multiplicities(k):
    check(*laplacian(*icosphere(3)), k)


@pytest.mark.parametrize(("k", "pieces"), [(5, 12), (60, 12), (100, 3)])
def test_more_copies_than_the_block_is_wide(k, pieces, iterative):
    """Twelve equal components: every eigenvalue twelve-fold, blocks of four or eight."""
    check(*copies(laplacian(*scattered(90, 3)), pieces), k)


def test_open_square():
    check(*laplacian(*square(25)), 80)


@pytest.mark.parametrize("k", [1, 2, 41, 42])
def test_icosahedron_all_the_way(k):
    check(*laplacian(*icosphere(1)), k)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_scale_free(unit):
    vertices, faces = scattered(700, 1)
    values, vectors = smallest_eigenpairs(*laplacian(vertices, faces), 20)
    scaled_values, scaled_vectors = smallest_eigenpairs(*laplacian(unit * vertices, faces), 20)
    np.testing.assert_allclose(scaled_values[1:] * unit**2, values[1:], rtol=1e-9)
    cosines = (laplacian(vertices, faces)[1][:, None] * vectors * scaled_vectors * unit).sum(axis=0)
    np.testing.assert_allclose(np.abs(cosines), 1, atol=1e-6)


def test_slivers():
    """Cotangents of 1e5 in some triangles: the products with the matrix are what is rounded."""
    vertices, faces = scattered(450, 5)
    vertices[faces[::20, 0]] = vertices[faces[::20, 1]] + 1e-5 * (
        vertices[faces[::20, 2]] - vertices[faces[::20, 1]]
    )
    stiffness, areas = laplacian(vertices + np.random.default_rng(0).random((450, 3)) * 1e-7, faces)
    values, vectors = smallest_eigenpairs(stiffness, areas, 40)
    expected = scipy.linalg.eigh(
        stiffness.toarray(), np.diag(areas), eigvals_only=True, subset_by_index=(0, 39)
    )
    np.testing.assert_allclose(values, expected, rtol=1e-5, atol=1e-5 * expected[-1])
    np.testing.assert_allclose(
        vectors.T @ (areas[:, None] * vectors), np.eye(40), rtol=0, atol=1e-10
    )


def test_same_input_same_output():
    problem = laplacian(*scattered(800, 2))
    first, second = (smallest_eigenpairs(*problem, 40) for _ in range(2))
    assert np.array_equal(first[0], second[0])
    assert np.array_equal(first[1], second[1])


def test_the_number_of_threads_changes_nothing(monkeypatch):
    problem = laplacian(*icosphere(5))  # 10,242 vertices
    monkeypatch.setattr("unbend._parallel._ROWS", 3_000)
    results = []
    for count in ("1", "3"):
        monkeypatch.setenv("OMP_NUM_THREADS", count)
        results.append(smallest_eigenpairs(*problem, 12))
    assert np.array_equal(results[0][1], results[1][1])


def test_the_basis_grows_as_long_as_it_must(monkeypatch):
    """A hundred times the usual accuracy takes more columns, not another path."""
    sizes = []
    combine = KrylovBasis.combine

    def spy(basis, coordinates):
        sizes.append(basis.done)
        return combine(basis, coordinates)

    monkeypatch.setattr(KrylovBasis, "combine", spy)
    problem = laplacian(*scattered(600, 4))
    check(*problem, 40, tol=1e-3)
    check(*problem, 40, tol=1e-9)
    assert sizes[-1] > sizes[0] + 16


def test_pairs_are_counted_until_none_is_missed(monkeypatch):
    answers = []

    def none_missed(matrix, values, residuals, k):
        answers.append(len(answers) == 1)
        return answers[-1]

    monkeypatch.setattr(_inverse, "_none_missed", none_missed)
    check(*laplacian(*scattered(600, 4)), 40)
    assert answers == [False, True]


def test_a_missed_pair_is_noticed():
    stiffness, areas = laplacian(*scattered(300, 6))
    weights = sp.diags_array(areas**-0.5)
    matrix = weights @ stiffness @ weights
    values = scipy.linalg.eigh(matrix.toarray(), eigvals_only=True)[:60]
    assert _inverse._none_missed(matrix, values, np.zeros(60), 40)
    assert not _inverse._none_missed(matrix, np.delete(values, 33), np.zeros(59), 40)
    blurred = np.full(60, np.ptp(values))
    assert not _inverse._none_missed(matrix, values, blurred, 40)  # no gap to count below


def test_unreachable_accuracy_is_an_error(monkeypatch):
    monkeypatch.setattr(_inverse, "_POLISHINGS", 1)
    monkeypatch.setattr(_inverse, "_PATIENCE", 2)
    with pytest.raises(SolverError, match="relative residual"):
        smallest_eigenpairs(*laplacian(*scattered(700, 0)), 20, tol=0.0)


def test_no_tolerance_at_all_means_rounding():
    stiffness, areas = laplacian(*scattered(700, 0))
    values, vectors = smallest_eigenpairs(stiffness, areas, 20, tol=0.0)
    residuals = np.linalg.norm(stiffness @ vectors - areas[:, None] * vectors * values, axis=0)
    assert residuals.max() < 1e-13 * np.linalg.norm(abs(stiffness) @ abs(vectors), axis=0).max()


def test_progress_ends_at_one():
    seen = []
    smallest_eigenpairs(*laplacian(*scattered(900, 0)), 10, progress=seen.append)
    assert seen == sorted(seen)
    assert len(seen) > 3
    assert seen[-1] == 1.0


@pytest.mark.parametrize("k", [0, 43])
def test_k_out_of_range(k):
    with pytest.raises(InputError, match="k must be"):
        smallest_eigenpairs(*laplacian(*icosphere(1)), k)
    with pytest.raises(InputError, match="k must be"):
        largest_eigenpairs(lambda x: x, 42, k)


def test_bad_arguments():
    stiffness, areas = laplacian(*icosphere(1))
    with pytest.raises(InputError, match="positive"):
        smallest_eigenpairs(stiffness, -areas, 3)
    with pytest.raises(InputError, match="agree"):
        smallest_eigenpairs(stiffness, areas[1:], 3)
    with pytest.raises(InputError, match="NaN"):
        smallest_eigenpairs(stiffness * np.nan, areas, 3)
    with pytest.raises(InputError, match="block_size"):
        largest_eigenpairs(lambda x: x, 42, 2, block_size=0)


@settings(max_examples=50, deadline=None)
@given(
    n=st.integers(1, 200),
    k=st.integers(1, 8),
    seed=st.integers(0, 10**6),
    block_size=st.none() | st.integers(3, 12),
    power=st.floats(0.3, 3.0),
)
def test_largest_against_dense(n, k, seed, block_size, power):
    k = min(k, n)
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.standard_normal((n, n)))[0]
    spectrum = rng.choice([-0.5, 1, 1, 1], n) * np.ceil(np.arange(1, n + 1) / 3) ** -power
    matrix = (basis * spectrum) @ basis.T
    values, vectors = largest_eigenpairs(lambda x: matrix @ x, n, k, block_size=block_size)
    np.testing.assert_allclose(values, np.sort(spectrum)[::-1][:k], rtol=0, atol=1e-9)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(k), rtol=0, atol=1e-10)
    assert np.linalg.norm(matrix @ vectors - vectors * values, axis=0).max() <= 2e-10


def test_largest_stops_early():
    weights = 1.0 / np.arange(1, 20_001)[:, None] ** 2
    products = []

    def operator(x):
        products.append(x.shape[1])
        return weights * x

    values, _ = largest_eigenpairs(operator, 20_000, 3, block_size=1)
    np.testing.assert_allclose(values, weights[:3, 0], rtol=1e-12)
    assert sum(products) <= 30


def test_largest_of_the_zero_operator_and_of_low_rank():
    assert largest_eigenpairs(np.zeros_like, 50, 3)[0].tolist() == [0, 0, 0]
    one = np.full((600, 1), 600**-0.5)
    values, vectors = largest_eigenpairs(lambda x: one @ (one.T @ x), 600, 4)
    np.testing.assert_allclose(values, [1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(4), atol=1e-12)


def test_largest_refuses_what_it_cannot_do(monkeypatch):
    with pytest.raises(SolverError, match="NaN"):
        largest_eigenpairs(lambda x: x * np.nan, 50, 3)
    with pytest.raises(SolverError, match="not symmetric"):
        largest_eigenpairs(lambda x: np.cumsum(x, axis=0), 50, 3)
    monkeypatch.setattr(lanczos, "_LIMIT", 20)
    flat = 1 + 1e-3 * np.random.default_rng(0).random((5_000, 1))
    with pytest.raises(SolverError, match="products"):
        largest_eigenpairs(lambda x: flat * x, 5_000, 3)


def test_a_shift_is_moved_away_from_an_eigenvalue() -> None:
    """An eigenvalue at the first guess of the shift, but for a hair, costs no accuracy."""
    k, n = 40, 3000
    guess = 4 * np.pi * 0.5 * k  # Weyl's law at unit area, half of the pairs
    values = 4 * np.pi * np.arange(n, dtype=float)
    values[k // 2] = guess * (1 + 1e-9)
    values = np.sort(values)
    matrix = sp.diags_array(values).tocsc()
    shift, factor = _inverse._first_shift(matrix, k)
    assert abs(values - shift).min() > 0.01 * 4 * np.pi
    assert factor.n_negative == (values < shift).sum()
    found, _ = _inverse.inverse_lanczos(matrix, k, 1e-8, 0, None)
    np.testing.assert_allclose(found, values[:k], atol=1e-6)


def test_corrections_go_on_while_they_help(monkeypatch) -> None:
    """What rounding leaves of pairs just beyond the known ones fades by a third each time."""
    k, n = 40, 3000
    values = 4 * np.pi * np.arange(n, dtype=float)
    beyond = int(1.25 * k)  # as the shift lies at k / 2, two thirds stay each time
    rng = np.random.default_rng(0)
    combine = KrylovBasis.combine

    def rounded(basis, coordinates):
        vectors = combine(basis, coordinates)
        vectors[beyond:] += 3e-8 * rng.standard_normal(vectors[beyond:].shape)
        return vectors

    monkeypatch.setattr(KrylovBasis, "combine", rounded)
    found, vectors = _inverse.inverse_lanczos(sp.diags_array(values).tocsc(), k, 1e-8, 0, None)
    np.testing.assert_allclose(found, values[:k], atol=1e-6)
    np.testing.assert_allclose(np.abs(vectors[:k]), np.eye(k), atol=1e-7)
