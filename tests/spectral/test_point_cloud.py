"""Point clouds against closed forms, meshes of the same points, and what must not change them."""

import itertools
import warnings

import numpy as np
import pytest
import scipy.linalg
from scipy.spatial import ConvexHull, Delaunay

from unbend import Mesh, canonical_form, distance, laplacian, spectrum
from unbend.collection import descriptor
from unbend.datasets import make_biped, make_quadruped, make_sphere
from unbend.errors import MeshError, SolverError, UnbendWarning
from unbend.spectral import _point_cloud, delaunay_triangles
from unbend.spectral._point_cloud import check_energy

pytestmark = pytest.mark.usefixtures("no_cache")

SIZES_AWAY = [0, 1, 10, 1e3, 1e6]


def flat(points):
    """Points of the plane in space."""
    return np.column_stack([points, np.zeros(len(points))])


def make_rectangle(n):
    """Random points of a rectangle; without boundary, its eigenvalues are those of waves."""
    return flat(np.random.default_rng(0).random((n, 2)) * [1.5, 1])


def make_grid(n, m):
    """Regular points of the same rectangle."""
    x, y = np.meshgrid(np.linspace(0, 1.5, n), np.linspace(0, 1, m), indexing="ij")
    return flat(np.column_stack([x.ravel(), y.ravel()]))


def make_fibonacci(n):
    """Points all over the unit sphere, as even as can be."""
    i = np.arange(n) + 0.5
    z, turn = 1 - 2 * i / n, np.pi * (1 + np.sqrt(5)) * i
    rim = np.sqrt(1 - z**2)
    return np.column_stack([rim * np.cos(turn), rim * np.sin(turn), z])


