"""How far forms are apart: nothing but their shape counts."""

import numpy as np
import pytest

from paper.forms import difference

POINTS = np.random.default_rng(0).normal(size=(50, 3))


def test_motions_and_reflections_do_not_count():
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    for rotation in (turn, -turn):
        rigid, scaled = difference(POINTS @ rotation + 7, POINTS)
        assert max(rigid, scaled) < 1e-12


def test_scale_counts_only_in_the_first():
    rigid, scaled = difference(1.5 * POINTS, POINTS)
    assert rigid == pytest.approx(0.5)
    assert scaled < 1e-12


def test_rows_that_are_not_finite_do_not_count():
    holed = POINTS.copy()
    holed[3] = np.nan
    assert difference(holed, POINTS)[0] < 1e-12
