import time as clock
from functools import partial

import numpy as np
import pytest
import scipy.spatial.transform
from hypothesis import given, settings
from hypothesis import strategies as st

import dense
from forms import form_of
from unbend import Mesh, canonical_form, distance, sampled_canonical_form
from unbend.canonical import _canonical_form
from unbend.datasets import make_sphere
from unbend.errors import InputError, MeshError, SolverError, UnbendWarning

METHODS = [
    {},
    {"weighting": "area"},
    {"method": "sampled", "n_eigenpairs": 30, "n_samples": 60},
    {"method": "sampled", "distance": "geodesic", "n_eigenpairs": 30, "n_samples": 60},
    {"distance": "commute-time"},
    {"distance": "diffusion"},
]


@pytest.fixture(scope="module", params=METHODS)
def known(blob, request):
    """Options, and the blob's form with them."""
    return request.param, form_of(blob, **request.param)


@settings(max_examples=8)
@given(rotation=st.integers(0, 2**32 - 1), scale=st.floats(1e-3, 1e3))
def test_rigid_motion_and_scale_leave_the_form_alone(blob, known, rotation, scale):
    options, before = known
    turn = scipy.spatial.transform.Rotation.random(rng=rotation).as_matrix()
    moved = Mesh(scale * (blob.vertices @ turn.T + 3), blob.faces)
    after = form_of(moved, **options)
    np.testing.assert_allclose(after.points, before.points, atol=1e-4)
    np.testing.assert_allclose(after.eigenvalues, before.eigenvalues, rtol=1e-4)
    assert after.area == pytest.approx(before.area * scale**2)


def test_permuting_vertices_permutes_the_form(blob, known):
    options, before = known
    order = np.random.default_rng(5).permutation(blob.n_vertices)
    permuted = Mesh(blob.vertices[order], np.argsort(order)[blob.faces])
    after = form_of(permuted, **options)
    np.testing.assert_allclose(after.points, before.points[order], atol=1e-4)


@pytest.mark.parametrize("dimension", [1, 2, 5, np.int8(20)])
def test_a_form_of_any_dimension_extends_the_smaller_ones(blob, dimension):
    form, larger = (canonical_form(blob, n_components=d) for d in (dimension, 21))
    assert form.points.shape == (blob.n_vertices, dimension)
    np.testing.assert_allclose(form.points, larger.points[:, :dimension], atol=1e-7)
    np.testing.assert_allclose((form.points**2).sum(axis=0), form.eigenvalues, rtol=1e-9)
    np.testing.assert_allclose(form.points.mean(axis=0), 0, atol=1e-10)


def test_stress_falls_with_dimension_to_nothing(blob):
    stresses = [canonical_form(blob, n_components=d).stress for d in (1, 3, 20, 300)]
    assert stresses == sorted(stresses, reverse=True)
    assert stresses[-1] < 5e-3


def test_stress_is_its_definition_on_all_pairs(blob):
    form = canonical_form(blob)
    wanted = distance(blob, np.arange(blob.n_vertices), distance="biharmonic") / np.sqrt(form.area)
    reached = np.linalg.norm(form.points[:, None] - form.points[None], axis=2)
    whole = np.sqrt(((wanted - reached) ** 2).sum() / (wanted**2).sum())
    assert form.stress == pytest.approx(whole, rel=0.15)  # 64 of the 642 vertices


@pytest.mark.parametrize(
    ("method", "kind", "power"),
    [
        ("exact", "biharmonic", 1),
        ("sampled", "geodesic", 1),
        ("exact", "commute-time", 0),
        ("exact", "diffusion", -1),
    ],
)
def test_keeping_the_scale_keeps_the_unit_of_the_distance(blob, method, kind, power):
    large = Mesh(blob.vertices * 10, blob.faces)
    unit, kept = (form_of(large, method=method, distance=kind, keep_scale=k) for k in (False, True))
    factor = np.sqrt(unit.area) ** power
    np.testing.assert_allclose(kept.points, unit.points * factor)
    np.testing.assert_allclose((kept.points**2).sum(axis=0), kept.eigenvalues, rtol=1e-2)


