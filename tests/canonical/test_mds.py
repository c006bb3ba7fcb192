import numpy as np
import pytest

import dense
from forms import form_of
from unbend import canonical_form, laplacian, sampled_canonical_form
from unbend.canonical import sampled_scaling
from unbend.canonical._mds import area_scaling, exact_scaling
from unbend.datasets import make_quadruped, make_sphere
from unbend.spectral import Spectrum

FILTERS = {
    "biharmonic": lambda values: values**-2,
    "commute-time": lambda values: values**-1,
    "diffusion": lambda values: np.exp(-2 * 0.1 * values),
}


def unit(mesh):
    operator = laplacian(mesh)
    return type(operator)(operator.stiffness, operator.areas / operator.areas.sum(), operator.kind)


def spectrum_of(frame):
    """Functions on vertices of equal areas, whatever their eigenvalues."""
    n, k = frame.shape
    return Spectrum(np.zeros(k), frame, np.full(n, 1 / n), "cotangent")


@pytest.mark.parametrize("distance", FILTERS)
def test_exact_form_is_dense_classical_scaling_of_all_distances(blob, distance):
    gram = dense.kernel(unit(blob), FILTERS[distance])
    points, values = dense.classical_scaling(dense.distances(gram) ** 2, 3)
    form = canonical_form(blob, distance=distance)
    np.testing.assert_allclose(form.eigenvalues, values, rtol=1e-8)
    assert dense.relative_error(form.points, points) < 1e-6


def test_exact_form_of_an_animal_is_dense_classical_scaling():
    """By a route without eigenpairs: (W + a a^T)^-1 is the Green's operator plus constants."""
    dog = make_quadruped("galloping", n_vertices=800).mesh
    operator = unit(dog)
    inverse = np.linalg.inv(operator.stiffness.toarray() + np.outer(operator.areas, operator.areas))
    gram = inverse @ (operator.areas[:, None] * inverse)
    points, values = dense.classical_scaling(dense.distances(gram) ** 2, 3)
    form = canonical_form(dog)
    np.testing.assert_allclose(form.eigenvalues, values, rtol=1e-8)
    assert dense.relative_error(form.points, points) < 1e-6


@pytest.mark.parametrize("distance", FILTERS)
def test_area_weights_give_the_scaled_eigenfunctions(blob, distance):
    """Weighted scaling by the definition: eigenpairs of A^1/2 J g J^T A^1/2."""
    operator = unit(blob)
    areas = operator.areas
    root = np.sqrt(areas)
    centre = np.eye(len(areas)) - np.outer(np.ones(len(areas)), areas)
    gram = centre @ dense.kernel(operator, FILTERS[distance]) @ centre.T
    values, vectors = np.linalg.eigh(root[:, None] * gram * root)
    points = (vectors[:, ::-1][:, :3] / root[:, None]) * np.sqrt(values[::-1][:3])
    form = canonical_form(blob, distance=distance, weighting="area")
    np.testing.assert_allclose(form.eigenvalues, values[::-1][:3], rtol=1e-8)
    assert dense.relative_error(form.points, points) < 1e-6


@pytest.mark.parametrize("weighting", ["uniform", "area"])
@pytest.mark.parametrize("interpolation", ["projection", "least-squares"])
def test_all_samples_and_all_eigenpairs_leave_nothing_to_approximate(
    blob, weighting, interpolation
):
    # As mu grows the sampled values are met exactly.
    everything = {"n_eigenpairs": blob.n_vertices, "n_samples": blob.n_vertices, "mu": 1e12}
    sampled = sampled_canonical_form(
        blob, weighting=weighting, interpolation=interpolation, **everything
    )
    exact = canonical_form(blob, weighting=weighting)
    np.testing.assert_allclose(sampled.eigenvalues, exact.eigenvalues, rtol=1e-6)
    assert dense.relative_error(sampled.points, exact.points) < 1e-6


def test_the_paper_s_sampling_comes_within_a_thousandth_on_a_cat(real_data):
    mesh = real_data / "tosca_remeshed" / "cat3.off"
    exact = canonical_form(mesh)
    for interpolation in ("projection", "least-squares"):
        sampled = sampled_canonical_form(mesh, interpolation=interpolation)
        assert dense.relative_error(sampled.points, exact.points) < 1e-3


