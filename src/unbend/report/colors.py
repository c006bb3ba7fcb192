"""Colours of places on a shape, which colour-blind readers distinguish too."""

from __future__ import annotations

from typing import Any

import numpy as np

from unbend._arrays import numbers_of
from unbend._types import FloatArray
from unbend.errors import InputError

# From OKLab to cone responses, whose cubes become linear red, green and blue.
_LAB_TO_LMS = np.array([
    [1, 0.3963377774, 0.2158037573],
    [1, -0.1055613458, -0.0638541728],
    [1, -0.0894841775, -1.2914855480],
])  # fmt: skip
_LMS_TO_RGB = np.array([
    [4.0767416621, -3.3077115913, 0.2309699292],
    [-1.2684380046, 2.6097574011, -0.3413193965],
    [-0.0041960863, -0.7034186147, 1.7076147010],
])  # fmt: skip


def position_colors(vertices: Any) -> FloatArray:
    """Give each point a colour that changes smoothly over the shape and tells parts apart.

    Along the longest side of the bounding box colours go from dark purple to light yellow, which
    colour-blind readers distinguish too; along the middle side they get lighter, along the shortest
    side their hue changes. Interactive pages have the same colours.

    Parameters
    ----------
    vertices : (n, 3) array_like of float
        Positions; rows that are not finite become grey.

    Returns
    -------
    colors : (n, 3) ndarray of float64
        Red, green and blue from 0 to 1.

    Raises
    ------
    InputError
        If they are not rows of three numbers.

    References
    ----------
    Ottosson (2020), A perceptual color space for image processing (OKLab).

    Examples
    --------
    >>> from unbend.report import position_colors
    >>> position_colors([[0, 0, 0], [1, 2, 4]]).round(2).tolist()
    [[0.39, 0.32, 0.68], [0.82, 0.92, 0.47]]
    """
    vertices = numbers_of(vertices, "vertices")
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise InputError(f"vertices must have shape (n, 3), not {vertices.shape}")
    finite = np.isfinite(vertices).all(axis=1)
    colors = np.full(vertices.shape, 0.6)
    if finite.any():
        x, y, z = places_in_box(vertices[finite]).T
        # The same as ofPlace in pages/shaders.js.
        hue = np.deg2rad(325 - 240 * x + 70 * (z - 0.5))
        light = 0.6 + 0.2 * x + 0.2 * (y - 0.5)
        lab = np.stack([light, 0.145 * np.cos(hue), 0.145 * np.sin(hue)], axis=1)
        linear = (lab @ _LAB_TO_LMS.T) ** 3 @ _LMS_TO_RGB.T
        colors[finite] = np.clip(linear, 0, 1) ** (1 / 2.2)
    return colors


def places_in_box(points: FloatArray) -> FloatArray:
    """Places (n, 3) in the box around finite points, 0 to 1, along its longest side first."""
    sides = np.ptp(points, axis=0)
    shares = (points - points.min(axis=0)) / np.maximum(sides, 1e-300)
    return np.asarray(shares[:, np.argsort(-sides, kind="stable")])
