"""Cotangents and areas of triangles against exact rational arithmetic."""

import math
from fractions import Fraction

import numpy as np
import pytest

from unbend import Mesh, laplacian
from unbend.datasets import make_sphere
from unbend.mesh import measure_corners

SMALL = 1e-8


def exact(triangle):
    """Dot products, squared edges and the square of twice the area, from the doubles given."""
    points = [[Fraction(float(x)) for x in point] for point in triangle]

    def minus(a, b):
        return [x - y for x, y in zip(a, b, strict=True)]

    def dot(a, b):
        return sum(x * y for x, y in zip(a, b, strict=True))

    a, b, c = points
    dots = [dot(minus(q, p), minus(r, p)) for p, q, r in ((a, b, c), (b, c, a), (c, a, b))]
    squared = [dot(minus(q, r), minus(q, r)) for q, r in ((b, c), (c, a), (a, b))]
    return dots, squared, squared[1] * squared[2] - dots[0] ** 2


def root(fraction):
    """Square root of a positive fraction, to more digits than a double has."""
    scale = 10**80
    return Fraction(math.isqrt(fraction.numerator * scale // fraction.denominator), 10**40)


def exact_corners(triangle):
    """Cotangents, and mixed Voronoi areas (Meyer et al. 2003)."""
    dots, squared, double_area_squared = exact(triangle)
    double_area = root(double_area_squared)
    cotangents = [d / double_area for d in dots]
    if min(dots) < 0:
        areas = [double_area / (4 if d < 0 else 8) for d in dots]
    else:
        shares = [s * c for s, c in zip(squared, cotangents, strict=True)]
        areas = [(shares[i - 1] + shares[i - 2]) / 8 for i in range(3)]
    return np.array(cotangents, dtype=float), np.array(areas, dtype=float)


def needles():
    """Triangles with one short edge, its corners of any order, place and direction."""
    rng = np.random.default_rng(0)
    shapes = [[0.5, 0.5], [0, 1], [1, 0], [0.2, 0.8], [3, -2], [-30, 31], [0.5, 0.5 + 1e-3]]
    for base in shapes:  # where the tip stands over the base, in lengths of the base
        for _ in range(6):
            turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
            points = np.array([[0, 0, 0], [SMALL, 0, 0], [base[0] * SMALL, 1, 0]])
            points = points[rng.permutation(3)] * 10.0 ** rng.integers(-3, 4)
            yield points @ turn.T + rng.standard_normal(3) * rng.integers(0, 2)


@pytest.mark.parametrize("triangle", list(needles()))
def test_needles(triangle):
    """A corner of the short edge turns by the rounding of the far end; the tip hardly does."""
    dots, squared, double_areas = measure_corners(triangle, np.array([[0, 1, 2]]))
    expected, areas = exact_corners(triangle)
    found = dots[0] / double_areas[0]
    sharp = np.abs(expected).argmax()
    assert found[sharp] == pytest.approx(expected[sharp], rel=1e-13)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=2e-15)
    assert double_areas[0] == pytest.approx(2 * areas.sum(), rel=1e-13)
    np.testing.assert_allclose(squared[0], np.array(exact(triangle)[1], dtype=float), rtol=1e-14)


@pytest.mark.parametrize("triangle", list(needles()))
def test_the_laplacian_of_a_needle(triangle):
    found = laplacian(Mesh(triangle, [[0, 1, 2]]), laplacian="cotangent")
    cotangents, areas = exact_corners(triangle)
    weights = found.stiffness.toarray()[[1, 2, 0], [2, 0, 1]]
    np.testing.assert_allclose(weights, -cotangents / 2, rtol=1e-13, atol=2e-15)
    assert found.areas.sum() == pytest.approx(areas.sum(), rel=1e-13)
    np.testing.assert_allclose(found.areas, areas, rtol=1e-7)


@pytest.mark.parametrize("height", [1e-4, 1e-8])
def test_caps(height):
    """Their height is lost in the rounding of coordinates, and nothing more."""
    rng = np.random.default_rng(1)
    for along in (0.5, 0.2, 0.9):
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        triangle = np.array([[0, 0, 0], [1, 0, 0], [along, height, 0]]) @ turn
        dots, _, double_areas = measure_corners(triangle, np.array([[0, 1, 2]]))
        expected, _ = exact_corners(triangle)
        np.testing.assert_allclose(dots[0] / double_areas, expected, rtol=1e-15 / height)


@pytest.mark.parametrize("length", [1e5, 1e7, 1e9, 1e12])
def test_areas_of_a_stretched_sphere(length):
    """All of its area is shared out, and in proportion to the length."""
    sphere = make_sphere(2)
    areas = [
        laplacian((sphere.vertices * [1, 1, long], sphere.faces), laplacian="cotangent").areas.sum()
        for long in (length, 10 * length)
    ]
    assert areas[1] == pytest.approx(10 * areas[0], rel=1e-9)
