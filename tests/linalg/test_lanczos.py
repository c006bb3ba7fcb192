"""Eigenpairs against dense solvers: all of them, right, and none missed."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.linalg.problems import copies, icosphere, laplacian, scattered
from unbend.errors import SolverError
from unbend.linalg import lanczos
from unbend.linalg._krylov import KrylovBasis
from unbend.linalg.lanczos import largest_eigenpairs, measure_eigenpairs, smallest_eigenpairs


def check(stiffness, areas, k, tol=1e-8):
    """Compare with LAPACK, and check the residuals and the orthonormality promised."""
    values, vectors = smallest_eigenpairs(stiffness, areas, k, tol=tol)
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
def test_icosphere_multiplicities(k, iterative):
    check(*laplacian(*icosphere(3)), k)


def test_a_seventh_of_all_pairs_is_left_to_lapack(monkeypatch):
    """The iteration needs a basis of nearly the whole space for them."""
    monkeypatch.setattr(lanczos, "_inverse_lanczos", None)
    check(*laplacian(*scattered(420, 2)), 60)


@pytest.mark.parametrize(("k", "pieces"), [(5, 12), (60, 12), (100, 3)])
def test_more_copies_than_the_block_is_wide(k, pieces, iterative):
    """Twelve equal components: every eigenvalue twelve-fold, blocks of four or eight."""
    check(*copies(laplacian(*scattered(90, 3)), pieces), k)


@pytest.mark.parametrize("tol", [1e-3, 1e-9])
def test_as_exact_as_asked(tol):
    check(*laplacian(*scattered(600, 4)), 40, tol=tol)


@pytest.mark.parametrize("k", [4, 60, 160])
def test_hundreds_of_pieces(k):
    values = np.concatenate([np.zeros(150), 50 + np.arange(450.0)])
    found, _ = smallest_eigenpairs(sp.diags_array(values).tocsc(), np.ones(600), k)
    np.testing.assert_allclose(found, values[:k], atol=1e-6)


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


def test_the_number_of_threads_changes_nothing(monkeypatch):
    problem = laplacian(*icosphere(5))  # 10,242 vertices
    monkeypatch.setattr("unbend.linalg.tall._ROWS", 3_000)
    results = []
    for count in ("1", "3"):
        monkeypatch.setenv("OMP_NUM_THREADS", count)
        results.append(smallest_eigenpairs(*problem, 12))
    assert np.array_equal(results[0][1], results[1][1])


def test_pairs_are_counted_until_none_is_missed(monkeypatch):
    answers = []

    def none_missed(matrix, values, residuals, k):
        answers.append(len(answers) == 1)
        return answers[-1]

    monkeypatch.setattr(lanczos, "_none_missed", none_missed)
    check(*laplacian(*scattered(600, 4)), 40)
    assert answers == [False, True]


def test_a_missed_pair_is_noticed():
    stiffness, areas = laplacian(*scattered(300, 6))
    weights = sp.diags_array(areas**-0.5)
    matrix = weights @ stiffness @ weights
    values = scipy.linalg.eigh(matrix.toarray(), eigvals_only=True)[:60]
    assert lanczos._none_missed(matrix, values, np.zeros(60), 40)
    assert not lanczos._none_missed(matrix, np.delete(values, 33), np.zeros(59), 40)
    blurred = np.full(60, np.ptp(values))
    assert not lanczos._none_missed(matrix, values, blurred, 40)  # no gap to count below


def test_a_missed_pair_is_noticed_among_equal_ones(monkeypatch):
    values = np.array([0.0, 1, 2, 3, 3, 3, 3, 4, 6, 10, 11, 12, 14])
    matrix, nothing = sp.diags_array(values).tocsc(), np.zeros(13)
    for k in range(4, 9):
        assert lanczos._none_missed(matrix, values, nothing, k)
    for missed in range(7):
        assert not lanczos._none_missed(matrix, np.delete(values, missed), nothing[1:], 5)
    shifted, refused = lanczos._shifted, []

    def singular_once(*arguments):
        if not refused:
            refused.append(arguments)
            raise SolverError("singular")
        return shifted(*arguments)

    monkeypatch.setattr(lanczos, "_shifted", singular_once)
    assert lanczos._none_missed(matrix, values, nothing, 5)  # counted below another shift


def test_unreachable_accuracy_is_an_error(monkeypatch):
    monkeypatch.setattr(lanczos, "_POLISHINGS", 1)
    monkeypatch.setattr(lanczos, "_PATIENCE", 2)
    with pytest.raises(SolverError, match="relative residual"):
        smallest_eigenpairs(*laplacian(*scattered(700, 0)), 20, tol=0.0)


def test_no_tolerance_at_all_means_rounding():
    stiffness, areas = laplacian(*scattered(700, 0))
    values, vectors = smallest_eigenpairs(stiffness, areas, 20, tol=0.0)
    residuals = np.linalg.norm(stiffness @ vectors - areas[:, None] * vectors * values, axis=0)
    assert residuals.max() < 1e-13 * np.linalg.norm(abs(stiffness) @ abs(vectors), axis=0).max()


def orthonormal(basis):
    """The basis itself, which must be that whatever came back from the operator."""
    columns = basis.combine(np.eye(basis.size))
    np.testing.assert_allclose(columns.T @ columns, np.eye(basis.size), rtol=0, atol=1e-8)
    return columns


@pytest.mark.parametrize("unit", [1e-100, 1.0, 1e100])
@pytest.mark.parametrize(
    "values",
    [
        10.0 ** -np.arange(60),
        np.ones(60),
        np.where(np.arange(60) < 7, 1.0, 0.0),
        np.linspace(-1, 1, 60),
        np.concatenate([[1e10, 1e10], np.linspace(0, 1, 58)]),
    ],
    ids=["steep", "identity", "low rank", "even", "two large"],
)
@pytest.mark.parametrize("block_size", [1, 4, 7])
def test_the_basis_is_orthonormal_and_the_projection_what_it_says(values, block_size, unit):
    """Up to the whole space, with random columns on the way, and room made as it is needed."""
    frame = np.linalg.qr(np.random.default_rng(0).standard_normal((60, 60)))[0]
    matrix = (frame * values * unit) @ frame.T
    basis = KrylovBasis(lambda x: matrix @ x, 60, block_size, np.random.default_rng(1), 5)
    for step in range(60):
        before = basis.size
        basis.grow()
        assert basis.done == before
        ritz, vectors, coupling = basis.ritz()
        columns = orthonormal(basis)
        lengthy = basis.combine(vectors)
        left = columns[:, before:] @ coupling
        scale = np.abs(values).max() * unit
        np.testing.assert_allclose(matrix @ lengthy - lengthy * ritz, left, atol=1e-8 * scale)
        if basis.done == basis.size:
            break
        if step == 2:
            before = basis.size
            basis.add_random(3)
            assert basis.size == before + 3
    assert basis.size == 60
    np.testing.assert_allclose(ritz, np.sort(values) * unit, rtol=0, atol=1e-8 * scale)
    basis.add_random(5)  # there is nothing left to add
    assert basis.size == 60


def test_a_direction_lost_beside_a_longer_one_is_not_taken_for_new():
    """Of what is large and lies in the basis only rounding stays, which has no direction."""
    rng = np.random.default_rng(0)
    blocks = []

    def operator(x):
        if not blocks:
            blocks.append(x.copy())
        first, second = blocks[0].T
        large = 1e8 * first[:, None] * (first @ x)
        small = second[:, None] * (other @ x) + other[:, None] * (second @ x)
        return large + 1e-6 * small

    basis = KrylovBasis(operator, 200, 2, rng)
    other = rng.standard_normal(200)
    start = basis.combine(np.eye(2))
    other -= start @ (start.T @ other)
    other /= np.linalg.norm(other)
    for _ in range(3):
        basis.grow()
        orthonormal(basis)


def test_a_problem_of_size_one():
    assert largest_eigenpairs(lambda x: 3 * x, 1, 1, block_size=8)[0].tolist() == [3]
    basis = KrylovBasis(lambda x: 3 * x, 1, 4, np.random.default_rng(0))
    basis.grow()
    assert basis.ritz()[0].tolist() == [3]
    values, vectors = smallest_eigenpairs(sp.csc_array([[6.0]]), np.array([2.0]), 1)
    np.testing.assert_allclose(values, [3])
    np.testing.assert_allclose(np.abs(vectors), 2**-0.5)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan])
def test_a_single_vertex_without_an_area_is_refused(bad):
    stiffness, areas = laplacian(*icosphere(1))
    with pytest.raises(SolverError, match="a vertex has no area"):
        smallest_eigenpairs(stiffness, np.where(np.arange(42) == 7, bad, areas), 3)


def known_problem(values, unit):
    """Dense stiffness and uneven areas, of about that size, with these eigenvalues; the vectors."""
    rng = np.random.default_rng(0)
    n = len(values)
    root = np.sqrt(unit * rng.uniform(0.5, 2, n))
    frame = np.linalg.qr(rng.standard_normal((n, n)))[0]
    stiffness = root[:, None] * (frame * values) @ frame.T * root
    return sp.csc_array((stiffness + stiffness.T) / 2), root**2, frame / root[:, None]


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_what_eigenpairs_lack_is_measured(unit):
    """Values off by a share have just this residual, whether they are large or small."""
    share = 1e-4
    values = np.concatenate([np.zeros(5), 10.0 ** np.arange(10), np.geomspace(1e12, 1e13, 25)])
    stiffness, areas, vectors = known_problem(values, unit)
    floor = values[14] / 15  # what zeros count as: the mean distance of the first fifteen
    for wrong, count in (
        (np.where(np.arange(15) < 5, share * floor, values[:15]), 5),
        (np.where(np.arange(15) < 5, 0, values[:15] + share * np.maximum(values[:15], floor)), 10),
    ):
        skew, residual = measure_eigenpairs(stiffness, areas, wrong, vectors[:, :15], 1e-8)
        assert 0.2 * share < residual / count**0.5 < 4 * share
        assert skew < 1e-10
    twisted = vectors[:, :15].copy()
    twisted[:, 3] += share * twisted[:, 9]
    skew, _ = measure_eigenpairs(stiffness, areas, values[:15], twisted, 1e-8)
    assert 0.01 * share < skew < 10 * share


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_where_all_values_are_zero_the_matrix_tells_what_counts(unit):
    values = np.concatenate([np.zeros(5), np.linspace(90, 110, 35)])
    stiffness, areas, vectors = known_problem(values, unit)
    usual = np.median(stiffness.diagonal() / areas)
    wrong = np.full(5, 1e-2 * 1e-6 * usual)
    wrong[-1] = 1e-13 * usual
    _, residual = measure_eigenpairs(stiffness, areas, wrong, vectors[:, :5], 1e-8)
    assert 0.2e-2 < residual / 4**0.5 < 4e-2


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_rounding_is_no_residual_and_what_is_more_is_one(unit):
    values = np.concatenate([np.geomspace(1, 100, 10), np.geomspace(1e7, 1e8, 30)])
    stiffness, areas, vectors = known_problem(values, unit)
    _, left = measure_eigenpairs(stiffness, areas, values[:10], vectors[:, :10], np.inf)
    assert left > 0
    _, residual = measure_eigenpairs(stiffness, areas, values[:10], vectors[:, :10], 0.0)
    assert residual == 0
    wrong = values[:10] * (1 + 1e-3)
    _, residual = measure_eigenpairs(stiffness, areas, wrong, vectors[:, :10], 0.0)
    assert 0.2e-3 < residual / 10**0.5 < 4e-3


@settings(max_examples=50, deadline=None)
@given(
    n=st.integers(1, 200),
    k=st.integers(1, 8),
    seed=st.integers(0, 10**6),
    block_size=st.integers(3, 12),
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


@pytest.mark.parametrize("tol", [0.1, 0.03, 0.01, 0.003])
@pytest.mark.parametrize("block_size", [1, 4, 16])
def test_largest_are_as_exact_as_asked_however_slowly_they_come(tol, block_size):
    """Residuals shrink by little in each step here, so the first that will do is not far below."""
    weights = np.linspace(0, 1, 500)[:, None]
    values, vectors = largest_eigenpairs(
        lambda x: weights * x, 500, 1, tol=tol, block_size=block_size
    )
    residual = np.linalg.norm(weights * vectors - vectors * values)
    assert 0.1 * tol < residual <= tol * 1.000001 * values[0]


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
    assert largest_eigenpairs(np.zeros_like, 50, 3, block_size=6)[0].tolist() == [0, 0, 0]
    one = np.full((600, 1), 600**-0.5)
    values, vectors = largest_eigenpairs(lambda x: one @ (one.T @ x), 600, 4, block_size=7)
    np.testing.assert_allclose(values, [1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(4), atol=1e-12)


def test_largest_refuses_what_it_cannot_do(monkeypatch):
    with pytest.raises(SolverError, match="NaN"):
        largest_eigenpairs(lambda x: x * np.nan, 50, 3, block_size=6)
    with pytest.raises(SolverError, match="not symmetric"):
        largest_eigenpairs(lambda x: np.cumsum(x, axis=0), 50, 3, block_size=6)
    monkeypatch.setattr(lanczos, "_LIMIT", 20)
    flat = 1 + 1e-3 * np.random.default_rng(0).random((5_000, 1))
    products = []

    def operator(x):
        products.append(x.shape[1])
        return flat * x

    with pytest.raises(SolverError, match=r"no 3 eigenpairs .* products"):
        largest_eigenpairs(operator, 5_000, 3, block_size=6)
    assert products[0] == 6
    assert 20 + 10 * 3 < sum(products) <= 20 + 10 * 3 + 6  # ten for each pair beyond the limit


def test_a_shift_is_moved_away_from_an_eigenvalue() -> None:
    """An eigenvalue at the first guess of the shift, but for a hair, costs no accuracy."""
    k, n = 40, 3000
    guess = 4 * np.pi * 0.5 * k  # Weyl's law at unit area, half of the pairs
    values = 4 * np.pi * np.arange(n, dtype=float)
    values[k // 2] = guess * (1 + 1e-9)
    values = np.sort(values)
    matrix = sp.diags_array(values).tocsc()
    shift, factor = lanczos._first_shift(matrix, k)
    assert abs(values - shift).min() > 0.01 * 4 * np.pi
    assert factor.n_negative == (values < shift).sum()
    found, _ = lanczos._inverse_lanczos(matrix, k, 1e-8)
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
    found, vectors = lanczos._inverse_lanczos(sp.diags_array(values).tocsc(), k, 1e-8)
    np.testing.assert_allclose(found, values[:k], atol=1e-6)
    np.testing.assert_allclose(np.abs(vectors[:k]), np.eye(k), atol=1e-7)


@pytest.mark.parametrize("below", [0, 2, 7, 20])
def test_pairs_near_a_shift_have_the_residuals_that_are_told(below):
    """From the nearest on outwards: none above is told before all that are counted below."""
    rng = np.random.default_rng(0)
    values = np.sort(np.concatenate([[0.0, 0.0], rng.uniform(1, 60, 58)]))
    values, shift = (values, values[below - 1 : below + 1].mean()) if below else (values + 3, 2.0)
    matrix = sp.diags_array(values).tocsc()
    factor = lanczos._shifted(matrix, shift)
    assert factor.n_negative == below
    basis = KrylovBasis(factor.solve, 60, 3, rng)
    for _ in range(20):
        basis.grow()
        found, coordinates, residuals = lanczos._near_pairs(basis, shift, below)
        assert found.shape == residuals.shape
        assert (np.diff(found) >= 0).all()
        assert found.min(initial=0) >= -1e-4 * shift
        told_below = (found < shift).sum()
        assert told_below <= below
        assert told_below == below or len(found) == told_below
        vectors = basis.combine(coordinates)
        left = np.linalg.norm(values[:, None] * vectors - vectors * found, axis=0)
        np.testing.assert_allclose(left, residuals, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(found, values, atol=1e-6)


@pytest.mark.parametrize("copies", [1, 4])
def test_the_distance_to_the_nearest_eigenvalue_is_estimated(copies):
    far = np.linspace(1, 9, 50) * np.where(np.arange(50) % 2, 1, -1)
    near = sp.diags_array(np.concatenate([np.full(copies, -1e-2), far])).tocsc()
    distance = lanczos._nearest(50 + copies, lanczos._shifted(near, 0.0))
    np.testing.assert_allclose(distance, 1e-2, rtol=1e-3)


@pytest.mark.parametrize("noise", [1e-5, 1e-7])
def test_corrections_make_orthonormal_pairs_and_measure_them(noise):
    """Each leaves of what is beyond the known pairs the share (9 - 5) / (20 - 5) at most."""
    rng = np.random.default_rng(0)
    values = np.concatenate([[0.0], np.linspace(1, 10, 20), np.linspace(20, 1e4, 179)])
    matrix = sp.diags_array(values).tocsc()
    factor = lanczos._shifted(matrix, 5.1)
    rough = np.eye(200, 21) + noise * rng.standard_normal((200, 21))
    last = 1e4 * noise
    for steps in (1, 2, 4, 30):
        found, vectors, reached = lanczos._polish(
            matrix, factor, values[:21] + noise, rough.copy(), 10, 0.1, 1e-9, steps
        )
        np.testing.assert_allclose(vectors.T @ vectors, np.eye(10), atol=1e-12)
        left = np.linalg.norm(values[:, None] * vectors - vectors * found, axis=0)
        worst = (left / np.maximum(found, 0.1)).max()
        np.testing.assert_allclose(reached, worst, atol=1e-10)
        assert worst < 0.5 * last
        last = worst
    assert worst <= 1.1e-9
    np.testing.assert_allclose(found, values[:10], atol=1e-9)


def test_a_shift_that_cannot_be_factorised_is_passed_over(monkeypatch):
    matrix = sp.diags_array(np.array([0.0, 50.0, 100.001, 150.0])).tocsc()
    factor = lanczos._shifted(matrix, 100.0)
    tried = []

    def refuse(matrix, shift):
        tried.append(shift)
        if len(tried) == 1:
            raise SolverError("singular")
        return shifted(matrix, shift)

    shifted = lanczos._shifted
    monkeypatch.setattr(lanczos, "_shifted", refuse)
    moved, _ = lanczos._clear_of_eigenvalues(matrix, 100.0, factor)
    assert moved == tried[1] != 100
    monkeypatch.setattr(lanczos, "_shifted", lambda *_: refuse(tried.clear(), 0.0))
    with pytest.raises(SolverError, match="shifted stiffness matrix could not be factorised"):
        lanczos._first_shift(matrix, 2)
