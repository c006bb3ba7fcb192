import sys
import warnings

import numpy as np
import pytest

from unbend import Mesh, distance
from unbend.datasets import make_biped, make_quadruped, make_sphere
from unbend.distances import geodesic_solver, make_metric
from unbend.errors import (
    InputError,
    MeshError,
    MissingExtraError,
    SolverError,
    UnbendWarning,
)
from unbend.mesh import edge_ends
from unbend.spectral import make_surface


@pytest.fixture(scope="module")
def arcs():
    """A fine sphere and the length of the great-circle arc from vertex 0 to every vertex."""
    sphere = make_sphere(4)
    return sphere, np.arccos(np.clip(sphere.vertices @ sphere.vertices[0], -1, 1))


@pytest.mark.parametrize(("kind", "most"), [("geodesic", 0.03), ("geodesic-exact", 2e-3)])
def test_geodesics_follow_great_circles(arcs, kind, most):
    sphere, expected = arcs
    found = distance(sphere, 0, distance=kind)[0]
    assert found[0] == 0
    assert abs(found - expected).max() < most * np.pi


def test_exact_geodesics_unfold_a_cube():
    """Between opposite corners of the unit cube the shortest path has length sqrt(5)."""
    import trimesh

    cube = trimesh.creation.box()
    opposite = np.argmax(np.linalg.norm(cube.vertices - cube.vertices[0], axis=1))
    found = distance(cube, 0, distance="geodesic-exact")[0, opposite]
    assert found == pytest.approx(np.sqrt(5), rel=1e-9)


def test_heat_method_on_a_point_cloud(arcs):
    sphere, expected = arcs
    found = distance(sphere.vertices, 0, distance="geodesic")[0]
    assert abs(found - expected).max() < 0.1 * np.pi


@pytest.mark.parametrize("away", [0, 1, 10, 1e3, 1e6])
def test_heat_on_a_point_cloud_does_not_depend_on_where_it_lies(arcs, away):
    points = arcs[0].vertices[::3]
    found = distance(points + away * np.array([2, -1, 0.5]), 0, distance="geodesic")[0]
    assert abs(found - arcs[1][::3]).max() < 0.03 * np.pi
    np.testing.assert_allclose(found, distance(points, 0, distance="geodesic")[0], atol=1e-4)


def test_heat_on_a_flat_point_cloud_is_straight():
    points = np.column_stack(
        [np.random.default_rng(0).random((3000, 2)) * [1.5, 1], np.zeros(3000)]
    )
    straight = np.linalg.norm(points - points[5], axis=1)
    found = distance(points, 5, distance="geodesic")[0]
    assert abs(found - straight).max() < 0.03 * straight.max()


def test_heat_does_not_jump_from_limb_to_limb_of_a_point_cloud():
    body = make_biped(n_vertices=2000).mesh
    found = distance(body.vertices, 0, distance="geodesic")[0]
    expected = geodesic_solver(body, exact=True)(0)
    assert abs(found - expected).max() < 0.06 * expected.max()


@pytest.mark.parametrize("n", range(4, 33))
def test_heat_on_few_points(n):
    points = np.random.default_rng(n).standard_normal((n, 3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnbendWarning)
        found = distance(points, 2, distance="geodesic")[0]
    assert np.isfinite(found).all()
    assert found[2] == 0
    assert np.delete(found, 2).max() > 0.5 * np.linalg.norm(points - points[2], axis=1).max()


def test_point_clouds_have_no_exact_geodesics():
    with pytest.raises(MeshError, match="no exact geodesics"):
        distance(make_sphere(2).vertices, 0, distance="geodesic-exact")


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygeodesic.geodesic", None)
    with pytest.raises(MissingExtraError, match="pip install pygeodesic"):
        distance(make_sphere(1), 0, distance="geodesic-exact")


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (42, "there is no vertex 42"),
        (-1, "no vertex -1"),
        (0.5, "whole numbers"),
        (True, "whole numbers"),
        ([[0, 1]], "whole numbers"),
        ([], "whole numbers"),
        (np.empty(0, dtype=int), "at least one"),
    ],
)
def test_sources_that_do_not_exist_are_refused(source, message):
    with pytest.raises(InputError, match=message):
        distance(make_sphere(1), source)


def test_a_source_off_the_surface_is_refused():
    sphere = make_sphere(1)
    with (
        pytest.warns(UnbendWarning, match="1 unreferenced"),
        pytest.raises(InputError, match="vertex 42 is not part of the surface"),
    ):
        distance((np.vstack([sphere.vertices, [[5, 5, 5]]]), sphere.faces), 42)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"distance": "geodesic", "laplacian": "cotangent"}, "laplacian is for spectral distances"),
        (
            {"distance": "geodesic-exact", "laplacian": "robust"},
            "laplacian is for spectral distances",
        ),
        ({"distance": "geodesic", "n_eigenpairs": 9}, "n_eigenpairs is for spectral distances"),
        ({"distance": "geodesic", "time": 0.1}, "time is for diffusion distances, not geodesic"),
        ({"distance": "commute-time", "time": 0.1}, "time is for diffusion distances"),
    ],
)
def test_options_that_a_distance_cannot_use_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        distance(make_sphere(1), 0, **options)