def test_sphere_unbends_to_a_sphere():
    sphere = make_sphere(3)
    points = canonical_form(sphere).points
    radii = np.linalg.norm(points, axis=1)
    assert np.ptp(radii) < 0.02 * radii.mean()
    assert dense.relative_error(points / radii[:, None], sphere.vertices) < 0.02


def test_the_stress_of_a_geodesic_form_is_small(blob):
    assert sampled_canonical_form(blob, distance="geodesic").stress < 0.15


def test_wolves_in_three_poses_have_one_form(real_data):
    """Biharmonic forms of one animal agree to 0.999, and better than geodesic ones."""
    wolves = [real_data / "tosca_original" / f"wolf{i}.off" for i in range(3)]
    similarity = {}
    for method, kind in (("exact", "biharmonic"), ("sampled", "geodesic")):
        forms = [form_of(wolf, method=method, distance=kind).points for wolf in wolves]
        forms = [form - form.mean(axis=0) for form in forms]
        similarity[kind] = [
            (dense.aligned(a, b) * b).sum() / np.linalg.norm(a) / np.linalg.norm(b)
            for a, b in ((forms[0], forms[1]), (forms[0], forms[2]), (forms[1], forms[2]))
        ]
    assert min(similarity["biharmonic"]) >= 0.999
    assert (np.array(similarity["biharmonic"]) > similarity["geodesic"]).all()


def split_at_centroids(mesh, chosen):
    """Put a new vertex into the middle of the chosen faces."""
    middles = mesh.vertices[mesh.faces[chosen]].mean(axis=1)
    new = mesh.n_vertices + np.arange(len(middles))
    a, b, c = mesh.faces[chosen].T
    thirds = [np.stack(corners, axis=1) for corners in ((a, b, new), (b, c, new), (c, a, new))]
    return Mesh(np.vstack([mesh.vertices, middles]), np.vstack([mesh.faces[~chosen], *thirds]))


def test_area_weights_do_not_see_how_densely_a_region_is_meshed(blob):
    dense_half = split_at_centroids(blob, blob.vertices[blob.faces].mean(axis=1)[:, 0] > 0.3)
    changes = {}
    for weighting in ("area", "uniform"):
        before = canonical_form(blob, weighting=weighting).points
        after = canonical_form(dense_half, weighting=weighting).points[: blob.n_vertices]
        after = after - after.mean(axis=0) + before.mean(axis=0)
        changes[weighting] = dense.relative_error(after, before)
    assert changes["area"] < 0.03
    assert changes["area"] < changes["uniform"] / 2


def test_unreferenced_vertices_are_nan_rows(blob):
    extended = Mesh(np.vstack([blob.vertices[:5], blob.vertices]), blob.faces + 5)
    with pytest.warns(UnbendWarning, match="5 unreferenced vertices"):
        form = canonical_form(extended)
    assert np.isnan(form.points[:5]).all()
    assert any("5 unreferenced" in note for note in form.notes)


def test_one_component_is_chosen_and_the_rest_is_nan(blob):
    sphere = make_sphere(2)
    both = Mesh(
        np.vstack([sphere.vertices + 9, blob.vertices]),
        np.vstack([sphere.faces, blob.faces + sphere.n_vertices]),
        name="both.off",
    )
    with pytest.raises(MeshError, match=r"both\.off.*642.*162"):
        canonical_form(both)
    with pytest.warns(UnbendWarning):
        largest, second = (canonical_form(both, component=c) for c in ("largest", 1))
    np.testing.assert_allclose(
        largest.points[sphere.n_vertices :], canonical_form(blob).points, atol=1e-9
    )
    assert np.isnan(largest.points[: sphere.n_vertices]).all()
    assert np.isfinite(second.points[: sphere.n_vertices]).all()


