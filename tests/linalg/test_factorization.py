"""Sparse solves and inertia against dense linear algebra, with every backend."""

import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import unbend
from tests.linalg.problems import icosphere, laplacian, square
from unbend.errors import SolverError
from unbend.linalg import factorization, multifrontal
from unbend.linalg.factorization import factorize

BACKENDS = ["multifrontal", "qdldl+numba", "qdldl"]


@pytest.fixture(params=BACKENDS)
def backend(request, monkeypatch):
    choose(request.param, monkeypatch.setattr)
    return request.param


def choose(name, set_to):
    """Let this backend do the work, whatever the size of the matrix."""
    set_to(factorization, "_NUMBA_PAYS", 10**9 if name == "qdldl" else 0)
    set_to(factorization, "_DENSE_BLOCKS_PAY", 0 if name == "multifrontal" else 10**9)


def grid(shift):
    stiffness, areas = laplacian(*square(12))
    return sp.csc_array(stiffness + shift * sp.diags_array(areas))


@pytest.mark.parametrize("count", [1, 2, 8, 9, 16, 17, 40])
def test_every_backend_solves(backend, count):
    matrix = grid(1.0)
    factor = factorize(matrix)
    rhs = np.random.default_rng(0).standard_normal((144, count))
    assert factor.backend == backend
    assert factor.n_negative == 0
    np.testing.assert_allclose(matrix @ factor.solve(rhs), rhs, rtol=0, atol=1e-11)
    assert factor.solve(rhs[:, 0]).shape == (144,)
    np.testing.assert_allclose(factor.solve(rhs[:, 0]), factor.solve(rhs)[:, 0], rtol=1e-9)
    assert factor.solve(np.asfortranarray(rhs)).shape == rhs.shape
    whole = np.arange(144)
    np.testing.assert_array_equal(factor.solve(whole), factor.solve(whole.astype(float)))


def test_matrices_of_any_kind_are_taken(backend):
    """Compressed by rows or not at all, and of whole numbers."""
    dense = np.array([[4, 1, 0], [1, 3, -1], [0, -1, 5]])
    for matrix in (sp.csr_array(dense), sp.coo_array(dense), sp.csc_matrix(dense)):
        found = factorize(matrix).solve(np.array([6.0, 4.0, 13.0]))
        np.testing.assert_allclose(found, [1, 2, 3], rtol=1e-12)


@pytest.mark.parametrize("shift", [-30.0, -300.0, -3000.0])
def test_every_backend_counts(backend, shift):
    matrix = grid(shift)
    factor = factorize(matrix)
    assert factor.n_negative == (np.linalg.eigvalsh(matrix.toarray()) < 0).sum()
    assert factor.backend == backend


def test_every_backend_refuses_singular_matrices(backend):
    for matrix in (grid(0.0), sp.csc_array((3, 3)), sp.csc_array(np.ones((3, 3)))):
        with pytest.raises(SolverError, match="singular"):
            factorize(matrix)


@settings(max_examples=100, deadline=None)
@given(
    n=st.integers(1, 60),
    density=st.floats(0.0, 0.3),
    seed=st.integers(0, 10**6),
    definite=st.booleans(),
    name=st.sampled_from(BACKENDS),
    unit=st.integers(-100, 100),
)
def test_random_matrices_against_dense(n, density, seed, definite, name, unit):
    """Solve and count right, or refuse; and refuse only what is ill-conditioned."""
    rng = np.random.default_rng(seed)
    half = sp.random_array((n, n), density=density, rng=rng, data_sampler=rng.standard_normal)
    matrix = (half @ half.T + 0.1 * sp.eye_array(n)) if definite else half + half.T
    dense = matrix.toarray()
    eigenvalues = np.linalg.eigvalsh(dense)
    smallest, largest = np.sort(np.abs(eigenvalues))[[0, -1]]
    exact = rng.standard_normal((n, 3))
    with pytest.MonkeyPatch.context() as patch:
        choose(name, patch.setattr)
        try:
            factor = factorize(sp.csc_array(matrix * 10.0**unit))
        except SolverError:
            # Without pivoting, an indefinite matrix is refused a little earlier.
            assert smallest < (1e-5 if definite else 1e-3) * largest or largest == 0
            return
    assert factor.n_negative == (eigenvalues < 0).sum()
    np.testing.assert_allclose(
        factor.solve(dense @ exact * 10.0**unit), exact, atol=1e-13 * largest / smallest + 1e-13
    )


@pytest.mark.parametrize("kind", [RuntimeError, ValueError, OSError])
def test_a_failure_of_the_compiler_is_not_called_a_singular_matrix(kind, monkeypatch):
    def fail(matrix):
        raise kind("the compiler failed")

    monkeypatch.setattr(factorization, "_DENSE_BLOCKS_PAY", 0)
    monkeypatch.setattr(multifrontal, "factor", fail)
    with pytest.raises(kind, match="the compiler failed"):
        factorize(grid(1.0))


def test_zero_pivots_are_refined_away(backend):
    """Nothing on the diagonal to pivot on, and yet far from singular."""
    factor = factorize(sp.csc_array(np.array([[0.0, 1.0], [1.0, 0.0]])))
    np.testing.assert_allclose(factor.solve(np.array([3.0, 4.0])), [4.0, 3.0], rtol=1e-12)
    assert factor.n_negative == 1


