"""A shape beside its form: a picture in each format, and what does not fit is refused."""

from pathlib import Path

import numpy as np
import pytest

from unbend import Mesh, canonical_form
from unbend.canonical import CanonicalForm
from unbend.datasets import make_sphere
from unbend.errors import FileError, InputError
from unbend.io import value_colors
from unbend.report import new_figure, shape_figures
from unbend.report.shape_figures import draw_form, draw_values, draw_variation, turned_to_fit


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw with few pixels."""
    monkeypatch.setitem(new_figure.__kwdefaults__, "dpi", 60)


@pytest.fixture(scope="module")
def form(blob: Mesh) -> CanonicalForm:
    return canonical_form(blob)


@pytest.mark.parametrize("up", ["x", "z"])
def test_everything_that_there_is_is_drawn(
    blob: Mesh, form: CanonicalForm, up: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures: list = []
    monkeypatch.setattr(shape_figures, "save_figure", lambda figure, path: figures.append(figure))
    draw_form(blob, form, "a.png", posed=2 * blob.vertices, up=up)
    draw_form(blob, form, "a.png", up=up)
    assert [len(one.axes) for one in figures] == [3, 2]
    told = [text.get_text() for text in figures[0].texts]
    assert told == ["blob", "its canonical form", "the surface in its form's pose"]
    drawn = [np.asarray(ax.get_images()[0].get_array())[..., 3].mean() for ax in figures[0].axes]
    assert min(drawn) > 0.3
    # The surface stands as the shape does: it is the shape here, but for its size.
    shape, _, surface = (np.asarray(ax.get_images()[0].get_array()) for ax in figures[0].axes)
    np.testing.assert_allclose(shape.mean(axis=(0, 1)), surface.mean(axis=(0, 1)), atol=0.01)


@pytest.mark.parametrize("low", [-1.0, 0.0])
def test_the_scale_has_the_colours_of_the_shape(
    blob: Mesh, low: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures: list = []
    monkeypatch.setattr(shape_figures, "save_figure", lambda figure, path: figures.append(figure))
    values = np.linspace(low, 2, blob.n_vertices)
    draw_values(blob, values, "a.png")
    (image,) = figures[0].axes[-1].collections[-1:]
    for value, color in zip(values, value_colors(values), strict=True):
        np.testing.assert_allclose(image.to_rgba(value)[:3], color / 255, atol=0.02)


def test_a_form_lies_as_the_shape_does(blob: Mesh) -> None:
    turn = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
    for mirror in (1, -1):
        points = blob.vertices @ turn * mirror
        points[:6] = np.nan
        back = turned_to_fit(points, blob)
        assert np.isnan(back[:6]).all()
        np.testing.assert_allclose(
            back[6:] - back[6:].mean(axis=0),
            blob.vertices[6:] - blob.vertices[6:].mean(axis=0),
            atol=1e-9,
        )


def test_what_does_not_fit_is_refused(blob: Mesh, form: CanonicalForm, tmp_path: Path) -> None:
    for mesh, up, message in (
        (Mesh(blob.vertices[:3], [[0, 1, 2]]), "y", "the form has 642 points"),
        (blob, "w", "up must be"),
        (blob, ["y"], "up must be"),
    ):
        with pytest.raises(InputError, match=message):
            draw_form(mesh, form, tmp_path / "a.png", up=up)
    with pytest.raises(FileError):
        draw_form(blob, form, tmp_path / "a.bmp")
    assert list(tmp_path.iterdir()) == []


def test_shapes_of_a_row_have_the_same_vertices(tmp_path: Path) -> None:
    balls = [make_sphere(1), make_sphere(2)]
    with pytest.raises(InputError, match="height: its shapes must have the same vertices"):
        draw_variation([("height", balls)], ["-1", "+1"], tmp_path / "balls.png")
    for rows in ([], [("height", balls[:1])]):
        with pytest.raises(InputError, match="each row needs 2 shapes, one for each caption"):
            draw_variation(rows, ["-1", "+1"], tmp_path / "balls.png")
