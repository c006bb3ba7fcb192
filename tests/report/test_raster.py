"""Triangles to pixels."""

import io

import matplotlib.image
import numpy as np
import pytest

from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.errors import InputError
from unbend.report.raster import rasterize, thumbnail


@pytest.mark.kernels
def test_parts_thinner_than_a_pixel_are_drawn_without_gaps():
    # A needle from a disc: its tip is a thousandth of a pixel wide.
    seen = np.array(
        [[0.0, -1, 0], [0, 1, 0], [-1, 0, 0], [9, 1e-4, 0], [0, 1e-4, 0], [0, -1e-4, 0]]
    )
    faces = np.array([[0, 1, 2], [4, 5, 3]])
    picture, extent = rasterize(seen, faces, np.full((6, 3), 0.7), (90, 30))
    across = np.linspace(extent[0], extent[1], picture.shape[1])
    covered = picture[..., 3].max(axis=0) > 0
    assert covered[(across > -0.9) & (across < 8.9)].all()


def test_rounding_does_not_change_the_size_of_a_picture():
    # 102 pixels with 2 % of margin: the square is 100 pixels wide, give or take the last bit.
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    sizes = {
        rasterize(square * scale, faces, np.ones((4, 3)), (102, 102))[0].shape
        for scale in np.linspace(0.9, 1.1, 101)
    }
    assert sizes == {(102, 102, 4)}


def test_outlines_move_outward_by_pixels_in_every_direction():
    ball = make_sphere(3)
    plain, thick = (
        rasterize(ball.vertices, ball.faces, np.ones((642, 3)), (100, 100), thicker=thicker)
        for thicker in (0.0, 5.0)
    )
    radii = []
    for picture, extent in (plain, thick):
        pixel = (extent[1] - extent[0]) / picture.shape[1]
        covered = picture[..., 3].sum() * pixel**2
        radii.append((np.sqrt(covered / np.pi), pixel))
    assert abs(radii[0][0] - 1) < 0.02
    assert abs(radii[1][0] - (1 + 5 * radii[1][1])) < 0.02


def test_a_point_cloud_has_no_picture() -> None:
    assert thumbnail(Mesh(make_sphere(2).vertices), 96) == b""


def test_colours_up_to_255_are_refused() -> None:
    ball = make_sphere(2)
    with pytest.raises(InputError, match="colors must be from 0 to 1: divide"):
        thumbnail(ball, 96, np.full((162, 3), 128))


def test_a_surface_is_seen_before_nothing() -> None:
    picture = matplotlib.image.imread(io.BytesIO(thumbnail(make_sphere(3), 96)))
    red, green, blue, solid = picture.transpose(2, 0, 1)
    assert solid.shape[0] == solid.shape[1]
    assert (solid[0, 0], solid[len(solid) // 2, len(solid) // 2]) == (0, 1)
    shown = solid == 1
    assert 0.05 < red[shown].min() < 0.8 * red[shown].max()  # with light and shade
    assert max(one[shown].max() for one in (red, green, blue)) <= 1