@pytest.mark.parametrize(
    ("n", "options", "expected"),
    [
        (100, {}, "qdldl"),
        (100, {"many": True}, "qdldl+numba"),
        (50_000, {}, "qdldl+numba"),
        (300_000, {}, "multifrontal"),
        (300_000, {"many": True}, "multifrontal"),
        (100, {"diagonal": True}, "multifrontal"),
        (300_000, {"diagonal": True}, "multifrontal"),
    ],
)
def test_larger_systems_have_other_engines(n, options, expected):
    assert factorize(sp.eye_array(n), **options).backend == expected


@pytest.mark.parametrize("many", [False, True])
def test_the_engine_named_does_the_work(many, monkeypatch):
    """Small systems are solved without what is compiled, unless there is much to solve."""
    chunks = []
    solve = factorization.in_chunks

    def spy(*arguments):
        chunks.append(arguments)
        return solve(*arguments)

    monkeypatch.setattr(factorization, "in_chunks", spy)
    factor = factorize(grid(1.0), many=many)
    assert factor.backend == ("qdldl+numba" if many else "qdldl")
    factor.solve(np.ones((144, 2)))
    assert bool(chunks) == many


def test_a_pivot_of_next_to_nothing_is_cancelled():
    """Against the entry that stood there at first, wherever the order has put it."""
    matrix = sp.diags_array([1.0, 1e-20, 1e6]).tocsc()
    order = np.array([2, 0, 1])
    assert not factorization._cancelled(matrix, order, np.array([-1e6, 1.0, 1e-20]))
    assert not factorization._cancelled(matrix, order, np.array([1e-6, 1.0, 1e-20]))
    assert factorization._cancelled(matrix, order, np.array([1e-9, 1.0, 1e-20]))
    assert factorization._cancelled(matrix, order, np.array([1e6, -1e-15, 1e-20]))
    assert factorization._cancelled(matrix, order, np.array([1e6, 1.0, 1e-35]))


def test_a_trial_measures_what_solves_leave():
    matrix = sp.diags_array(np.full(50, 3.0)).tocsc()
    share, residual = factorization._probe(matrix, lambda rhs: 0.99 * rhs / 3)
    np.testing.assert_allclose(share, 0.01)
    assert 0.03 < residual < 3 * 0.07  # of the largest of fifty normal numbers
    assert factorization._probe(matrix, lambda rhs: rhs / 3)[0] < 1
    for bad in (np.inf, np.nan):
        assert not factorization._probe(matrix, lambda rhs, bad=bad: bad * rhs)[0] <= 1


def test_a_matrix_that_is_not_symmetric_is_refused():
    with pytest.raises(SolverError, match="not symmetric"):
        factorize(sp.csc_array(np.array([[2.0, 1.0], [0.0, 3.0]])))


def test_bad_input(backend):
    with pytest.raises(SolverError, match="singular"):
        factorize(sp.csc_array(np.full((2, 2), np.nan)))
    factor = factorize(sp.csc_array(np.eye(3) * 1e-300))
    for rhs in ([1.0, np.nan, 0.0], [1.0, np.inf, 0.0], [1e300, -1e300, 0.0]):
        with pytest.raises(SolverError, match="overflows"):
            factor.solve(np.array(rhs))
    assert factor.solve(np.ones((3, 0))).shape == (3, 0)
    large = np.full(3, 1e308)  # finite, though the sum is not
    np.testing.assert_allclose(factorize(sp.csc_array(np.eye(3))).solve(large), large)


@pytest.mark.parametrize("name", ["multifrontal", "qdldl+numba"])
def test_solves_in_several_threads_at_once(name, monkeypatch):
    monkeypatch.setattr(factorization, "_DENSE_BLOCKS_PAY", 0 if name == "multifrontal" else 10**9)
    stiffness, areas = laplacian(*icosphere(4))
    factor = factorize(stiffness + sp.diags_array(areas))
    assert factor.backend == name
    rhs = np.random.default_rng(0).standard_normal((len(areas), 50))
    expected = factor.solve(rhs)
    with ThreadPoolExecutor(4) as pool:
        for solution in pool.map(factor.solve, [rhs] * 8):
            assert np.array_equal(solution, expected)


def run_python(code, **environment):
    env = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA")}
    command = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(
        command, env=env | environment, capture_output=True, text=True, check=False
    )


def test_importing_does_not_import_numba():
    code = "import sys, unbend.linalg.lanczos; assert 'numba' not in sys.modules"
    assert run_python(code).returncode == 0


SOLVE = """
import numpy as np, scipy.sparse as sp
from unbend.linalg.factorization import factorize
factor = factorize(sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(3000, 3000)))
assert factor.backend == "qdldl+numba"
assert np.isfinite(factor.solve(np.ones(3000))).all()
"""


@pytest.mark.parametrize("cache", ["unset", "a file"])
def test_no_folder_for_compiled_code(cache, tmp_path):
    """Read-only installation, no home, and a cache folder that cannot be one."""
    package = tmp_path / "site" / "unbend"
    source = Path(unbend.__file__).parent
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "linalg" / "__pycache__").touch()  # a file in its place stops even root
    blocked = tmp_path / "blocked"
    blocked.touch()
    environment = {"HOME": str(blocked), "XDG_CACHE_HOME": str(blocked)}
    if cache == "a file":
        environment["NUMBA_CACHE_DIR"] = str(blocked)
    result = run_python(SOLVE, PYTHONPATH=str(package.parent), **environment)
    assert result.returncode == 0, result.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_forked_processes_solve():
    code = (
        SOLVE
        + """
import os
rhs = np.ones((3000, 64))
factor.solve(rhs)
child = os.fork()
if child == 0:
    factor.solve(rhs)
    os._exit(0)
assert os.waitpid(child, 0)[1] == 0
"""
    )
    result = run_python(code, OMP_NUM_THREADS="2")
    assert result.returncode == 0, result.stderr