def test_negative_eigenvalues_are_returned_and_their_columns_are_zero():
    """Distances 1 among four points but 3 between one pair: no such points exist."""
    squared = np.ones((4, 4)) - np.eye(4)
    squared[0, 1] = squared[1, 0] = 9.0
    points, values = sampled_scaling(squared, spectrum_of(np.eye(4)), 4, "uniform")
    _, expected = dense.classical_scaling(squared, 4)
    np.testing.assert_allclose(values, expected, atol=1e-12)
    assert values[-1] < -0.1
    assert np.isfinite(points).all()
    np.testing.assert_array_equal(points[:, values < 0], 0)


@pytest.mark.parametrize("n_components", [3, 8])
def test_a_sphere_has_one_form(n_components):
    """Its eigenvalues are multiple: three, then five equal ones."""
    one, other = (
        canonical_form(make_sphere(3), n_components=n_components, random_state=seed)
        for seed in (0, 1)
    )
    np.testing.assert_allclose(other.points, one.points, atol=1e-6)


@pytest.mark.parametrize("weighting", ["uniform", "area"])
def test_third_moments_are_positive(blob, weighting):
    weights = laplacian(blob).areas if weighting == "area" else np.ones(blob.n_vertices)
    points = canonical_form(blob, weighting=weighting).points
    assert (weights @ points**3 > 0).all()


def test_third_moments_are_positive_where_the_farthest_point_is_not():
    sphere, chance = make_sphere(3), np.random.default_rng(7)
    points = sphere.vertices.copy()
    for _ in range(6):
        limb = chance.standard_normal(3)
        limb /= np.linalg.norm(limb)
        near = np.exp(-chance.uniform(4, 40) * (1 - sphere.vertices @ limb))
        points += chance.uniform(0.2, 2.5) * near[:, None] * limb
    form = canonical_form((points, sphere.faces)).points
    farthest = form[np.abs(form).argmax(axis=0), range(3)]
    assert (farthest < -0.05).any()
    assert ((form**3).sum(axis=0) > 0.02 * (np.abs(form) ** 3).sum(axis=0)).all()


@pytest.mark.parametrize("time", [0.05, 0.3])
def test_a_diffusion_time_is_that_of_both_methods(time):
    dog = make_quadruped("galloping", n_vertices=800).mesh
    exact, sampled = (
        form_of(dog, distance="diffusion", time=time, method=method).eigenvalues
        for method in ("exact", "sampled")
    )
    np.testing.assert_allclose(sampled, exact, rtol=0.05)


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_what_is_equal_is_so_in_any_unit(unit):
    chance = np.random.default_rng(0)
    frame = np.linalg.qr(chance.standard_normal((50, 5)))[0]
    turn = np.eye(5)
    turn[1:4, 1:4] = np.linalg.qr(chance.standard_normal((3, 3)))[0]
    values = np.array([0, 1, 1 - 1e-11, 1 - 2e-11, 1e-5]) * unit
    one, other = (area_scaling(values, x, np.ones(50))[0] for x in (frame, frame @ turn))
    np.testing.assert_allclose(other, one, atol=1e-9 * np.sqrt(unit))


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_what_rounding_leaves_of_an_eigenvalue_is_zero_in_any_unit(unit):
    """Of three columns the last stands for nothing; however small, the second does not."""
    frame = np.linalg.qr(np.random.default_rng(0).standard_normal((40, 3)))[0]
    frame -= frame.mean(axis=0)
    frame = np.linalg.qr(frame)[0]
    values = np.array([1.0, 1e-6, 1e-17]) * unit

    def gram(block):
        return (frame * values) @ (frame.T @ block)

    for points, found in (
        exact_scaling(gram, 40, 3, 0),
        sampled_scaling(np.diag(-2 * values), spectrum_of(frame), 3, "uniform"),
    ):
        np.testing.assert_allclose(found[:2], values[:2], rtol=1e-6)
        assert found[2] == 0
        np.testing.assert_array_equal(points[:, 2], 0)
        np.testing.assert_allclose((points**2).sum(axis=0), found, rtol=1e-6)
