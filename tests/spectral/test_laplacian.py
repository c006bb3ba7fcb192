import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.linalg.problems import square
from unbend import Mesh, canonical_form, distance, laplacian, spectrum
from unbend.datasets import make_sphere
from unbend.errors import InputError, MeshError, SolverError, UnbendWarning
from unbend.preparation import prepare
from unbend.spectral import _laplacian
from unbend.spectral._laplacian import choose_kind


def face_areas(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def test_is_symmetric_and_kills_constants(blob):
    stiffness = laplacian(blob).stiffness
    assert abs(stiffness - stiffness.T).max() == 0
    assert abs(stiffness @ np.ones(blob.n_vertices)).max() < 1e-12
    assert np.linalg.eigvalsh(stiffness.toarray())[0] > -1e-12


@given(seed=st.integers(0, 2**32 - 1))
def test_quadratic_form_is_the_energy_of_the_gradient(blob, seed):
    """u^T W u is the integral of |grad u|^2, each face's gradient found by least squares."""
    values = np.random.default_rng(seed).standard_normal(blob.n_vertices)
    corners, at_corners = blob.vertices[blob.faces], values[blob.faces]
    edges = corners[:, 1:] - corners[:, :1]
    rises = at_corners[:, 1:] - at_corners[:, :1]
    gradients = np.stack(
        [np.linalg.lstsq(e, r, rcond=None)[0] for e, r in zip(edges, rises, strict=True)]
    )
    energy = (face_areas(blob) * (gradients**2).sum(axis=1)).sum()
    assert values @ (laplacian(blob).stiffness @ values) == pytest.approx(energy, rel=1e-10)


@pytest.mark.parametrize("areas", ["voronoi", "barycentric"])
def test_areas_share_out_the_whole_surface(blob, areas):
    found = laplacian(blob, area_kind=areas).areas
    assert found.min() > 0
    assert found.sum() == pytest.approx(face_areas(blob).sum(), rel=1e-12)


def test_voronoi_area_of_an_equilateral_triangle_is_a_third_each():
    triangle = Mesh([[0, 0, 0], [1, 0, 0], [0.5, np.sqrt(3) / 2, 0]], [[0, 1, 2]])
    np.testing.assert_allclose(laplacian(triangle, laplacian="cotangent").areas, np.sqrt(3) / 12)


def test_voronoi_area_of_an_obtuse_triangle_is_a_half_and_two_quarters():
    triangle = Mesh([[0, 0, 0], [4, 0, 0], [1, 0.5, 0]], [[0, 1, 2]])
    np.testing.assert_allclose(laplacian(triangle, laplacian="cotangent").areas, [0.25, 0.25, 0.5])


def test_voronoi_area_on_a_regular_grid_is_the_square_around_each_vertex():
    areas = laplacian(square(6)).areas.reshape(6, 6)
    np.testing.assert_allclose(areas[1:-1, 1:-1], 1 / 25)


def test_robust_equals_cotangent_on_a_delaunay_mesh():
    sphere = make_sphere(3)
    cotangent, robust = laplacian(sphere), laplacian(sphere, laplacian="robust")
    assert (cotangent.kind, robust.kind) == ("cotangent", "robust")
    assert abs(cotangent.stiffness - robust.stiffness).max() < 1e-3
    assert robust.areas.sum() == pytest.approx(cotangent.areas.sum(), rel=1e-3)


def test_scale_leaves_the_stiffness_and_squares_the_areas(blob):
    small, large = laplacian(blob), laplacian(Mesh(blob.vertices * 1e3, blob.faces))
    assert abs(small.stiffness - large.stiffness).max() < 1e-9
    np.testing.assert_allclose(large.areas, small.areas * 1e6)


def test_a_kind_that_is_asked_for_is_taken(blob):
    prepared = prepare(blob)
    for kind in ("cotangent", "robust"):
        assert choose_kind(kind, prepared) == kind
    assert choose_kind("auto", prepared) == "cotangent"


@pytest.mark.parametrize("faces", [[[0, 1, 2], [1, 2, 3]], [[0, 0, 1]]])
@pytest.mark.parametrize("kind", ["auto", "robust"])
def test_faces_without_area_have_no_laplacian(kind, faces):
    line = np.outer(np.arange(4.0), [1, 2, 3])
    with pytest.raises(MeshError, match="every face is degenerate"):
        laplacian((line, faces), laplacian=kind)


def test_auto_chooses_robust_for_a_degenerate_face(blob):
    (i, j, k), middle = blob.faces[0], blob.vertices[blob.faces[0, :2]].mean(axis=0)
    n = blob.n_vertices
    split = np.vstack([blob.faces[1:], [[i, n, k], [n, j, k], [i, j, n]]])
    assert laplacian(blob).kind == "cotangent"
    assert laplacian(Mesh(np.vstack([blob.vertices, [middle]]), split)).kind == "robust"


@pytest.mark.parametrize(("length", "kind"), [(1e7, "cotangent"), (1e8, "robust")])
def test_auto_takes_the_robust_laplacian_where_faces_are_too_thin(length, kind):
    """It widens them, and says so."""
    sphere = make_sphere(2)
    long = Mesh(sphere.vertices * [1, 1, length], sphere.faces, name="long")
    if kind == "cotangent":
        found = laplacian(long)
        assert found.areas.sum() == pytest.approx(face_areas(long).sum(), rel=1e-9)
    else:
        too_thin = r"^long: to the robust Laplacian its area is 1.16e\+14, .* 9.69e\+08: they are"
        with pytest.warns(UnbendWarning, match=too_thin):
            found = laplacian(long)
    assert found.kind == kind


@pytest.mark.filterwarnings("ignore:thin. robust Laplacian, because of 2 degenerate faces")
@pytest.mark.parametrize(
    "compute",
    [
        lambda mesh: distance(mesh, 0, distance="biharmonic", laplacian="cotangent"),
        lambda mesh: canonical_form(mesh, laplacian="cotangent"),
        lambda mesh: spectrum(mesh, 3, laplacian="cotangent"),
    ],
)
def test_a_singular_laplacian_names_the_mesh_and_the_robust_one(blob, compute):
    points = blob.vertices.copy()
    here, there = blob.faces[0, :2]
    points[there] = points[here] + 1e-14 * (points[there] - points[here])
    told = r'^thin: .*; if .* thin, mesh it anew, or try the "robust"'
    with pytest.raises(SolverError, match=told):
        compute(Mesh(points, blob.faces, name="thin"))


@pytest.mark.parametrize("kind", ["auto", "cotangent", "robust"])
def test_repeated_faces_do_not_count(blob, kind):
    faces = np.vstack([blob.faces[:9, ::-1], blob.faces])
    plain, found = (laplacian((blob.vertices, one), laplacian=kind) for one in (blob.faces, faces))
    np.testing.assert_allclose(found.areas, plain.areas, rtol=1e-12)
    assert abs(found.stiffness - plain.stiffness).max() < 1e-12 * abs(plain.stiffness).max()


def test_a_triangle_on_its_own_counts_once_if_it_is_there_twice(blob):
    triangle = np.eye(3)
    vertices = np.vstack([blob.vertices, 9 + triangle])
    faces = np.vstack([blob.faces, [[642, 643, 644], [644, 643, 642]]])
    area = face_areas(Mesh(vertices, faces[:-1])).sum()
    assert laplacian((vertices, faces)).areas.sum() == pytest.approx(area, rel=1e-12)


def test_faces_that_repeat_a_vertex_or_another_face_do_not_count(blob):
    faces = np.vstack([blob.faces[:9, ::-1], [[0, 0, 1]], blob.faces])
    plain, found = laplacian(blob), laplacian(Mesh(blob.vertices, faces))
    assert found.kind == "cotangent"
    np.testing.assert_allclose(found.areas, plain.areas, rtol=1e-12)
    assert abs(found.stiffness - plain.stiffness).max() < 1e-12 * abs(plain.stiffness).max()


def test_unreferenced_vertices_have_no_area(blob):
    away = [[9.0, 9, 9]]
    extended = Mesh(np.vstack([away, blob.vertices, away]), blob.faces + 1)
    for kind in ("cotangent", "robust"):
        found = laplacian(extended, laplacian=kind)
        assert found.areas[[0, -1]].tolist() == [0, 0]
        assert found.stiffness[[0, -1]].count_nonzero() == 0


def test_it_is_told_that_a_seam_cuts_the_surface_open():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    apart = corners[[0, 1, 2, 0, 2, 3]], [[0, 1, 2], [3, 4, 5]]
    with pytest.warns(UnbendWarning, match="2 boundary vertices .* the surface is cut open there"):
        assert abs(laplacian(apart).stiffness[:3, 3:]).max() == 0


@pytest.mark.filterwarnings("ignore:.*the surface is cut open there")
def test_cotangent_of_a_degenerate_face_is_refused_by_number(blob):
    faces = np.vstack([blob.faces, [[0, 0, 1]]])
    with pytest.raises(MeshError, match=f"face {len(blob.faces)} has no area"):
        laplacian(Mesh(blob.vertices, faces), laplacian="cotangent")
    point = np.vstack([blob.vertices, np.ones((3, 3))])
    faces = np.vstack([blob.faces, [[642, 643, 644]]])
    with pytest.raises(MeshError, match=f"face {len(blob.faces)} has no area"):
        laplacian(Mesh(point, faces), laplacian="cotangent")


@pytest.mark.filterwarnings("ignore::unbend.errors.UnbendWarning")
def test_a_degenerate_face_keeps_its_number_whatever_is_left_out_before_it(blob):
    vertices = blob.vertices.copy()
    vertices[blob.faces[5, 0]] = vertices[blob.faces[5, 1]]
    vertices = np.vstack([vertices, 9 + np.eye(3)])
    faces = np.vstack([[[642, 643, 644]], blob.faces[:1], blob.faces])
    first = 2 + int(np.isin(blob.faces, blob.faces[5, :2]).sum(axis=1).tolist().index(2))
    for compute in (
        lambda mesh: laplacian(mesh, laplacian="cotangent"),
        lambda mesh: spectrum(mesh, 3, laplacian="cotangent"),
        lambda mesh: canonical_form(mesh, laplacian="cotangent", component=0),
    ):
        with pytest.raises(MeshError, match=f"face {first} has no area"):
            compute(Mesh(vertices, faces))


def test_a_face_is_flat_in_units_of_its_own_longest_edge():
    corner = np.array([[0, 0, 0], [1.0, 0, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    small = laplacian(Mesh(np.vstack([corner + 1, corner * 1e-9]), faces), laplacian="cotangent")
    assert small.areas[3:].sum() == pytest.approx(0.5e-18)
    needle = [[0, 0, 0], [1, 0, 0], [1e-3, 1e-17, 0]]
    with pytest.raises(MeshError, match="face 1 has no area"):
        laplacian(Mesh(np.vstack([corner + 1, needle]), faces), laplacian="cotangent")


def test_components_do_not_know_of_each_other(blob):
    sphere = make_sphere(2)
    both = np.vstack([sphere.vertices + 9, blob.vertices])
    found = laplacian(Mesh(both, np.vstack([sphere.faces, blob.faces + 162])))
    for part, alone in ((slice(162), sphere), (slice(162, None), blob)):
        one = laplacian(alone)
        assert abs(found.stiffness[part, part] - one.stiffness).max() < 1e-9
        np.testing.assert_allclose(found.areas[part], one.areas)
    assert found.stiffness[:162, 162:].nnz == 0


def test_unknown_names_are_refused(blob):
    with pytest.raises(InputError, match="uniform"):
        laplacian(blob, laplacian="uniform")
    with pytest.raises(InputError, match="area_kind must be"):
        laplacian(blob, area_kind="full")
    with pytest.raises(MeshError, match="point cloud"):
        laplacian(blob.vertices, laplacian="cotangent")


@pytest.mark.parametrize("kind", ["cotangent", "robust"])
@pytest.mark.parametrize("size", [1e-160, 1e120, 1e200])
def test_sizes_beyond_double_precision_are_refused(kind, size):
    """An operator of zeros, or of NaN, is what they would give."""
    ball = make_sphere(1)
    with pytest.raises(MeshError):
        laplacian((ball.vertices * size, ball.faces), laplacian=kind)
    with pytest.raises(MeshError, match="across; give coordinates"):
        laplacian(ball.vertices * size, laplacian="robust")


def test_one_corner_beyond_double_precision_is_refused():
    ball = make_sphere(1)
    size = np.ones((ball.n_vertices, 1))
    size[7] = 1e200
    with pytest.raises(MeshError, match=r"its area is .*; give coordinates in a sensible unit"):
        laplacian((ball.vertices * size, ball.faces), laplacian="cotangent")


def test_area_that_is_lost_is_an_error(blob, monkeypatch):
    monkeypatch.setattr(
        _laplacian, "mixed_voronoi", lambda squared, cotangents, areas: areas[:, None] / [4, 4, 4]
    )
    again = Mesh(blob.vertices, np.vstack([blob.faces, blob.faces[:3]]), name="again")
    for mesh in (Mesh(blob.vertices, blob.faces, name="once"), again):
        lost = rf"^{mesh.name}: its vertices share out an area of .*, but its faces have"
        with pytest.raises(SolverError, match=lost):
            laplacian(mesh)


@pytest.mark.parametrize("size", [1e-7, 1e-4, 1e4, 1e5, 1e6, 1e7])
def test_rounding_of_large_and_small_areas_is_not_taken_for_a_loss(blob, size):
    found = laplacian(Mesh(blob.vertices * size, blob.faces)).areas
    np.testing.assert_allclose(found, laplacian(blob).areas * size**2, rtol=1e-9)


@pytest.mark.parametrize("share", [1e-3, 1e-5, 1e-7])
def test_rounding_of_large_weights_is_not_taken_for_a_fault(blob, share):
    """Faces as thin as needles have cotangents as large as 1 / share."""
    points = blob.vertices.copy()
    here, there = blob.faces[::20, 0], blob.faces[::20, 1]
    points[there] = points[here] + share * (points[there] - points[here])
    stiffness = laplacian(Mesh(points, blob.faces), laplacian="cotangent").stiffness
    assert abs(stiffness).max() > 0.1 / share
    assert abs(stiffness @ np.ones(642)).max() < 1e-12 * abs(stiffness).max()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda w, m: (w.multiply(1 + 1e-6 * (np.arange(42) == 3)), m), "rows of its Laplacian"),
        (lambda w, m: (w * np.nan, m), "rows of its Laplacian sum to as much as nan"),
        (lambda w, m: (w, m.multiply(np.where(np.arange(42) == 3, -1, 1))), "vertex area of -"),
        (lambda w, m: (w, m * np.nan), "vertex area of nan"),
    ],
)
def test_a_robust_laplacian_that_is_none_is_an_error(monkeypatch, spoil, message):
    import robust_laplacian

    right = robust_laplacian.mesh_laplacian
    monkeypatch.setattr(robust_laplacian, "mesh_laplacian", lambda *mesh: spoil(*right(*mesh)))
    with pytest.raises(SolverError, match=message):
        laplacian(make_sphere(1), laplacian="robust")