def make_random_sphere(n):
    """Random points of the unit sphere."""
    points = np.random.default_rng(1).standard_normal((n, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def make_torus(n, m):
    """Regular points of a torus with radii 2 and 1, whose area is 8 pi^2."""
    around, up = np.meshgrid(2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m)
    out = 2 + np.cos(up)
    parts = out * np.cos(around), out * np.sin(around), np.sin(up)
    return np.column_stack([part.ravel() for part in parts])


def torus_eigenvalues(count):
    """Lowest eigenvalues of that torus, by separation of variables: f(v) exp(i m u).

    The derivative of f is that of the trigonometric polynomial through its values.
    """
    n = 101
    step = np.arange(n)[:, None] - np.arange(n)
    with np.errstate(divide="ignore"):
        derivative = 0.5 * (-1.0) ** step / np.sin(step * np.pi / n)
    np.fill_diagonal(derivative, 0)
    out = 2 + np.cos(2 * np.pi * np.arange(n) / n)
    found = []
    for m in range(6):
        stiffness = derivative.T @ np.diag(out) @ derivative + np.diag(m**2 / out)
        found += [*scipy.linalg.eigh(stiffness, np.diag(out), eigvals_only=True)] * (2 if m else 1)
    return np.sort(found)[:count]


def turn(points, seed=0):
    """Turn points by some rotation."""
    rotation = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    return points @ (rotation * np.linalg.det(rotation))


def eigenvalues(points, count):
    return spectrum(points, count).eigenvalues


def waves(width, height, count):
    """Lowest eigenvalues of a rectangle whose boundary is free."""
    i, j = np.meshgrid(np.arange(20), np.arange(20))
    return np.sort(np.pi**2 * ((i / width) ** 2 + (j / height) ** 2), axis=None)[:count]


def harmonics(count, even=False):
    """Eigenvalues of the unit sphere; those of functions even in z are those of its half."""
    return np.array(
        [k * (k + 1) for k in range(9) for m in range(-k, k + 1) if not even or (k + m) % 2 == 0]
    )[:count]


# Closed forms


@pytest.mark.parametrize(("n", "tolerance"), [(400, 0.11), (1500, 0.06), (10_000, 0.03)])
def test_random_points_of_a_rectangle(n, tolerance):
    found = spectrum(make_rectangle(n), 6)
    assert found.areas.sum() == pytest.approx(1.5, rel=tolerance)
    np.testing.assert_allclose(found.eigenvalues, waves(1.5, 1, 6), rtol=tolerance, atol=1e-9)


@pytest.mark.parametrize("n", [2000, 20_000])
def test_area_of_the_sphere_at_any_density(n):
    assert laplacian(make_fibonacci(n)).areas.sum() == pytest.approx(4 * np.pi, rel=4 / n)


@pytest.mark.parametrize(
    ("points", "tolerance"),
    [
        (make_fibonacci(500), 0.02),
        (make_fibonacci(5000), 2e-3),
        (make_random_sphere(500), 0.08),
        (make_random_sphere(5000), 0.015),
        (make_sphere(4).vertices, 5e-3),
    ],
)
def test_eigenvalues_of_the_sphere(points, tolerance):
    found = eigenvalues(points, 16)
    np.testing.assert_allclose(found, harmonics(16), rtol=tolerance, atol=1e-9)


@pytest.mark.parametrize(
    ("points", "tolerance"), [(make_fibonacci(10_000), 0.012), (make_random_sphere(10_000), 0.015)]
)
def test_half_a_sphere(points, tolerance):
    found = spectrum(points[points[:, 2] > 0], 9)
    assert found.areas.sum() == pytest.approx(2 * np.pi, rel=tolerance)
    expected = harmonics(9, even=True)
    np.testing.assert_allclose(found.eigenvalues, expected, rtol=tolerance, atol=1e-9)


def test_a_torus():
    found = spectrum(make_torus(80, 40), 10)
    assert found.areas.sum() == pytest.approx(8 * np.pi**2, rel=5e-3)
    np.testing.assert_allclose(found.eigenvalues, torus_eigenvalues(10), rtol=5e-3, atol=1e-9)


def test_a_body_is_that_of_its_mesh():
    body = make_quadruped(n_vertices=5000).mesh
    found, mesh = (spectrum(one, 12) for one in (body.vertices, body))
    assert found.areas.sum() == pytest.approx(mesh.areas.sum(), rel=2e-3)
    np.testing.assert_allclose(found.eigenvalues, mesh.eigenvalues, rtol=5e-3, atol=1e-9)


@pytest.mark.parametrize(
    ("n", "shape", "tolerance"),
    [
        (20, lambda x, y: x**2 + y**2, 2e-3),
        (20, lambda x, y: x * y, 2e-3),
        (40, lambda x, y: 0.2 * np.sin(5 * x) * np.cos(4 * y), 5e-3),
        (40, lambda x, y: 3 * x + 0.3 * np.sin(4 * y), 5e-3),
    ],
)
def test_height_above_a_grid(n, shape, tolerance):
    """As a depth camera sees a surface: points a little off one circle, four by four."""
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    points = np.column_stack([x.ravel(), y.ravel(), shape(x, y).ravel()])
    line = np.linspace(-1, 1, 2001)
    slopes = np.gradient(shape(*np.meshgrid(line, line)), line, line)
    element = np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2)
    area = np.trapezoid(np.trapezoid(element, line), line)
    assert laplacian(points).areas.sum() == pytest.approx(area, rel=tolerance)


def test_holes_stay_open():
    points = make_grid(61, 41)
    away = np.linalg.norm(points - [0.75, 0.5, 0], axis=1)
    found = laplacian(points[away > 0.2]).areas.sum()
    assert 1.5 - np.pi * 0.24**2 < found < 1.5 - np.pi * 0.19**2


@pytest.mark.parametrize("stretch", [1, 4, 8, 12])
def test_points_in_rows(stretch):
    """Points that are so many times closer in a row than rows are."""
    found = spectrum(make_grid(30 * stretch + 1, 21), 6)
    assert found.areas.sum() == pytest.approx(1.5, rel=1e-9)
    np.testing.assert_allclose(found.eigenvalues, waves(1.5, 1, 6), rtol=4e-3, atol=1e-9)


def test_where_points_are_dense():
    rng = np.random.default_rng(0)
    patch = flat(rng.random((4000, 2)) * 0.2 + [0.6, 0.4])
    found = spectrum(np.vstack([make_grid(46, 31), patch]), 6)
    assert found.areas.sum() == pytest.approx(1.5, rel=0.02)
    np.testing.assert_allclose(found.eigenvalues, waves(1.5, 1, 6), rtol=0.02, atol=1e-9)


# Other ways to the same matrices


@pytest.mark.kernels
def test_random_points_of_the_plane_have_the_weights_of_their_delaunay_triangulation():
    points = np.random.default_rng(0).random((150, 2))
    inside = (abs(points - 0.5) < 0.25).all(axis=1)
    expected = np.zeros((150, 150))
    for triangle in Delaunay(points).simplices:
        for i, j, k in itertools.permutations(triangle):
            p, q = points[i] - points[k], points[j] - points[k]
            cotangent = p @ q / abs(p[0] * q[1] - p[1] * q[0])
            expected[i, j] -= cotangent / 2
            expected[i, i] += cotangent / 2
    found = laplacian(flat(points)).stiffness.toarray()
    np.testing.assert_allclose(found[inside], expected[inside], atol=1e-9)


@pytest.mark.kernels
@pytest.mark.parametrize("away", SIZES_AWAY)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_square_grid_has_the_five_point_stencil(away, seed):
    """Its points are four by four on a circle, so that any diagonal will do."""
    grid = make_grid(16, 11) * 10
    mixed = np.random.default_rng(seed).permutation(len(grid))
    found = laplacian(turn(grid[mixed], seed) + away)
    back = np.argsort(mixed)
    stiffness = found.stiffness.toarray()[back][:, back]
    x, y = grid[:, :2].T
    apart = abs(x[:, None] - x) + abs(y[:, None] - y)
    edge = np.where(abs(apart - 1) < 1e-6, 1.0, 0.0)
    for one, most in ((x, 15), (y, 10)):
        rim = (one < 1e-6) | (one > most - 1e-6)
        edge[np.ix_(rim, rim)] /= np.where(abs(one[rim][:, None] - one[rim]) < 1e-6, 2, 1)
    expected = np.diag(edge.sum(axis=1)) - edge
    np.testing.assert_allclose(stiffness, expected, atol=max(1e-9, 1e-9 * away))
    ends = np.where((x < 1e-6) | (x > 15 - 1e-6), 0.5, 1)
    areas = ends * np.where((y < 1e-6) | (y > 10 - 1e-6), 0.5, 1)
    np.testing.assert_allclose(found.areas[back], areas, atol=max(1e-9, 1e-9 * away))


@pytest.mark.kernels
@pytest.mark.parametrize(
    "solid",
    [
        [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]],
        np.vstack([np.eye(3), -np.eye(3)]),
        list(itertools.product([-1, 1], repeat=3)),
        make_sphere(0).vertices,
        make_sphere(1).vertices,
        make_sphere(2).vertices,
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_corners_of_a_convex_solid_are_that_solid(solid, seed):
    points = turn(np.array(solid, dtype=float), seed)
    mesh = laplacian((points, ConvexHull(points).simplices), laplacian="cotangent")
    found = laplacian(points)
    assert found.areas.sum() == pytest.approx(mesh.areas.sum(), rel=1e-9)
    np.testing.assert_allclose(found.stiffness.toarray(), mesh.stiffness.toarray(), atol=1e-9)


@pytest.mark.kernels
@pytest.mark.parametrize("n", range(4, 32))
def test_few_points(n):
    rng = np.random.default_rng(n)
    for points in (flat(rng.random((n, 2))), make_random_sphere(40)[:n]):
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "mesh: neighbouring points disagree", UnbendWarning)
            found = laplacian(points)
        assert found.areas.min() > 0
        assert abs(found.stiffness @ np.ones(n)).max() < 1e-9 * abs(found.stiffness).max()
        assert np.linalg.eigvalsh(found.stiffness.toarray())[1] > 0


# What changes nothing


@pytest.mark.parametrize("away", SIZES_AWAY)
@pytest.mark.parametrize("make", [make_rectangle, make_fibonacci, make_random_sphere])
def test_where_a_cloud_lies_changes_nothing(make, away):
    points = make(1500)
    moved = turn(points) + 2 * away * np.array([0.3, -0.5, 0.8])
    found, expected = (spectrum(one, 6) for one in (moved, points))
    np.testing.assert_allclose(found.eigenvalues, expected.eigenvalues, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.areas, expected.areas, rtol=1e-6)


@pytest.mark.parametrize("size", [1e-50, 1e-20, 1e-3, 3, 1e20, 1e50])
def test_the_unit_of_length_changes_only_the_areas(size):
    points = make_random_sphere(300)
    found, expected = laplacian(points * size), laplacian(points)
    np.testing.assert_allclose(found.areas, expected.areas * size**2, rtol=1e-9)
    assert abs(found.stiffness - expected.stiffness).max() < 1e-9 * abs(expected.stiffness).max()


@pytest.mark.parametrize(
    "points",
    [make_rectangle(500), make_random_sphere(500), make_grid(21, 15), make_torus(40, 20)],
)
def test_the_order_of_points_changes_nothing(points):
    mixed = np.random.default_rng(5).permutation(len(points))
    found, expected = laplacian(points[mixed]), laplacian(points)
    np.testing.assert_allclose(found.areas, expected.areas[mixed], rtol=1e-9)
    change = found.stiffness - expected.stiffness[mixed][:, mixed]
    assert abs(change).max() < 1e-9 * abs(expected.stiffness).max()


def test_what_is_made_of_a_cloud_does_not_depend_on_where_it_lies():
    points = make_quadruped(n_vertices=1500).mesh.vertices
    moved = points + 30 * np.ptp(points)
    expected, found = canonical_form(points), canonical_form(moved)
    np.testing.assert_allclose(
        found.points @ found.points.T, expected.points @ expected.points.T, atol=1e-6
    )
    for kind in ("biharmonic", "commute-time", "diffusion", "geodesic"):
        near = distance(points, 7, distance=kind)
        np.testing.assert_allclose(distance(moved, 7, distance=kind), near, atol=1e-6 * near.max())
    assert abs(descriptor(moved) - descriptor(points)).max() < 1e-4


# Points at one place


@pytest.mark.parametrize("apart", [0, 1e-15, 1e-11])
def test_points_at_one_place(apart):
    points = make_fibonacci(400)
    again = np.concatenate([points[:50], points[:9], points[:9]])
    again += apart * np.random.default_rng(0).standard_normal(again.shape)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "mesh: .* at the position", UnbendWarning)
        found = spectrum(np.concatenate([points, again]), 9)
        far = distance(np.concatenate([points, again]), 3, distance="geodesic")[0]
        spread = distance(np.concatenate([points, again]), 3)[0]
    expected = spectrum(points, 9)
    np.testing.assert_allclose(found.eigenvalues, expected.eigenvalues, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(
        found.eigenfunctions[400:],
        found.eigenfunctions[[*range(50), *range(9), *range(9)]],
        atol=1e-5,
    )
    assert found.areas.sum() == pytest.approx(expected.areas.sum(), rel=1e-12)
    np.testing.assert_allclose(
        found.areas[[0, 20, 60]] / expected.areas[[0, 20, 60]], [1 / 4, 1 / 2, 1]
    )
    np.testing.assert_allclose(far[:400], distance(points, 3, distance="geodesic")[0], atol=1e-12)
    np.testing.assert_allclose(far[400:450], far[:50], atol=1e-12)
    np.testing.assert_allclose(spread[:400], distance(points, 3)[0], atol=1e-6)
    np.testing.assert_allclose(spread[400:450], spread[:50], atol=1e-6)


@pytest.mark.parametrize("apart", [1e-8, 1e-7, 1e-6])
def test_points_at_almost_one_place(apart):
    points = make_fibonacci(400)
    again = points[:50] + apart * np.random.default_rng(0).standard_normal((50, 3))
    found = eigenvalues(np.concatenate([points, again]), 9)
    np.testing.assert_allclose(found, eigenvalues(points, 9), rtol=1e-5, atol=1e-9)


def test_one_place_many_times():
    points = make_fibonacci(400)
    found = laplacian(np.concatenate([points, np.repeat(points[:1], 3000, axis=0)]))
    assert found.areas.sum() == pytest.approx(laplacian(points).areas.sum(), rel=1e-9)
    assert found.stiffness.nnz < 20_000


# What is no surface


@pytest.mark.parametrize(
    "points",
    [
        np.outer(np.arange(2.0), [1, 2, 3]),
        np.outer(np.arange(3.0), [1, 2, 3]),
        np.outer(np.arange(20.0), [1, 2, 3]),
        np.vstack(
            [np.outer(np.arange(60.0), [1, 0, 0]), np.outer(np.arange(60.0), [1, 0, 0]) + 99]
        ),
    ],
)
def test_points_on_lines_are_refused(points):
    with pytest.raises(MeshError, match=r"^line: its points span no surface"):
        laplacian(Mesh(points, name="line"), laplacian="robust")


@pytest.mark.parametrize(
    "make",
    [
        lambda: np.random.default_rng(0).random((1000, 3)),
        lambda: make_random_sphere(2000) * np.random.default_rng(0).normal(1, 0.03, (2000, 1)),
        lambda: make_biped(n_vertices=500).mesh.vertices,
    ],
)
def test_points_that_show_no_surface_are_warned_of(make):
    with pytest.warns(
        UnbendWarning, match=r"^dust: neighbouring points disagree about [2-6]\d% of"
    ):
        laplacian(Mesh(make(), name="dust"))


def test_a_triangle_counts_wholly_where_its_corners_agree():
    even = delaunay_triangles(Mesh(make_fibonacci(300)))
    assert len(even.faces) == 596
    np.testing.assert_allclose(even.weights, 1, rtol=1e-12)
    random = delaunay_triangles(Mesh(make_random_sphere(3000))).weights
    assert 0 < random.min() < 0.9
    assert random.max() == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize(
    "points",
    [make_rectangle(1500), make_rectangle(1500) + 10, make_random_sphere(3000) + 5],
)
def test_weights_and_areas_of_different_surfaces_are_an_error(points):
    """As where a tangent plane is fitted to a centre that is off towards the origin."""
    import robust_laplacian

    cloud = Mesh(points, name="old")
    stiffness, mass = robust_laplacian.point_cloud_laplacian(points)
    areas = mass.diagonal()
    sentence = r"^old: the weights of its Laplacian are those of an area of \d"
    with pytest.raises(SolverError, match=sentence):
        check_energy(cloud, stiffness, areas)
    with pytest.raises(SolverError, match="but its points have nan"):
        check_energy(cloud, stiffness, areas * np.nan)
    operator = laplacian(points)
    check_energy(cloud, operator.stiffness, operator.areas)


def test_area_that_is_lost_is_an_error(monkeypatch):
    right = _point_cloud._cells
    monkeypatch.setattr(_point_cloud, "_cells", lambda *triangles: 0.999 * right(*triangles))
    with pytest.raises(SolverError, match=r"^less: the weights .* of \d.*, but its points have \d"):
        laplacian(Mesh(make_fibonacci(100), name="less"))
