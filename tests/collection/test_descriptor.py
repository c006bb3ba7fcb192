"""The descriptor sees the shape, however it is posed, sized, meshed, torn or put together."""

import numpy as np
import pytest
from scipy.linalg import logm
from scipy.sparse.csgraph import connected_components

from sheets import make_sheet, make_torus
from testshapes.damage import cut_discs
from testshapes.scanning import add_noise
from unbend import Mesh, read_mesh
from unbend.collection import descriptor
from unbend.collection._descriptor import Basis, describe, make_basis, wave_kernel
from unbend.collection._whole import whole_surface
from unbend.datasets import make_biped, make_octopus, make_quadruped
from unbend.errors import MeshError, SolverError, UnbendWarning


@pytest.fixture(scope="module")
def person() -> Mesh:
    return make_biped("standing", n_vertices=800).mesh


@pytest.fixture(scope="module")
def apart(person):
    """How far from a person something is, where an ape is 1 away."""
    own = descriptor(person)
    ape = descriptor(make_biped("standing", n_vertices=800, species="ape").mesh)
    unit = np.linalg.norm(ape - own)
    return lambda mesh: float(np.linalg.norm(descriptor(mesh) - own) / unit)


def two(mesh: Mesh, vertices, faces) -> Mesh:
    """A mesh with more vertices and faces behind its own."""
    return Mesh(
        np.concatenate([mesh.vertices, vertices]),
        np.concatenate([mesh.faces, np.asarray(faces) + mesh.n_vertices]),
    )


def box() -> Mesh:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3.0)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Mesh(corners, [one for a, b, c, d in sides for one in ((a, b, c), (a, c, d))])


def cut_off(mesh: Mesh) -> Mesh:
    height = mesh.vertices[mesh.faces].mean(axis=1)[:, 1]
    return Mesh(mesh.vertices, mesh.faces[height < np.quantile(height, 0.7)])


def with_copy(mesh: Mesh, *offset: float) -> Mesh:
    return two(mesh, np.add(mesh.vertices, offset), mesh.faces)


OF_OUR_OWN = {
    "biped": lambda: make_biped("sitting", n_vertices=800).mesh,
    "octopus": lambda: make_octopus(n_vertices=800).mesh,
    "open": lambda: cut_off(make_biped("standing", n_vertices=800).mesh),
    "two bodies": lambda: with_copy(make_biped("standing", n_vertices=800).mesh, 3, 0.2, 0),
    "two plates": lambda: with_copy(make_sheet(9), 0, 0, 0.5),
    "box": box,
    "torus": lambda: make_torus(40, 16),
}


def variants(mesh: Mesh) -> dict[str, Mesh]:
    """The same surface with its faces and vertices reordered, or moved and scaled."""
    chance = np.random.default_rng(0)
    some = chance.random(mesh.n_faces) < 0.5
    first = (np.arange(3) + chance.integers(3, size=(mesh.n_faces, 1))) % 3
    order = chance.permutation(mesh.n_vertices)
    turn = np.linalg.qr(chance.normal(size=(3, 3)))[0]
    return {
        "all faces rewound": Mesh(mesh.vertices, mesh.faces[:, ::-1]),
        "half of the faces rewound": Mesh(
            mesh.vertices, np.where(some[:, None], mesh.faces[:, ::-1], mesh.faces)
        ),
        "faces from another corner": Mesh(
            mesh.vertices, np.take_along_axis(mesh.faces, first, axis=1)
        ),
        "faces permuted": Mesh(mesh.vertices, chance.permutation(mesh.faces)),
        "vertices permuted": Mesh(mesh.vertices[order], np.argsort(order)[mesh.faces]),
        "moved": Mesh(37 * mesh.vertices @ turn.T + 5, mesh.faces),
    }


def check_order(mesh: Mesh) -> None:
    other = mesh
    for what in variants(mesh):  # all of them, one after the other
        other = variants(other)[what]
    own = descriptor(mesh)
    assert np.abs(descriptor(other) - own).max() < 1e-6 * np.abs(own).max()


@pytest.mark.parametrize("name", OF_OUR_OWN)
def test_the_order_of_vertices_and_corners_changes_nothing(name):
    check_order(OF_OUR_OWN[name]())


