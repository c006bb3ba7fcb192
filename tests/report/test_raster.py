"""Triangles to pixels."""

import numpy as np

from unbend.report.raster import rasterize


def test_parts_thinner_than_a_pixel_are_drawn_without_gaps():
    # A needle from a disc: its tip is a thousandth of a pixel wide.
    seen = np.array(
        [[0.0, -1, 0], [0, 1, 0], [-1, 0, 0], [9, 1e-4, 0], [0, 1e-4, 0], [0, -1e-4, 0]]
    )
    faces = np.array([[0, 1, 2], [4, 5, 3]])
    picture, extent = rasterize(seen, faces, np.full((6, 3), 0.7), (200, 60))
    across = np.linspace(extent[0], extent[1], picture.shape[1])
    covered = picture[..., 3].max(axis=0) > 0
    assert covered[(across > -0.9) & (across < 8.9)].all()
