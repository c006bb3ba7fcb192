import itertools
import re
from dataclasses import replace

import numpy as np
import pytest

from unbend import farthest_point_sampling, spectrum
from unbend.canonical import distance_coefficients, interpolate
from unbend.canonical._interpolation import _factor, interpolation_operator
from unbend.distances import make_metric
from unbend.errors import InputError, SolverError, UnbendWarning
from unbend.spectral import eigenpairs, make_surface

MU = 1e4


@pytest.fixture(scope="module")
def sampled(blob):
    """A small spectrum at unit area, samples, and squared biharmonic distances among them."""
    surface = make_surface(blob)
    samples = farthest_point_sampling(blob, 40)
    squared = make_metric("biharmonic", surface).between(samples) ** 2
    return eigenpairs(surface, 12), samples, squared


def test_least_squares_agrees_with_a_direct_solve(sampled):
    """Eq. 14 written out as one k^2 x k^2 linear system."""
    spectrum, samples, squared = sampled
    k = len(spectrum.eigenvalues)
    at_samples = spectrum.eigenfunctions[samples]
    gram, smooth, one = at_samples.T @ at_samples, np.diag(spectrum.eigenvalues), np.eye(k)
    system = np.kron(smooth, one) + np.kron(one, smooth) + MU * np.kron(gram, gram)
    target = MU * at_samples.T @ squared @ at_samples
    direct = np.linalg.solve(system, target.ravel()).reshape(k, k)
    found = distance_coefficients(squared, samples, spectrum, mu=MU, interpolation="least-squares")
    np.testing.assert_allclose(found, direct, atol=1e-10 * abs(direct).max())


def test_least_squares_minimises_its_energy(sampled):
    spectrum, samples, squared = sampled
    at_samples = spectrum.eigenfunctions[samples]
    values = spectrum.eigenvalues

    def energy(alpha):
        smooth = (alpha**2 * (values[:, None] + values[None, :])).sum()
        return smooth + MU * ((at_samples @ alpha @ at_samples.T - squared) ** 2).sum()

    best = distance_coefficients(squared, samples, spectrum, mu=MU, interpolation="least-squares")
    chance = np.random.default_rng(0)
    for size in (1e-3, 1e-6):
        for _ in range(10):
            step = chance.standard_normal(best.shape) * abs(best).max() * size
            assert energy(best) < energy(best + step)


def test_projection_interpolates_rows_then_columns(sampled):
    spectrum, samples, squared = sampled
    operator = interpolation_operator(spectrum, samples, MU)
    found = distance_coefficients(squared, samples, spectrum, mu=MU)
    expected = operator @ (operator @ squared).T
    np.testing.assert_allclose(found, expected, atol=1e-10 * abs(expected).max())


def test_operator_minimises_smoothness_plus_misfit(sampled):
    spectrum, samples, squared = sampled
    at_samples, values = spectrum.eigenfunctions[samples], squared[0]
    for mu in (0.5, 10.0):
        best = interpolation_operator(spectrum, samples, mu) @ values
        gradient = spectrum.eigenvalues * best + mu * at_samples.T @ (at_samples @ best - values)
        assert np.linalg.norm(gradient) < 1e-9 * np.linalg.norm(at_samples.T @ values)


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_recovers_a_smooth_function_from_samples_in_any_unit(blob, scale):
    mesh = (blob.vertices * scale, blob.faces)
    samples = farthest_point_sampling(mesh, 60)
    found = spectrum(mesh, 20)
    smooth = found.eigenfunctions @ np.linspace(1, 0, 20)
    recovered = interpolate(smooth[samples], samples, found, mu=1e8)
    assert np.linalg.norm(recovered - smooth) < 1e-4 * np.linalg.norm(smooth)


def test_bad_arguments_are_refused(blob, sampled):
    spectrum, samples, squared = sampled
    for mu in (0, -1, np.inf, np.nan, "large"):
        with pytest.raises(InputError, match="mu must be positive, not"):
            distance_coefficients(squared, samples, spectrum, mu=mu)
    with pytest.raises(InputError, match="projection"):
        distance_coefficients(squared, samples, spectrum, interpolation="linear")


