import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from unbend import Mesh, diagnose
from unbend._types import FloatArray
from unbend.errors import MeshError
from unbend.mesh import face_normals
from unbend.preparation import _surface, surface_of_points, triangulate_points
from unbend.preparation._winding_field import Grid, winding_number

TURN = Rotation.from_rotvec([0.5, -1.2, 0.8]).as_matrix()


def sphere(n: int, noise: float = 0) -> FloatArray:
    chance = np.random.default_rng(n)
    points = chance.standard_normal((n, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return np.asarray(points + noise * chance.standard_normal((n, 3)))


def helix(turns: int) -> FloatArray:
    angles = np.linspace(0, 2 * np.pi * turns, 600)
    return np.stack([np.cos(angles), np.sin(angles), 0.1 * angles], axis=1)


def torus(n: int, noise: float = 0, thick: float = 0.4) -> FloatArray:
    """Of radii 1 and 0.4, or another, uniform by area."""
    chance = np.random.default_rng(n)
    around, across = 2 * np.pi * chance.random((2, 4 * n))
    kept = chance.random(4 * n) < (1 + thick * np.cos(across)) / (1 + thick)
    around, across = around[kept][:n], across[kept][:n]
    radius = 1 + thick * np.cos(across)
    points = np.stack([radius * np.cos(around), radius * np.sin(around), thick * np.sin(across)], 1)
    return np.asarray(points + noise * chance.standard_normal((n, 3)))


def test_the_winding_number_tells_inside_from_outside() -> None:
    points, cell = sphere(1000), 0.11
    grid = Grid(points, cell)
    normals, field = winding_number(grid, len(points))
    areas = np.linalg.norm(normals, axis=1) * cell**2
    assert ((normals * points).sum(axis=1) * cell**2 > 0.95 * areas).all()
    assert areas.sum() == pytest.approx(4 * np.pi, rel=0.15)
    assert grid.values(field) == pytest.approx(0.5, abs=0.1)
    places = 0.5 * points[:9], 1.3 * points[:9]
    inside, outside = (grid.at(field, one) for one in places)
    assert inside == pytest.approx(1, abs=0.15)
    assert outside == pytest.approx(0, abs=0.15)


@pytest.mark.parametrize(("n", "noise"), [(600, 0), (1000, 0.04)])
def test_a_sphere(n: int, noise: float) -> None:
    found = surface_of_points(Mesh(sphere(n, noise)))
    health = diagnose(found.mesh)
    assert health.closed
    assert health.genus == 0
    assert health.n_components == 1
    assert health.area == pytest.approx(4 * np.pi, rel=0.04)
    radius = np.linalg.norm(found.mesh.vertices, axis=1)
    assert radius == pytest.approx(1, abs=0.04 + noise)
    volume = np.linalg.det(found.mesh.vertices[found.mesh.faces]).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi, rel=0.05)  # not minus that: faces point outward
    assert (found.vertex_of_point >= 0).all()


@pytest.mark.parametrize("noise", [0, 0.02])
def test_a_torus(noise: float) -> None:
    health = diagnose(surface_of_points(Mesh(torus(1500, noise))).mesh)
    assert health.closed
    assert health.genus == 1
    assert health.area == pytest.approx(4 * np.pi**2 * 0.4, rel=0.04)


def test_uneven_density() -> None:
    points = sphere(2000)
    dense = points[np.random.default_rng(1).random(2000) < np.where(points[:, 2] > 0, 1, 0.25)]
    health = diagnose(surface_of_points(Mesh(dense)).mesh)
    assert health.closed
    assert health.genus == 0
    assert health.area == pytest.approx(4 * np.pi, rel=0.04)


def test_one_side_has_a_boundary_where_the_points_end() -> None:
    points = sphere(1500)
    health = diagnose(surface_of_points(Mesh(points[points[:, 2] > 0])).mesh)
    assert health.boundary_loops == 1
    assert health.genus == 0
    assert health.area == pytest.approx(2 * np.pi, rel=0.1)


def test_a_large_hole_stays_open_and_a_small_gap_is_closed() -> None:
    points = sphere(1500)
    for height, loops in ((0.9, 1), (0.992, 0)):
        rest = points[points[:, 2] < height]
        assert len(rest) < 1500
        assert diagnose(surface_of_points(Mesh(rest)).mesh).boundary_loops == loops


def test_many_noisy_points_become_a_smooth_surface_of_fewer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(_surface, "_MOST_POINTS", 1600)
    health = diagnose(mesh := surface_of_points(Mesh(sphere(4000, 0.027))).mesh)
    assert health.closed
    assert health.genus == 0
    assert mesh.n_vertices < 2000
    assert health.area == pytest.approx(4 * np.pi, rel=0.04)
    assert np.linalg.norm(mesh.vertices, axis=1).std() < 0.02


def test_a_long_rod() -> None:
    health = diagnose(surface_of_points(Mesh(sphere(1000) * [1, 1, 20])).mesh)
    assert health.closed
    assert health.genus == 0
    assert health.area == pytest.approx(np.pi**2 * 20, rel=0.04)


def test_outliers_are_left_out() -> None:
    n = 1500
    stray = np.random.default_rng(2).uniform(-2, 2, (40, 3))
    stray = stray[np.abs(np.linalg.norm(stray, axis=1) - 1) > 0.5]
    found = surface_of_points(Mesh(np.vstack([sphere(n), stray])))
    assert diagnose(found.mesh).area == pytest.approx(4 * np.pi, rel=0.04)
    assert (found.vertex_of_point[:n] >= 0).all()
    assert (found.vertex_of_point[n:] == -1).all()
    assert (found.point_of_vertex < n).all()


@pytest.mark.parametrize("spacings", [2.5, 0.7])
def test_parts_that_nearly_touch_are_not_joined(spacings: float) -> None:
    """Two balls of 700 points, and how far apart they are, in distances between points."""
    gap = spacings * np.sqrt(4 * np.pi / 700)
    other = sphere(690) + np.array([2 + gap, 0, 0])
    found = surface_of_points(Mesh(np.vstack([sphere(700), other])))
    health = diagnose(found.mesh)
    assert health.genus == 0
    assert health.area == pytest.approx(4 * np.pi, rel=0.04)


def test_a_ring_whose_ends_touch_is_cut() -> None:
    """A torus that was cut through, and whose ends are 0.3 distances between points apart."""
    points = torus(6000)
    spacing = np.sqrt(4 * np.pi**2 * 0.4 / len(points))
    chance = np.random.default_rng(6)
    n = round(np.pi * 0.4**2 / spacing**2)
    radius, angle = 0.4 * np.sqrt(chance.random((2, n))), 2 * np.pi * chance.random((2, n))
    x, z = 1 + radius * np.cos(angle), radius * np.sin(angle)
    y = 0.3 / 2 * spacing * np.array([[-1], [1]])
    outside = (points[:, 0] < 0) | (np.abs(points[:, 1]) > y.max())
    ends = np.stack([x, np.broadcast_to(y, x.shape), z], axis=2).reshape(-1, 3)
    health = diagnose(surface_of_points(Mesh(np.vstack([points[outside], ends]))).mesh)
    assert health.n_components == 1
    assert health.genus == 0


def test_a_thin_ring_is_cut_and_its_ends_are_closed() -> None:
    health = diagnose(surface_of_points(Mesh(torus(1000, thick=0.1))).mesh)
    assert health.closed
    assert health.genus == 0
    assert health.area == pytest.approx(4 * np.pi**2 * 0.1, rel=0.04)


def test_the_surface_goes_along_with_the_points() -> None:
    """Turned, moved, scaled and in another order, they are the same points."""
    points = torus(1000, 0.015) * [1, 0.8, 1.2]
    one = surface_of_points(Mesh(points))
    order = np.random.default_rng(3).permutation(len(points))
    other = surface_of_points(Mesh(1e3 * points[order] @ TURN.T + [5e3, 0, 0]))
    back = (other.mesh.vertices - [5e3, 0, 0]) @ TURN / 1e3
    for here, there in ((one.mesh.vertices, back), (back, one.mesh.vertices)):
        assert cKDTree(here).query(there)[0].max() < 0.12  # the spacing of points
    places = one.mesh.vertices[one.vertex_of_point[order]]
    apart = np.linalg.norm(places - back[other.vertex_of_point], axis=1)
    assert apart.mean() < 0.02


def test_each_point_knows_the_nearest_vertex_and_back() -> None:
    points = sphere(1000)
    found = surface_of_points(Mesh(points, name="ball"))
    assert found.mesh.name == "ball"
    to_vertex = cKDTree(found.mesh.vertices).query(points)[0]
    apart = np.linalg.norm(points - found.mesh.vertices[found.vertex_of_point], axis=1)
    np.testing.assert_allclose(apart, to_vertex, atol=1e-12)
    to_point = cKDTree(points).query(found.mesh.vertices)[0]
    apart = np.linalg.norm(points[found.point_of_vertex] - found.mesh.vertices, axis=1)
    np.testing.assert_allclose(apart, to_point, atol=1e-12)


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        (sphere(499), "cloud: 499 points at different positions are too few for a surface"),
        (np.repeat(sphere(300), 4, axis=0), "cloud: 300 points at different positions are too few"),
        (np.random.default_rng(4).standard_normal((3000, 3)), "its points fill a volume, or"),
        (np.random.default_rng(4).random((6000, 3)) * [1, 0.3, 2], "its points fill a volume, or"),
        (np.outer(np.arange(6000.0), [1, 2, 3]), "too long and thin to find the surface"),
        (np.random.default_rng(5).random((3000, 3)) * [1, 1, 0], "its points lie in a plane"),
        (helix(3), "or lie along lines"),  # no piece of surface is left
        (helix(6), "or lie along lines"),  # a small one is
    ],
    ids=["few", "repeated", "volume", "box", "line", "plane", "helix", "dense helix"],
)
def test_points_without_a_surface_are_refused(points: FloatArray, sentence: str) -> None:
    with pytest.raises(MeshError, match=sentence):
        surface_of_points(Mesh(points, name="cloud"))