def test_degenerate_faces_are_handled_by_the_robust_laplacian(blob):
    (i, j, k), n = blob.faces[0], blob.n_vertices
    middle = blob.vertices[[i, j]].mean(axis=0)
    faces = np.vstack([blob.faces[1:], [[i, n, k], [n, j, k], [i, j, n]]])
    with pytest.warns(UnbendWarning, match="degenerate"):
        form = canonical_form((np.vstack([blob.vertices, [middle]]), faces))
    assert form.laplacian == "robust"
    assert dense.relative_error(form.points[:n], canonical_form(blob).points) < 0.05


def test_faces_that_add_no_surface_change_nothing(blob):
    """Those that name a vertex twice, and those that are given again."""
    faces = np.vstack([[[0, 0, 1]], blob.faces, [[4, 5, 5]], blob.faces[:40, ::-1]])
    with pytest.warns(UnbendWarning, match="left out"):
        form = canonical_form((blob.vertices, faces))
    np.testing.assert_array_equal(form.points, canonical_form(blob).points)


def test_point_cloud_form_is_close_to_the_surface_s(blob):
    form = canonical_form(blob.vertices)
    assert form.laplacian == "robust"
    assert dense.relative_error(form.points, canonical_form(blob).points) < 0.25


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_components": 0}, "dimension must be a whole number from 1 to 641"),
        ({"n_components": 642}, "dimension must be a whole number from 1 to 641"),
        (
            {"method": "sampled", "n_eigenpairs": 5, "n_components": 5},
            "must be a whole number from 1 to 4",
        ),
        ({"distance": "geodesic"}, "no exact form; use sampled_canonical_form$"),
        ({"weighting": "none"}, "weighting must be"),
        ({"distance": "euclid"}, "distance must be one of .* not 'euclid'"),
        ({"interpolation": "x", "method": "sampled"}, "interpolation must be"),
        ({"mu": -1, "method": "sampled"}, "mu must be positive"),
        ({"time": 0.0, "distance": "diffusion"}, "time must be positive"),
        ({"time": 0.1}, "time is for diffusion distances, not biharmonic"),
        (
            {"method": "sampled", "time": 0.1, "distance": "geodesic"},
            "for diffusion distances, not geodesic",
        ),
        ({"n_samples": 0, "method": "sampled"}, "n_samples must be a whole number of at least 2"),
        ({"n_samples": 2.5, "method": "sampled"}, "n_samples must be a whole number"),
        (
            {"n_samples": 3, "method": "sampled"},
            "dimension must be a whole number from 1 to 2, not 3",
        ),
        ({"n_eigenpairs": 1, "method": "sampled"}, "n_eigenpairs must be a whole number of at"),
        ({"random_state": -1}, "random_state must be a whole number of at least 0, not -1"),
        ({"random_state": 1.5}, "random_state must be"),
        ({"time": 1e3, "distance": "diffusion"}, "all distances vanish; use"),
        ({"laplacian": "graph"}, "laplacian must be"),
    ],
)
def test_bad_arguments_are_refused_in_one_sentence(blob, options, message):
    with pytest.raises(InputError, match=message) as error:
        form_of(blob, **options)
    assert "\n" not in str(error.value)


def test_a_form_of_one_point_is_an_error(blob):
    with pytest.raises(SolverError, match="all points of the form coincide"):
        sampled_canonical_form(blob, mu=1e-300)


@pytest.mark.parametrize("options", METHODS)
@pytest.mark.parametrize(
    "spoil",
    [
        lambda points: points * 1.001,
        lambda points: points + 0.01,
        lambda points: points[:, [0] * 3],
    ],
)
def test_a_form_that_is_not_on_its_axes_is_an_error(blob, monkeypatch, options, spoil):
    def spoiled(scale, *arguments):
        points, *rest = scale(*arguments)
        return spoil(points), *rest

    for name in ("_exact", "_sampled"):
        right = getattr(_canonical_form, name)
        monkeypatch.setattr(_canonical_form, name, partial(spoiled, right))
    with pytest.raises(SolverError, match="of the largest eigenvalue"):
        form_of(blob, **options)