@pytest.mark.parametrize("interpolation", ["projection", "least-squares"])
def test_too_few_samples_are_reported(sampled, interpolation):
    """With fewer samples than eigenpairs and hardly any smoothing nothing fixes the answer."""
    spectrum, samples, squared = sampled
    for count, mu in itertools.product(range(1, 12), (1e18, 1e22, 1e30)):
        few = slice(0, count)
        with pytest.raises(SolverError, match="do not determine"):
            distance_coefficients(
                squared[few, few], samples[few], spectrum, mu=mu, interpolation=interpolation
            )


@pytest.mark.parametrize(
    ("values", "samples", "message"),
    [
        (np.ones(3), [0, 1, -1], "no vertex -1"),
        (np.ones(3), [0, 1, 642], "no vertex 642; vertices are numbered 0 to 641"),
        (np.ones(3), [0.0, 1.0, 2.0], "whole numbers"),
        (np.ones(3), [True, False, True], "whole numbers"),
        (np.ones(3), [[0, 1, 2]], "list of whole numbers"),
        (np.ones(2), [0, 1, 2], "2 values for 3 samples"),
        (1.0, [0, 1, 2], "one row for each"),
        (np.ones((3, 1, 1)), [0, 1, 2], "one row for each"),
        ([1.0, np.nan, 1.0], [0, 1, 2], "value 1 is not finite"),
        ([[1.0, 1], [1, 1], [np.inf, 1]], [0, 1, 2], "value 2 is not finite"),
        (["a", "b", "c"], [0, 1, 2], "needs real numbers"),
    ],
)
def test_samples_and_values_that_cannot_be_used_are_refused(blob, values, samples, message):
    with pytest.raises(InputError, match=message):
        interpolate(values, samples, spectrum(blob, 3))


def test_what_does_not_keep_constants_is_no_interpolation(blob):
    """As with eigenpairs whose constant is missing: the sample that is missed by most counts."""
    found = eigenpairs(make_surface(blob), 12)
    rest = replace(
        found, eigenvalues=found.eigenvalues[1:], eigenfunctions=found.eigenfunctions[:, 1:]
    )
    samples = np.arange(0, 640, 16)
    rows = rest.eigenfunctions[samples]
    system = np.diag(rest.eigenvalues) + MU * rows.T @ rows
    missed = abs(rows @ np.linalg.solve(system, MU * rows.T @ np.ones(40)) - 1).max()
    with pytest.raises(SolverError, match=re.escape(f"misses a constant by {missed:.1e}:")):
        interpolate(np.ones(40), samples, rest)


def test_the_unit_of_length_changes_no_interpolation(blob, sampled):
    _, samples, squared = sampled
    expected = interpolate(squared, samples, spectrum(blob, 12))
    for size in (1e-2, 1e2):
        known = spectrum((blob.vertices * size, blob.faces), 12)
        found = interpolate(squared, samples, known)
        np.testing.assert_allclose(found, expected, atol=1e-8 * abs(expected).max())


def test_samples_weigh_ten_thousand_unless_told_otherwise(blob, sampled):
    known, samples, squared = sampled
    for compute in (
        lambda **options: interpolate(squared, samples, known, **options),
        lambda **options: distance_coefficients(squared, samples, known, **options),
    ):
        np.testing.assert_array_equal(compute(), compute(mu=1e4))
        assert abs(compute() - compute(mu=2e4)).max() > 0


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_what_is_singular_but_for_rounding_is_so_in_any_unit(unit):
    for apart, is_singular in ((1e-14, True), (1e-13, True), (1e-10, False)):
        system = np.array([[1, 1 - apart], [1 - apart, 1]]) * unit
        if is_singular:
            with pytest.raises(SolverError, match="do not determine"):
                _factor(system)
        else:
            upper = np.triu(_factor(system)[0])
            np.testing.assert_allclose(upper.T @ upper, system, rtol=1e-9)


def test_a_sample_off_the_surface_is_refused(blob):
    extended = np.vstack([blob.vertices, [[9.0, 9, 9]]]), blob.faces
    with pytest.warns(UnbendWarning, match="1 unreferenced"):
        known = spectrum(extended, 3)
    with pytest.raises(InputError, match="a sample is a vertex that no face uses"):
        interpolate([1.0, 2, 3, 4], [0, 50, 100, 642], known)
