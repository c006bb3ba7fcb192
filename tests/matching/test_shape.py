"""What the matcher knows of a surface: truths that its definition gives."""

from dataclasses import replace

import numpy as np
import pytest

from sheets import make_sheet
from unbend import Mesh
from unbend.datasets import make_quadruped, make_sphere
from unbend.matching import _constants as constants
from unbend.matching._inputs import prepare_shape
from unbend.matching._shape import (
    _SMALLEST_EIGENVALUE,
    Shape,
    make_proxy,
    make_shape,
)

pytestmark = pytest.mark.usefixtures("as_meshed")


def _shape(mesh: Mesh, n_eigenpairs: int = 40) -> Shape:
    return prepare_shape(mesh, n_eigenpairs)[1]


def _square(side: int) -> Shape:
    return prepare_shape(make_sheet(side), 10, partial=True).shape


def _area(shape: Shape) -> float:
    corners = shape.vertices[shape.faces]
    sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return float(np.linalg.norm(np.cross(*sides), axis=1).sum() / 2)


def _volume(shape: Shape) -> float:
    return float(np.linalg.det(shape.vertices[shape.faces]).sum() / 6)


def test_area_is_one_and_functions_are_orthonormal(blob: Mesh) -> None:
    shape = _shape(Mesh(7 * blob.vertices + 3, blob.faces))
    assert _area(shape) == pytest.approx(1)
    assert shape.areas.sum() == pytest.approx(1)
    np.testing.assert_allclose(shape.areas @ shape.vertices, 0, atol=1e-9)
    gram = shape.basis.T @ (shape.areas[:, None] * shape.basis)
    np.testing.assert_allclose(gram, np.eye(shape.k), atol=1e-6)
    np.testing.assert_allclose(shape.areas @ shape.basis, 0, atol=1e-6)


def test_positions_are_those_that_smooth_functions_come_closest_to(blob: Mesh) -> None:
    shape = _shape(Mesh(7 * blob.vertices + 3, blob.faces))
    off = shape.vertices - shape.basis @ shape.position_coefficients
    np.testing.assert_allclose(shape.basis.T @ (shape.areas[:, None] * off), 0, atol=1e-6)


def _sheet_and_eigenpairs(side: int) -> tuple[Mesh, np.ndarray, np.ndarray, np.ndarray]:
    """A flat square with areas, eigenvalues and functions that need not be its own."""
    sheet = make_sheet(side)
    chance = np.random.default_rng(0)
    areas, basis = chance.uniform(1, 2, side**2), chance.normal(size=(side**2, 4))
    return sheet, areas, np.array([0, _SMALLEST_EIGENVALUE / 9, 3, 5]), basis


def test_areas_and_faces_of_any_unit_and_type_are_taken() -> None:
    sheet, areas, values, basis = _sheet_and_eigenpairs(4)
    found = make_shape(5 * sheet.vertices, sheet.faces.astype(np.int32), areas, values, basis)
    np.testing.assert_allclose(found.areas, areas / areas.sum())
    np.testing.assert_allclose(found.areas @ found.vertices, 0, atol=1e-12)
    np.testing.assert_allclose(found.vertices - found.vertices[0], sheet.vertices, atol=1e-12)
    assert found.faces.dtype == np.int64
    np.testing.assert_array_equal(found.eigenvalues, [_SMALLEST_EIGENVALUE, 3, 5])
    np.testing.assert_array_equal(found.basis, basis[:, 1:])


def test_a_part_is_what_is_said_to_be_one_and_ends_along_a_rim_that_is_not_tiny() -> None:
    sheet, *pairs = _sheet_and_eigenpairs(9)
    assert make_shape(sheet.vertices, sheet.faces, *pairs, partial=True).partial
    assert not make_shape(sheet.vertices, sheet.faces, *pairs).partial
    ball = make_sphere(2)
    n = ball.n_vertices
    pairs = [np.ones(n), np.arange(4.0), np.ones((n, 4))]
    assert not make_shape(ball.vertices, ball.faces, *pairs, partial=True).partial
    # A hole of one face, which is drawn together to a tenth of the shortest rim, or is not.
    closing = np.ones((n, 1))
    middle = ball.vertices[ball.faces[0]].mean(axis=0)
    closing[ball.faces[0]] = constants.PATCH / 10
    tight = middle + (ball.vertices - middle) * closing
    for points, partial in ((ball.vertices, True), (tight, False)):
        assert make_shape(points, ball.faces[1:], *pairs, partial=True).partial == partial


