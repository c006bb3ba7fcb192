"""Products over tall arrays against NumPy's, with rows cut into several tasks."""

import numpy as np
import pytest
import scipy.sparse as sp

from unbend.linalg import tall


@pytest.fixture(autouse=True, params=["1", "3"])
def _few_rows_at_once(request, monkeypatch):
    """Cut 50 rows into tasks of 7, for one thread and for several."""
    monkeypatch.setattr("unbend.linalg.tall._ROWS", 7)
    monkeypatch.setenv("OMP_NUM_THREADS", request.param)


@pytest.fixture
def left():
    return np.random.default_rng(0).standard_normal((50, 4))


@pytest.fixture
def right():
    return np.random.default_rng(1).standard_normal((50, 4))


def test_products(left, right):
    small = np.random.default_rng(2).standard_normal((4, 4))
    np.testing.assert_allclose(tall.inner(left, right[:, :3]), left.T @ right[:, :3], atol=1e-13)
    np.testing.assert_allclose(tall.multiply(left, small[:, :3]), left @ small[:, :3])
    target = right.copy()
    tall.subtract_product(target, left, small)
    np.testing.assert_allclose(target, right - left @ small, atol=1e-13)
    turned = left.copy()
    assert tall.multiply(turned, small, out=turned) is turned
    np.testing.assert_allclose(turned, left @ small)
    np.testing.assert_allclose(tall.column_lengths(left), np.linalg.norm(left, axis=0))


@pytest.mark.parametrize("values", [0.0, np.array([1.0, 0.0, -2.0, 3.0])])
def test_residuals(left, values):
    matrix = sp.random_array((50, 50), density=0.1, rng=np.random.default_rng(3)).tocsr()
    residuals = np.empty((50, 4))
    tall.sparse_residuals(matrix, left, values, residuals)
    np.testing.assert_allclose(residuals, matrix.toarray() @ left - values * left, atol=1e-13)