def test_the_order_changes_nothing_on_a_real_shape(real_data):
    check_order(read_mesh(real_data / "tosca_remeshed" / "cat0.off"))


def test_poses_and_meshings_change_little(apart):
    assert apart(make_biped("sitting", n_vertices=800).mesh) < 0.3
    assert apart(make_biped("running", n_vertices=1000, meshing=2).mesh) < 0.3
    assert apart(make_quadruped("standing", n_vertices=800).mesh) > 1
    assert apart(make_octopus(n_vertices=800).mesh) > 1


def test_damage_changes_little(person, apart):
    assert apart(cut_discs(person, 0.04, 4, random_state=0).mesh) < 0.3
    assert apart(add_noise(person, 0.15, random_state=0).mesh) < 0.3


def test_seams_repeated_faces_and_loose_vertices_change_nothing(person, apart):
    soup = Mesh(
        person.vertices[person.faces].reshape(-1, 3), np.arange(3 * person.n_faces).reshape(-1, 3)
    )
    assert apart(soup) < 1e-2
    assert apart(two(person, person.vertices, person.faces[:, ::-1])) < 1e-2
    assert apart(two(person, [[9.0, 9, 9]], np.empty((0, 3), int))) < 1e-2


def test_dust_changes_nothing(person, apart):
    chance = np.random.default_rng(0)
    places = chance.normal(size=(100, 1, 3)) + 0.002 * chance.normal(size=(100, 3, 3))
    assert apart(two(person, places.reshape(-1, 3), np.arange(300).reshape(-1, 3))) < 1e-2


def test_all_large_pieces_count(person, apart):
    beside = two(person, np.add(person.vertices, [0.9, 0, 0]), person.faces)
    assert apart(beside) > 0.5


def test_a_surface_is_joined_where_it_was_cut_apart(person, apart):
    # The upper half's rim is a copy of the lower half's, a little above it.
    upper = person.vertices[person.faces].mean(axis=1)[:, 1] > np.median(person.vertices[:, 1])
    faces = person.faces.copy()
    faces[upper] += person.n_vertices
    lifted = np.add(person.vertices, [0, 1e-3, 0])
    assert apart(Mesh(np.concatenate([person.vertices, lifted]), faces)) < 0.05


def test_a_thousand_pieces_are_one_surface(person):
    # Every face is a piece of its own, a little smaller than it was.
    corners = person.vertices[person.faces]
    apart = corners + 0.1 * (corners.mean(axis=1, keepdims=True) - corners)
    faces = np.arange(3 * person.n_faces).reshape(-1, 3)
    found = whole_surface(Mesh(apart.reshape(-1, 3), faces))
    count, _ = connected_components(found.stiffness, directed=False)
    assert count == 1
    assert found.areas.sum() == pytest.approx(1)


def test_pieces_far_apart_are_linked(person):
    far = two(person, np.add(person.vertices, 100), person.faces)
    assert connected_components(whole_surface(far).stiffness, directed=False)[0] == 1


def test_spikes_are_not_cut_into_too_many_pieces(person):
    spikes = np.random.default_rng(0).normal(size=(30, 1, 3))
    spikes = spikes + np.array([[0, 0, 0], [0, 1e3, 0], [0, 1e3, 1e-4]])
    spiky = two(person, spikes.reshape(-1, 3), np.arange(90).reshape(-1, 3))
    with pytest.warns(UnbendWarning, match="too thin"):
        assert len(whole_surface(spiky).points) <= 20_000


def test_a_few_large_triangles_are_a_box_like_any_other():
    one = box()
    # The other diagonal of each side.
    other = [
        corners
        for (a, b, c), (_, _, d) in zip(one.faces[::2], one.faces[1::2], strict=True)
        for corners in ((a, b, d), (b, c, d))
    ]
    first, second = descriptor(one), descriptor(Mesh(one.vertices, other))
    cube = descriptor(Mesh(one.vertices / [1, 2, 3], one.faces))
    assert np.linalg.norm(first - second) < 0.1 * np.linalg.norm(first - cube)


