"""Coarse copies: what they keep of a shape."""

from dataclasses import replace

import numpy as np
import pytest

from unbend import Mesh
from unbend.matching._inputs import prepare_shape
from unbend.matching._shape import Shape, make_proxy


@pytest.fixture(scope="module")
def shape(blob: Mesh) -> Shape:
    found = prepare_shape(blob, 40).shape
    return replace(found, landmarks=np.array([3, 600]))


def test_vertices_are_the_shape_s_own_and_areas_are_gathered(shape: Shape) -> None:
    coarse, kept, parents = make_proxy(shape, 200)
    assert len(kept) == len(coarse.areas) == 200
    np.testing.assert_array_equal(coarse.vertices, shape.vertices[kept])
    np.testing.assert_array_equal(coarse.basis, shape.basis[kept])
    np.testing.assert_array_equal(parents[kept], np.arange(200))
    gathered = [shape.areas[parents == i].sum() for i in range(200)]
    np.testing.assert_allclose(coarse.areas, gathered)
    assert set(np.unique(coarse.faces)) == set(range(200))
    # What stands for a vertex is near it.
    off = np.linalg.norm(coarse.vertices[parents] - shape.vertices, axis=1)
    assert off.max() < 3 * coarse.edge
    np.testing.assert_array_equal(coarse.landmarks, parents[[3, 600]])


def test_what_is_smooth_is_where_the_shape_has_it(shape: Shape) -> None:
    coarse, kept, _ = make_proxy(shape, 200)
    smooth = shape.basis @ shape.position_coefficients
    np.testing.assert_array_equal(coarse.basis @ coarse.position_coefficients, smooth[kept])


def test_there_are_no_more_vertices_than_the_shape_has(shape: Shape) -> None:
    n = len(shape.areas)
    coarse, kept, parents = make_proxy(shape, n + 1)
    np.testing.assert_array_equal(kept, np.arange(n))
    np.testing.assert_array_equal(parents, np.arange(n))
    np.testing.assert_array_equal(coarse.vertices, shape.vertices)
