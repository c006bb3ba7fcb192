import inspect
import sys

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.utils.estimator_checks import estimator_checks_generator

from unbend import canonical_form, sampled_canonical_form
from unbend.canonical import SpectralMDS
from unbend.datasets import make_sphere
from unbend.errors import InputError

# Checks that fit on a matrix of features: wide, complex, sparse or empty ones are no meshes.
NOT_A_MESH = {
    "check_array_api_input",
    "check_complex_data",
    "check_dtype_object",
    "check_estimator_sparse_array",
    "check_estimator_sparse_matrix",
    "check_estimator_sparse_tag",
    "check_estimators_dtypes",
    "check_estimators_empty_data_messages",
    "check_estimators_fit_returns_self",
    "check_estimators_nan_inf",
    "check_estimators_overwrite_params",
    "check_fit2d_1feature",
    "check_fit2d_1sample",
    "check_fit_check_is_fitted",
    "check_fit_idempotent",
    "check_n_features_in",
    "check_n_features_in_after_fitting",
    "check_positive_only_tag_during_fit",
    "check_readonly_memmap_input",
}


def name_of(check):
    return getattr(check, "func", check).__name__


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "check",
    [
        check
        for _, check in estimator_checks_generator(SpectralMDS(n_components=1))
        if name_of(check) not in NOT_A_MESH
    ],
    ids=name_of,
)
def test_scikit_learn_s_own_checks(check):
    check(SpectralMDS(n_components=1))


@pytest.mark.parametrize("matrix", [np.ones((20, 4)), np.ones((9, 3)) * 1j, np.ones(7)])
def test_a_feature_matrix_is_refused_as_no_mesh(matrix):
    with pytest.raises(InputError):
        SpectralMDS().fit(matrix)


def test_is_the_function_behind_it(blob):
    options = {"n_components": 4, "distance": "commute-time", "weighting": "area"}
    fitted = SpectralMDS(**options).fit(blob)
    form = canonical_form(blob, **options)
    np.testing.assert_array_equal(fitted.embedding_, form.points)
    np.testing.assert_array_equal(fitted.eigenvalues_, form.eigenvalues)
    assert fitted.stress_ == form.stress


def test_takes_all_that_canonical_forms_take(blob):
    ours, exact, sampled = (
        {name: one.default for name, one in inspect.signature(taker).parameters.items()}
        for taker in (SpectralMDS, canonical_form, sampled_canonical_form)
    )
    assert exact.items() <= sampled.items()
    del sampled["mesh"]
    assert ours == sampled | {"method": "exact"}
    options = {"distance": "geodesic", "n_samples": 50, "n_eigenpairs": 40}
    fitted = SpectralMDS(method="sampled", **options).fit(blob)
    form = sampled_canonical_form(blob, **options)
    np.testing.assert_array_equal(fitted.embedding_, form.points)
    with pytest.raises(InputError, match="method must be one of exact, sampled"):
        SpectralMDS(method="quick").fit(blob)
    told = []
    options = {"distance": "diffusion", "time": 0.5}
    SpectralMDS(**options, progress=lambda stage, share: told.append(stage)).fit(make_sphere(2))
    assert "scaling" in told


def test_composes(blob):
    pipeline = make_pipeline(clone(SpectralMDS(n_components=2)))
    assert pipeline.fit_transform(blob).shape == (642, 2)


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.base", None)
    monkeypatch.delitem(sys.modules, "unbend.canonical.estimator", raising=False)
    import unbend

    with pytest.raises(ImportError, match="pip install scikit-learn"):
        unbend.canonical.SpectralMDS()
