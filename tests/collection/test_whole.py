"""One surface of whatever a mesh holds: closed, joined, refined, and linked where it is apart."""

import numpy as np
import pytest
import scipy.sparse as sp

from sheets import make_sheet
from unbend import Mesh
from unbend.collection import _whole
from unbend.collection._whole import face_areas, whole_surface
from unbend.errors import MeshError
from unbend.mesh import find_edges


def links_of(points: np.ndarray, joined: int) -> np.ndarray:
    """Weights of links among points of which the first so many are one piece, others alone."""
    n = len(points)
    chain = sp.diags_array(np.arange(n - 1) < joined - 1, offsets=1, shape=(n, n), dtype=float)
    found = _whole._links(points, sp.csr_array(chain + chain.T)).toarray()
    np.testing.assert_allclose(found.sum(axis=1), 0, atol=1e-12)
    return np.diag(np.diag(found)) - found


@pytest.mark.parametrize("unit", [1e200, 1e-200])
def test_no_unit_is_too_large_or_too_small(unit: float) -> None:
    sheet = make_sheet(8)
    one, other = (whole_surface(Mesh(k * sheet.vertices, sheet.faces)) for k in (1, unit))
    np.testing.assert_allclose(other.areas, one.areas)
    np.testing.assert_allclose(other.points, one.points, atol=1e-12)


def test_what_is_in_use_lies_about_its_middle_and_has_the_area_of_one() -> None:
    points = [[9.0, 9, 9], [1, 2, 3], [4, 2, 3], [1, 8, 3]]
    found, faces = _whole._at_unit_area(np.array(points), np.array([[1, 2, 3]]))
    np.testing.assert_allclose(found * 3, [[-1, -2, 0], [2, -2, 0], [-1, 4, 0]])
    np.testing.assert_array_equal(faces, [[0, 1, 2]])


def test_three_points_are_no_shape() -> None:
    points = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    assert len(whole_surface(Mesh(points)).points) == 4
    with pytest.raises(MeshError, match="at least 4 points"):
        whole_surface(Mesh(points[[0, 1, 2, 2]]))


def test_two_sheets_are_one_along_their_seam() -> None:
    sheet = make_sheet(5)
    beside = sheet.vertices * [-1, 1, 1] - [1e-3, 0, 0]
    faces = np.concatenate([sheet.faces, sheet.faces[:, ::-1] + sheet.n_vertices])
    vertices = np.concatenate([sheet.vertices, beside])
    found, joined = _whole._stitched(*_whole._at_unit_area(vertices, faces))
    assert len(found) == 2 * 25 - 5
    assert (find_edges(joined, len(found)).n_faces == 1).sum() == 2 * 16 - 2 * 4


def test_a_slit_without_area_is_closed_without_faces() -> None:
    """One side of it has a vertex more: a fan around its middle would have no area."""
    points = np.array([[0.0, 0, 0], [2, 0, 0], [1, 0, 0], [1, 1, 0], [1, -1, 0], [1, 0, 3]])
    above, below = [[0, 1, 3]], [[0, 4, 2], [2, 4, 1]]
    sides = [[0, 3, 5], [3, 1, 5], [4, 0, 5], [1, 4, 5]]
    vertices, faces = _whole._closed(points, np.array(above + below + sides))
    assert len(faces) == 7
    assert (face_areas(vertices, faces) > 0).all()


def test_pieces_are_linked_wherever_they_touch() -> None:
    line = np.stack([np.arange(20) / 20, np.zeros(20), np.zeros(20)], axis=1)
    both = np.concatenate([line, np.add(line, [0, 0.015, 0])])
    chain = sp.diags_array(np.ones(39), offsets=1, shape=(40, 40)).tolil()
    chain[19, 20] = 0
    found = -_whole._links(both, sp.csr_array(chain + chain.T)).toarray()
    np.testing.assert_allclose(found[:20, 20:], 0.5 * np.eye(20))
    # Farther apart, all that are equally near are linked.
    both[20:, 1] = 0.04
    found = -_whole._links(both, sp.csr_array(chain + chain.T)).toarray()
    np.testing.assert_allclose(found[:20, 20:], 0.5 * np.eye(20))
    # Of others, the eight nearest.
    both[20:, 1] = 0.04 + 1e-4 * np.arange(20)
    found = -_whole._links(both, sp.csr_array(chain + chain.T)).toarray()
    np.testing.assert_allclose(found[:20, 20:], 0.5 * np.diag(np.arange(20) < 8))


@pytest.mark.parametrize("joined", [1, 20])
def test_many_pieces_are_linked_to_what_is_nearest_to_each(joined: int) -> None:
    """On a line, ever farther apart: each is nearest to the one before."""
    head = np.arange(joined) * 1e-3
    places = np.append(head, head[-1] + np.cumsum(1 + np.arange(39) / 39))
    n = len(places)
    found = links_of(places[:, None] * [1.0, 0, 0], joined)
    expected = np.zeros((n, n))
    for i in range(joined, n):
        expected[i, i - 1] = expected[i - 1, i] = 0.5
    np.testing.assert_allclose(found, expected)
