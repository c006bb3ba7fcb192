"""From meshes to the matcher's arrays and back, however many are prepared at once."""

import numpy as np
import pytest

from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.errors import InputError, UnbendWarning
from unbend.matching import _inputs
from unbend.matching._inputs import prepare_shape, prepare_shapes


def test_only_small_meshes_are_prepared_side_by_side_and_all_with_one_result(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ball = make_sphere(2)
    egg = Mesh(ball.vertices * [1, 1.2, 1.5], ball.faces[1:])  # with a hole
    monkeypatch.setattr(_inputs, "_SIDE_BY_SIDE", 2 * 162)
    expected = prepare_shapes([egg, egg], 10, False, [False, True])
    monkeypatch.setattr(_inputs, "_SIDE_BY_SIDE", 2 * 162 - 1)
    monkeypatch.setattr(_inputs, "run_all", None)
    found = prepare_shapes([egg, egg], 10, False, [False, True])
    assert [one.shape.partial for one in found] == [False, True]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.shape.vertices, other.shape.vertices)
        np.testing.assert_array_equal(one.shape.eigenvalues, other.shape.eigenvalues)


def test_every_vertex_in_use_has_one_that_stands_for_it() -> None:
    """A small ball before a large one, and a vertex of no face between them."""
    small, large = make_sphere(0), make_sphere(1)
    mesh = Mesh(
        np.concatenate([small.vertices * 0.1 + [1.3, 0, 0], [[9, 9, 9]], large.vertices]),
        np.concatenate([small.faces, large.faces + 13]),
        name="both",
    )
    with pytest.warns(UnbendWarning, match="42 of 55 vertices; 1 smaller component goes along"):
        found = prepare_shape(mesh, 10, False)
    np.testing.assert_array_equal(found.kept, np.arange(13, 55))
    np.testing.assert_array_equal(found.local(found.kept), np.arange(42))
    nearest = np.linalg.norm(mesh.vertices[:12, None] - large.vertices, axis=2).argmin(axis=1)
    np.testing.assert_array_equal(found.local(np.arange(12)), nearest)
    with pytest.raises(InputError, match="both: no face uses vertex 12; name another"):
        found.local([0, 12])
    np.testing.assert_array_equal(found.own_faces, len(small.faces) + np.arange(80))
    apart = np.linalg.norm(np.diff(found.shape.vertices, axis=0), axis=1)
    before = np.linalg.norm(np.diff(large.vertices, axis=0), axis=1)
    np.testing.assert_allclose(apart / before, apart[0] / before[0])