def test_many_pinholes_are_no_place_where_a_part_was_cut_off() -> None:
    ball = make_sphere(4)
    used, pinholes = set[int](), []
    for i, corners in enumerate(ball.faces):
        if len(pinholes) < 30 and used.isdisjoint(corners):
            used.update(corners)
            pinholes.append(i)
    pairs = [np.ones(ball.n_vertices), np.arange(4.0), np.ones((ball.n_vertices, 4))]
    beside = int(np.flatnonzero(np.isin(ball.faces, ball.faces[0]).sum(axis=1) == 2)[0])
    for left_out, partial in ((pinholes, False), ([*pinholes, beside], True)):
        rest = np.delete(ball.faces, left_out, axis=0)
        assert make_shape(ball.vertices, rest, *pairs, partial=True).partial == partial


def test_a_square_ends_along_its_four_sides_if_it_is_a_part() -> None:
    side = 6
    part, whole = (prepare_shape(make_sheet(side), 10, partial=one).shape for one in (True, False))
    inside = (np.arange(side) % (side - 1) > 0).astype(int)
    outline = (np.outer(inside, inside) == 0).ravel()
    np.testing.assert_array_equal(part.on_boundary, outline)
    np.testing.assert_array_equal(part.conormals, part.conormals_in(part.vertices))
    assert not whole.on_boundary.any()
    assert whole.conormals.shape == part.conormals.shape
    assert not whole.conormals.any()
    assert part.boundary_length == pytest.approx(4)


