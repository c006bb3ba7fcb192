"""ICP from eight starts: residuals fall, and the page says which end is right."""

import numpy as np
import pytest

from paper.figure3 import descend, figure3


def test_every_start_goes_down_and_one_ends_right(run):
    found = descend(run.shapes, run.store, "dog0", "dog1")
    for curve in found["residuals"]:
        steps = curve[np.isfinite(curve)]
        assert (np.diff(steps) <= 1e-6 * steps[0]).all()
    for rotation in found["rotations"]:
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert found["least error"] <= found["errors"].min() + 1e-9
    assert found["errors"].min() < 1.3 * found["least error"]
    assert found["errors"].max() > 1


def test_a_shape_and_itself_end_on_each_other(run):
    found = descend(run.shapes, run.store, "dog0", "dog0")
    assert found["least error"] < 1e-9
    assert found["errors"].min() < 1e-6


def test_the_page_gives_the_figures_of_the_table(run):
    result = figure3(run)
    (row,) = result.tables["pairs"]
    starts = result.tables["starts"]
    assert len(starts) == 8
    assert row["least residual"] == min(start["last residual"] for start in starts)
    best = min(starts, key=lambda start: start["last residual"])
    assert row["true pairs, least residual"] == best["true pairs"]
    assert row["right"] == (best["true pairs"] < 0.3)
    said = "leads to the true correspondence for dog." in result.text
    assert said == row["right"]
    assert result.figures["icp"].axes[3].get_lines()