@pytest.mark.parametrize("exact", [True, False])
def test_faces_that_are_no_surface_change_no_geodesic(exact):
    """Given to the solvers as they are, they end the process, or bend the path."""
    sphere = make_sphere(2)
    faces = np.concatenate([[[0, 0, 1], [7, 7, 7]], sphere.faces, sphere.faces[:9, ::-1]])
    found = geodesic_solver(Mesh(sphere.vertices, faces), exact=exact)(5)
    expected = geodesic_solver(sphere, exact=exact)(5)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_no_exact_geodesics_where_sheets_meet():
    sphere = make_sphere(1)
    n = sphere.n_vertices
    fin = (
        np.vstack([sphere.vertices, [[2, 2, 2]]]),
        np.vstack([sphere.faces, [[*sphere.faces[0, :2], n]]]),
    )
    beyond = np.where(sphere.faces == 0, 0, sphere.faces + n - 1)
    twins = (
        np.vstack([sphere.vertices, 2 * sphere.vertices[0] - sphere.vertices[1:]]),
        np.vstack([sphere.faces, beyond]),
    )
    again = fin[0], np.vstack([fin[1], fin[1][:3]])
    for shape, what in (
        (fin, "1 non-manifold edge"),
        (again, "1 non-manifold edge"),
        (twins, "1 non-manifold vertex"),
    ):
        with pytest.raises(MeshError, match=f"^sheets: {what}"):
            geodesic_solver(Mesh(*shape, name="sheets"), exact=True)(1)


def needled(mesh, share, seed):
    """A mesh some of whose edges have shrunk to this share."""
    points = mesh.vertices.copy()
    rows = np.random.default_rng(seed).permutation(mesh.n_faces)[:60]
    here, there = mesh.faces[rows, 0], mesh.faces[rows, 1]
    points[there] = points[here] + share * (points[there] - points[here])
    return Mesh(points, mesh.faces)


def test_exact_geodesics_that_do_not_arrive_are_an_error(blob):
    with pytest.raises(SolverError, match=r"do not reach \d+ vert"):
        geodesic_solver(needled(blob, 1e-6, 2), exact=True)(0)


def test_exact_geodesics_that_needles_lead_astray_are_warned_of_once(blob):
    """The solver's own fault: no path is longer than one along the edges."""
    one = geodesic_solver(needled(blob, 1e-5, 3), exact=True)
    with pytest.warns(UnbendWarning, match="by up to 0.07 of the largest") as caught:
        assert [len(one(480)), len(one(480))] == [blob.n_vertices] * 2
    assert len(caught) == 1


def test_heat_that_undercuts_the_straight_line_is_warned_of_once():
    mesh = make_biped("running", n_vertices=1000).mesh
    one = geodesic_solver(Mesh(mesh.vertices * [1, 1e3, 1], mesh.faces), exact=False)
    with pytest.warns(UnbendWarning, match=r"by up to \d\d% of the largest") as caught:
        assert [len(one(100)), len(one(200))] == [mesh.n_vertices] * 2
    assert len(caught) == 1


@pytest.mark.parametrize("size", [1e-160, 1e200])
@pytest.mark.parametrize("exact", [True, False])
def test_sizes_beyond_double_precision_are_refused(size, exact):
    sphere = make_sphere(1)
    with pytest.raises(MeshError, match="across; give coordinates in a unit"):
        geodesic_solver(Mesh(sphere.vertices * size, sphere.faces), exact=exact)(0)


def test_heat_is_right_within_a_few_edges_too():
    """There the method alone is 5 to 15 % short."""
    mesh = make_quadruped("walking", n_vertices=1500).mesh
    heat, exact = (geodesic_solver(mesh, exact=kind) for kind in (False, True))
    near = []
    for source in range(0, 1500, 50):
        found, true = heat(source), exact(source)
        straight = np.linalg.norm(mesh.vertices - mesh.vertices[source], axis=1)
        assert (found >= straight).all()
        around = np.argsort(true)[1:20]
        near.append(found[around].sum() / true[around].sum())
    assert abs(np.mean(near) - 1) < 0.02