@pytest.mark.parametrize("shift", [[1e-5, -1e-5, 0], [0, 0, -1e-5]])
def test_a_form_off_the_middle_is_an_error_with_the_figure(blob, monkeypatch, shift):
    """A shift so small that the columns' lengths and angles do not show it."""
    right = _canonical_form._exact
    largest = canonical_form(blob).eigenvalues[0]

    def shifted(*arguments):
        points, *rest = right(*arguments)
        return points + np.append(shift, 0), *rest

    monkeypatch.setattr(_canonical_form, "_exact", shifted)
    with pytest.raises(
        SolverError, match=f"eigenvalues. lengths, by {1e-5 * (642 / largest) ** 0.5:.1e} of"
    ):
        canonical_form(blob)


def test_no_more_samples_and_eigenpairs_than_vertices_are_used(blob):
    small = Mesh(make_sphere(1).vertices * [1, 1.5, 2] + 0.1, make_sphere(1).faces)
    form = sampled_canonical_form(small)
    for options in ({"n_samples": 42}, {"n_eigenpairs": 42}):
        same = sampled_canonical_form(small, **options)
        np.testing.assert_array_equal(form.points, same.points)
    for options in ({"n_samples": 100}, {"n_eigenpairs": 50}):
        other = sampled_canonical_form(blob, **options)
        assert abs(other.points - sampled_canonical_form(blob).points).max() > 0


def test_what_is_not_said_is_as_documented(blob):
    documented = {"n_eigenpairs": 100, "n_samples": 200, "mu": 1e4, "interpolation": "projection"}
    found = sampled_canonical_form(blob)
    same = sampled_canonical_form(blob, **documented)
    np.testing.assert_array_equal(found.points, same.points)
    for seed in range(3):
        form = canonical_form(blob, random_state=seed)
        assert (form.stress == canonical_form(blob).stress) == (seed == 0)


def test_two_samples_span_a_line(blob):
    options = {"n_samples": 2, "n_eigenpairs": 2, "n_components": 1}
    form = sampled_canonical_form(blob, **options)
    assert np.corrcoef(form.points[:, 0], canonical_form(blob).points[:, 0])[0, 1] ** 2 > 0.9


def test_coordinates_of_distances_that_are_not_euclidean_are_left_out_and_counted(blob):
    mesh = Mesh(blob.vertices, blob.faces, name="bent")
    with pytest.warns(UnbendWarning, match="^bent: .* leading eigenvalues are negative") as told:
        form = sampled_canonical_form(mesh, distance="geodesic", n_eigenpairs=50, n_components=45)
    negative = form.eigenvalues < 0
    sentence = f"{negative.sum()} of the 45 leading eigenvalues are negative"
    assert sentence in str(told[0].message)
    assert sentence in form.notes[-1]
    assert 0 < negative.sum() < 45
    np.testing.assert_array_equal((form.points == 0).all(axis=0), form.eigenvalues <= 0)


@pytest.mark.parametrize(
    ("method", "steps"),
    [("exact", "scaling stress"), ("sampled", "spectrum sampling interpolation scaling stress")],
)
def test_every_step_is_timed_and_told_when_it_begins_and_ends(blob, method, steps):
    told, begun = [], clock.perf_counter()
    form = form_of(blob, method=method, progress=lambda *step: told.append(step))
    assert min(form.seconds.values()) >= 0
    assert sum(form.seconds.values()) <= clock.perf_counter() - begun
    assert list(form.seconds) == ["laplacian", "factorisation", *steps.split()]
    assert told == [(step, share) for step in form.seconds for share in (0, 1)]


@pytest.mark.filterwarnings("ignore:.*as far from the middle as most")
@pytest.mark.parametrize("height", [1e9, 1e15, 1e20, 1e29])
def test_what_rounding_leaves_of_no_extent_is_not_taken_for_distances_that_are_not_euclidean(
    height: float,
) -> None:
    # The three points below are one, to rounding: the form is a line.
    needle = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, height]]
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    with (
        pytest.warns(UnbendWarning, match="degenerate faces"),
        pytest.warns(UnbendWarning, match="too thin"),
    ):
        form = canonical_form((np.array(needle), np.array(faces)))
    assert form.eigenvalues[0] > 0
    assert (form.eigenvalues[1:] == 0).all()
    assert not any("Euclidean" in note for note in form.notes)