def test_the_tip_of_a_slit_is_on_the_rim() -> None:
    side, sheet = 9, make_sheet(9)
    row = side // 2
    left = np.arange(row * side, row * side + row)  # the slit's vertices, of which there are two
    copies = np.arange(side**2, side**2 + row)
    faces = sheet.faces.copy()
    below = (faces // side).max(axis=1) > row
    for vertex, copy in zip(left, copies, strict=True):
        faces[below[:, None] & (faces == vertex)] = copy
    vertices = np.concatenate([sheet.vertices, sheet.vertices[left] + 1e-3])
    shape = prepare_shape(Mesh(vertices, faces), 10, partial=True).shape
    extremity = row * side + row
    assert shape.on_boundary[[*left, *copies, extremity]].all()
    assert not shape.on_boundary[extremity + 1 : extremity + row].any()


def test_lengths_and_ways_along_edges_of_a_square() -> None:
    side = 6
    sheet = make_sheet(side)
    shape = prepare_shape(sheet, 10).shape
    ends = np.concatenate([sheet.faces[:, [0, 1]], sheet.faces[:, [1, 2]], sheet.faces[:, [2, 0]]])
    ends = np.unique(np.sort(ends, axis=1), axis=0)
    long = np.linalg.norm(sheet.vertices[ends[:, 0]] - sheet.vertices[ends[:, 1]], axis=1)
    assert shape.edge == pytest.approx(long.mean())
    row, column = np.divmod(np.arange(side**2), side)
    down, right = row - row[:, None], column - column[:, None]
    # Every square has one diagonal, which leads down and to the left.
    slanted = np.where(down * right < 0, np.minimum(abs(down), abs(right)), 0)
    expected = abs(down) + abs(right) - (2 - np.sqrt(2)) * slanted
    np.testing.assert_allclose(shape.distances, expected / (side - 1), atol=1e-12)


def test_a_mirror_image_shares_what_does_not_depend_on_handedness(blob: Mesh) -> None:
    shape = _shape(blob)
    mirror = shape.reflected()
    fresh = Shape(mirror.vertices, mirror.faces, shape.areas, shape.eigenvalues, shape.basis)
    assert _volume(mirror) == pytest.approx(_volume(shape))
    np.testing.assert_allclose(mirror.normals, shape.normals * [-1, 1, 1], atol=1e-12)
    np.testing.assert_array_equal(mirror.samples, fresh.samples)
    np.testing.assert_allclose(mirror.stiffness.toarray(), fresh.stiffness.toarray(), atol=1e-9)
    np.testing.assert_allclose(
        mirror.position_coefficients, shape.position_coefficients * [-1, 1, 1], atol=1e-9
    )
    proxy = make_proxy(shape, 100).shape
    np.testing.assert_array_equal(
        proxy.reflected().position_coefficients, shape.position_coefficients * [-1, 1, 1]
    )
    part = _square(6)
    np.testing.assert_allclose(part.reflected().conormals, part.conormals * [-1, 1, 1], atol=1e-12)
    again = mirror.reflected()
    np.testing.assert_array_equal(again.vertices, shape.vertices)
    np.testing.assert_array_equal(again.faces, shape.faces)


def test_the_rim_of_a_square_leads_off_its_sides() -> None:
    sheet = make_sheet(5)
    conormals = _square(5).conormals_in(sheet.vertices)
    low, high = sheet.vertices.min(axis=0), sheet.vertices.max(axis=0)
    off = (sheet.vertices == high).astype(float) - (sheet.vertices == low)
    off[:, high == low] = 0
    one = np.abs(off).sum(axis=1) < 2  # within a side, or inside
    np.testing.assert_allclose(conormals[one], off[one], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(conormals[~one], axis=1), 1)


def test_a_rim_leads_off_across_the_line_through_its_neighbours() -> None:
    """As sides push by their lengths, each at a right angle; whatever lies within."""
    side = 6
    sheet = make_sheet(side)
    x, y, _ = sheet.vertices.T
    flat = np.stack([x + 0.3 * x * y + 0.1 * y**2, y + 0.2 * x**2, 0 * x], axis=1)
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    conormals = _square(side).conormals_in(flat @ turn.T + 5) @ turn
    grid = np.arange(side**2).reshape(side, side)
    around = np.concatenate([grid[:-1, 0], grid[-1, :-1], grid[:0:-1, -1], grid[0, :0:-1]])
    chords = flat[np.roll(around, -1)] - flat[np.roll(around, 1)]
    expected = np.stack([chords[:, 1], -chords[:, 0], 0 * chords[:, 0]], axis=1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(conormals[around], expected, atol=1e-9)
    assert np.abs(np.delete(conormals, around, axis=0)).max() == 0


def test_samples_spread_from_the_remotest_vertex() -> None:
    shape = _shape(make_quadruped("walking", n_vertices=2500).mesh, 10)
    size = np.linalg.norm(shape.vertices, axis=1)
    assert size[shape.samples[0]] == pytest.approx(size.max())
    assert len(np.unique(shape.samples)) == constants.SAMPLES


def test_what_goes_along_with_a_landmark_ends_halfway_to_the_next() -> None:
    sheet = _square(41)
    corner, middle, near = 0, 20 * 41 + 20, 20 * 41 + 28
    alone = replace(sheet, landmarks=np.array([middle])).landmark_surroundings[0]
    pair = replace(sheet, landmarks=np.array([middle, near, corner, corner])).landmark_surroundings
    far = abs(sheet.distances[middle] - constants.LIMB).argmin()
    assert alone[far] == pytest.approx(np.exp(-1), rel=0.1)
    assert alone[middle] == pair[0, middle] == pair[1, near] == 1
    # A fifth of the side apart; each is far from what the other draws. A corner is given twice.
    assert sheet.distances[middle, near] == pytest.approx(0.2)
    np.testing.assert_allclose(pair[[0, 1], [near, middle]], np.exp(-4))
    np.testing.assert_array_equal(pair[2], pair[3])
    assert np.isfinite(pair).all()


def test_a_proxy_has_the_whole_area_and_the_functions_of_the_shape() -> None:
    shape = _shape(make_quadruped("walking", n_vertices=900).mesh)
    proxy = make_proxy(replace(shape, landmarks=np.array([3, 600])), 500)
    coarse = proxy.shape
    assert len(coarse.vertices) == len(proxy.kept) == 500
    assert set(np.unique(coarse.faces)) == set(range(500))
    np.testing.assert_array_equal(coarse.vertices, shape.vertices[proxy.kept])
    np.testing.assert_array_equal(coarse.landmarks, proxy.parents[[3, 600]])
    np.testing.assert_array_equal(proxy.parents[proxy.kept], np.arange(500))
    # A vertex is near the one that stands for it.
    off = np.linalg.norm(coarse.vertices[proxy.parents] - shape.vertices, axis=1)
    assert off.max() < 3 * coarse.edge
    assert coarse.areas.sum() == pytest.approx(1)
    np.testing.assert_allclose(coarse.areas, np.bincount(proxy.parents, shape.areas))
    np.testing.assert_array_equal(coarse.basis, shape.basis[proxy.kept])
    gram = coarse.basis[:, :10].T @ (coarse.areas[:, None] * coarse.basis[:, :10])
    np.testing.assert_allclose(gram, np.eye(10), atol=0.1)
    np.testing.assert_array_equal(coarse.position_coefficients, shape.position_coefficients)


def test_a_small_shape_is_its_own_proxy(blob: Mesh) -> None:
    shape = _shape(blob)
    proxy = make_proxy(shape, 1000)
    np.testing.assert_array_equal(proxy.kept, np.arange(blob.n_vertices))
    np.testing.assert_array_equal(proxy.parents, proxy.kept)
    np.testing.assert_array_equal(proxy.shape.faces, shape.faces)
    np.testing.assert_allclose(proxy.shape.areas, shape.areas)
