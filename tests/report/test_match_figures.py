"""Pictures of matches and comparisons are written whole, and what does not fit is refused."""

from pathlib import Path

import numpy as np
import pytest

from unbend import Mesh, transfer
from unbend.correspondence import evaluate
from unbend.datasets import make_biped
from unbend.errors import InputError, UnbendWarning
from unbend.matching import Match
from unbend.report import match_figures
from unbend.report.figures import new_figure
from unbend.report.match_figures import (
    draw_error_curves,
    draw_match,
    match_colors,
    pattern_colors,
)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list:
    """Keep the figures, small ones, instead of writing them."""
    figures: list = []
    monkeypatch.setitem(new_figure.__kwdefaults__, "dpi", 30)
    monkeypatch.setattr(match_figures, "save_figure", lambda figure, path: figures.append(figure))
    return figures


def test_patterns_are_colors_and_stripes_are_there(blob: Mesh) -> None:
    points = np.vstack([blob.vertices, [[np.nan] * 3]])
    colors = pattern_colors(points)
    assert colors.shape == points.shape
    assert np.isfinite(colors).all()
    assert colors.min() >= 0
    assert colors.max() <= 1
    line = pattern_colors(np.linspace([0, 0, 0], [1, 0, 0], 400))[:, 2]
    assert ((np.diff(np.sign(np.diff(line))) != 0).sum()) > 10


def test_a_match_is_drawn_from_two_sides_and_turned_to_fit(blob: Mesh, drawn: list) -> None:
    every = np.arange(blob.n_vertices)
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    draw_match(blob, Mesh(blob.vertices @ turn.T, blob.faces), every, "any.png")
    above, above_target, below, below_target = drawn[0].get_axes()
    for left, right in ((above, above_target), (below, below_target)):
        pictures = [np.asarray(ax.get_images()[0].get_array()) for ax in (left, right)]
        assert np.abs(pictures[0] - pictures[1]).mean() < 0.02


def test_a_symmetric_shape_is_drawn_twice_from_one_side(drawn: list) -> None:
    # Closest to its mirror image among all rotated copies of a wide body is one turned about.
    body = make_biped("standing", n_vertices=600)
    wide = Mesh(body.mesh.vertices * [3, 1, 1], body.mesh.faces)
    found = Match(body.mirror, body.mirror, np.eye(2), -1.0, 0.9)
    draw_match(wide, wide, found, "any.png")
    pictures = [np.asarray(ax.get_images()[0].get_array()) for ax in drawn[0].get_axes()[:2]]
    np.testing.assert_array_equal(*(one[..., 3] for one in pictures))  # where it is drawn


def test_vertices_without_a_partner_are_grey(blob: Mesh, drawn: list) -> None:
    draw_match(blob, blob, np.full(blob.n_vertices, -1), "any.png", up="z")
    picture = np.asarray(drawn[0].get_axes()[1].get_images()[0].get_array())
    opaque = picture[picture[..., 3] == 1][:, :3]
    assert np.ptp(opaque, axis=1).max() < 1e-6


def test_curves_end_where_the_evaluation_says(blob: Mesh, drawn: list) -> None:
    every = np.arange(blob.n_vertices)
    some = every[:30]
    plain = evaluate(every, blob, some, some)
    mirrored = evaluate(np.roll(every, 1), blob, some, some, np.roll(every, 1)[some])
    draw_error_curves({"one": plain, "two": mirrored}, "any.png")
    lines = drawn[0].get_axes()[0].get_lines()
    assert len(lines) == 3
    np.testing.assert_array_equal(lines[0].get_ydata(), plain.curve())
    np.testing.assert_array_equal(lines[2].get_ydata(), mirrored.curve("map-min"))


def test_what_does_not_fit(blob: Mesh) -> None:
    for wrong in ({}, [5]):
        with pytest.raises(InputError, match="give evaluations by their names"):
            draw_error_curves(wrong, "a.png")
    with pytest.raises(InputError, match="mine: an Evaluation is drawn, not int"):
        draw_error_curves({"mine": 5}, "a.png")
    with pytest.raises(InputError, match="the map has 3 source"):
        draw_match(blob, blob, np.arange(3), "a.png")
    with pytest.raises(InputError, match="up must be"):
        draw_match(blob, blob, np.arange(642), "a.png", up="w")


def test_partners_have_one_colour_and_others_are_grey(blob: Mesh) -> None:
    shuffle = np.random.default_rng(0).permutation(642)
    target = Mesh(blob.vertices[shuffle], np.argsort(shuffle)[blob.faces])
    forward = np.argsort(shuffle)
    forward[:100] = -1
    ours, theirs = match_colors(blob, target, forward)
    there = forward >= 0
    np.testing.assert_array_equal(ours[there], theirs[forward[there]])
    assert (ours[~there] == 153).all()


def test_drawing_does_not_warn_of_a_map_in_disorder(
    blob: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(new_figure.__kwdefaults__, "dpi", 30)
    every = np.arange(642)
    wrong = Match(every, every, np.eye(3), 1.0, 0.2, confidence_bound=0.3)
    with pytest.warns(UnbendWarning, match="part of the map is wrong"):
        transfer(every, wrong)
    ours, theirs = match_colors(blob, blob, wrong)  # warnings are errors
    np.testing.assert_array_equal(ours, theirs)
    draw_match(blob, blob, wrong, tmp_path / "match.png")
    assert (tmp_path / "match.png").read_bytes().startswith(b"\x89PNG")