@pytest.mark.parametrize("make", [make_biped, make_quadruped])
def test_heat_is_as_far_off_as_the_docstring_says(make):
    mesh, sources = make("walking", n_vertices=600).mesh, range(0, 600, 60)
    heat = distance(mesh, sources)
    exact = distance(mesh, sources, distance="geodesic-exact")
    assert 0.01 < np.abs(heat[exact > 0] / exact[exact > 0] - 1).mean() < 0.08


def given(distances):
    """A solver of the heat method, or an exact one, that knows these distances alone."""

    class Given:
        def __init__(self, *args, **options):
            pass

        def compute_distance(self, source):
            return distances

        def geodesicDistances(self, sources, targets):  # noqa: N802
            return distances, None

    return Given


def test_heat_that_is_not_finite_is_an_error(monkeypatch):
    monkeypatch.setattr("potpourri3d.MeshHeatMethodDistanceSolver", given(np.array([0, np.nan])))
    with pytest.raises(SolverError, match="not finite"):
        geodesic_solver(make_sphere(1), exact=False)(0)


def test_heat_is_measured_from_the_source_and_never_negative(monkeypatch):
    sphere, heat = make_sphere(1), np.full(42, 40.5)
    heat[[4, 7]] = 0.5, 0.25
    monkeypatch.setattr("potpourri3d.MeshHeatMethodDistanceSolver", given(heat))
    found = geodesic_solver(sphere, exact=False)(4)
    assert found[4] == 0
    assert found[7] == np.linalg.norm(sphere.vertices[4] - sphere.vertices[7])
    np.testing.assert_array_equal(np.delete(found, [4, 7]), 40)


@pytest.mark.parametrize(("factor", "share"), [(0.5, "50%"), (2.0, "25%")])
def test_what_heat_lacks_is_a_share_of_the_largest_distance(monkeypatch, factor, share):
    """The other end of the sphere comes out at half of the straight line, the rest at `factor`."""
    sphere = make_sphere(2)
    straight = np.linalg.norm(sphere.vertices - sphere.vertices[0], axis=1)
    far = straight > 1.99
    heat = np.where(far, 0.5, factor) * straight
    heat[np.argmin(abs(straight - 1.95))] = 2 * factor
    monkeypatch.setattr("potpourri3d.MeshHeatMethodDistanceSolver", given(heat))
    with pytest.warns(UnbendWarning, match=f"by up to {share} of the largest"):
        geodesic_solver(sphere, exact=False)(0)


def test_what_is_too_steep_is_a_share_of_the_largest_distance(monkeypatch):
    sphere = make_sphere(2)
    points = sphere.vertices * 1.4  # in a unit of 2
    straight = np.linalg.norm(points - points[0], axis=1) / 2
    farther = straight + 1.0 * (np.arange(162) == straight.argmax())
    monkeypatch.setattr("pygeodesic.geodesic.PyGeodesicAlgorithmExact", given(farther))
    edges = edge_ends(sphere.faces, 162)
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1) / 2
    steep = (abs(farther[edges[:, 0]] - farther[edges[:, 1]]) - lengths).max() / farther.max()
    with pytest.warns(UnbendWarning, match=f"by up to {steep:.1g} of the largest"):
        found = geodesic_solver(Mesh(points, sphere.faces), exact=True)(0)
    np.testing.assert_allclose(found, 2 * farther)


def test_heat_crosses_long_sheared_faces_straight():
    """On the intrinsic Delaunay triangulation; along the edges given it goes astray."""
    side = 20
    x, y = (one.ravel() / side for one in np.mgrid[:side, :side])
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.vstack(
        [
            np.stack([corner, corner + side, corner + side + 1], axis=1),
            np.stack([corner, corner + side + 1, corner + 1], axis=1),
        ]
    )
    sheet = np.stack([x + 4 * y, y / 5, 0 * x], axis=1)
    found = geodesic_solver(Mesh(sheet, faces), exact=False)(0)
    straight = np.linalg.norm(sheet - sheet[0], axis=1)
    assert abs(found - straight).max() < 0.05 * straight.max()


@pytest.mark.parametrize("kind", ["geodesic", "geodesic-exact"])
def test_distances_between_samples_are_the_mean_of_both_ways(arcs, kind):
    surface = make_surface(arcs[0])
    metric = make_metric(kind, surface)
    samples = np.array([0, 100, 2000])
    rows = metric.from_sources(samples)[:, samples]
    np.testing.assert_allclose(metric.between(samples), (rows + rows.T) / 2)
    np.testing.assert_allclose(rows[0] * np.sqrt(surface.area), arcs[1][samples], atol=0.03 * np.pi)


def test_a_vertex_off_the_surface_is_near_itself_alone():
    sphere = make_sphere(1)
    mesh = Mesh(np.vstack([sphere.vertices, [[5, 5, 5]]]), sphere.faces)
    found = geodesic_solver(mesh, exact=False)(42)
    assert found[42] == 0
    assert np.isinf(found[:42]).all()