def test_triangles_join_all_points_but_outliers() -> None:
    points = np.vstack([sphere(1000), [[3, 0, 0]]])
    drawn = triangulate_points(Mesh(points))
    np.testing.assert_array_equal(drawn.vertices, points)
    np.testing.assert_array_equal(np.unique(drawn.faces), np.arange(1000))
    corners = points[drawn.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    areas = np.linalg.norm(normals, axis=1)
    outward = (normals * corners.mean(axis=1)).sum(axis=1) > 0
    assert areas.sum() == pytest.approx(4 * np.pi, rel=0.05)
    assert areas[outward].sum() > 0.98 * areas.sum()


def test_points_too_close_to_be_corners_of_the_surface_split_its_triangles() -> None:
    points = np.repeat(sphere(1000), 2, axis=0)
    points[1::2] += 1e-5 * sphere(1000)[::-1]
    drawn = triangulate_points(Mesh(points))
    np.testing.assert_array_equal(np.unique(drawn.faces), np.arange(2000))
    areas = np.linalg.norm(face_normals(points, drawn.faces), axis=1) / 2
    assert areas.sum() == pytest.approx(4 * np.pi, rel=0.05)


def test_a_cloud_that_is_asked_for_again_is_not_computed_again() -> None:
    cloud = Mesh(sphere(600))
    found = surface_of_points(cloud)
    assert surface_of_points(cloud) is found
    again = surface_of_points(cloud.vertices)  # anything that is a mesh will do
    np.testing.assert_array_equal(again.mesh.faces, found.mesh.faces)


def test_nobody_changes_what_others_get() -> None:
    found = surface_of_points(Mesh(sphere(600)))
    for array in (found.vertex_of_point, found.point_of_vertex):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