@pytest.mark.parametrize("faces", [[[0, 1, 2]], [[0, 1, 2], [0, 1, 2]], [[0, 1, 3], [4, 5, 6]]])
def test_sheets_and_scraps_are_described(faces):
    points = np.random.default_rng(0).normal(size=(7, 3))
    found = descriptor(Mesh(points, faces))
    assert found.dtype == np.float32
    assert np.isfinite(found).all()


def test_point_clouds_are_described(person):
    found = descriptor(Mesh(person.vertices))
    assert found.shape == descriptor(person).shape
    assert np.isfinite(found).all()


def test_what_has_no_area_is_refused():
    with pytest.raises(MeshError, match="degenerate"):
        descriptor(Mesh(np.arange(3)[:, None] * np.ones(3), [[0, 1, 2]]))


@pytest.mark.parametrize(
    "spoil",
    [
        lambda values: values * 1.01,
        lambda values: values * np.nan,
        lambda values: values * np.append(1.001, np.ones(values.shape[1] - 1)),
    ],
)
def test_heat_that_is_lost_is_an_error(person, spoil):
    basis = make_basis(person)
    with pytest.raises(SolverError, match="signatures are off by"):
        describe(basis._replace(functions=spoil(basis.functions)))


def test_waves_share_what_is_near_in_the_logarithm():
    # Logarithms of the eigenvalues are 0 and 1; at the first, their shares are as 1 to exp(-2).
    basis = Basis(np.array([0, 1, np.e]), np.array([[1.0, 2, 0], [1, 0, 2]]), np.full(2, 0.5))
    found = wave_kernel(basis, np.zeros(1), 0.5)
    np.testing.assert_allclose(found[:, 0], 4 / (1 + np.exp([-2, 2])))


def test_where_all_points_are_alike_only_the_times_tell():
    value = 4 * np.pi
    found = describe(Basis(np.array([0, value]), np.array([[1.0, 1], [1, -1]]), np.full(2, 0.5)))
    times = 2e-3 * 150 ** (np.arange(8) / 7)
    heat = np.repeat(np.log(1 + np.exp(-value * times)), 16) / np.sqrt(8 * 16)
    waves = np.eye(12)[np.triu_indices(12)] * np.log(1e-3) / np.sqrt(12 * 13 / 2)
    np.testing.assert_allclose(found, np.append(heat, waves), atol=1e-6)


def test_it_is_what_its_version_says():
    """Stored numbers are compared with new ones, so that none may change unsaid."""
    chance = np.random.default_rng(0)
    areas = np.array([1, 2, 3, 4, 5, 6, 7]) / 28
    turn = np.linalg.qr(np.column_stack([np.sqrt(areas), chance.normal(size=(7, 6))]))[0]
    values = 4 * np.pi * np.array([0, 1, 2, 4, 10, 30, 70])
    squares = turn**2 / areas[:, None]
    times = np.geomspace(0.002, 0.3, 8)
    heat = np.log([[row @ np.exp(-values * t) for t in times] for row in squares])
    waves = []
    for energy in np.geomspace(4 * np.pi * 0.8, 4 * np.pi * 80, 12):
        shares = np.exp(-(np.log(values[1:] / energy) ** 2) / (2 * 0.7**2))
        waves.append(np.log(squares[:, 1:] @ shares / shares.sum() + 1e-6))
    middles = [(i + 0.5) / 16 for i in range(16)]
    levels = []
    for column in heat.T:
        order = np.argsort(column)
        ends = np.cumsum(areas[order])
        levels.append(np.interp(middles, ends - areas[order] / 2, column[order]))
    covariance = np.cov(waves, aweights=areas, bias=True)
    logarithm = logm(covariance + 1e-3 * np.eye(12)).real
    rows, columns = np.triu_indices(12)
    flat = logarithm[rows, columns] * np.where(rows < columns, np.sqrt(2), 1)
    expected = np.append(np.ravel(levels) / np.sqrt(128), flat / np.sqrt(78))
    found = describe(Basis(values, turn / np.sqrt(areas)[:, None], areas))
    np.testing.assert_allclose(found, expected, atol=1e-5)
