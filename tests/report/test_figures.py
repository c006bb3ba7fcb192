"""The renderer draws the right thing in front, and files are whole or absent."""

import sys
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from unbend.datasets import make_sphere
from unbend.errors import FileError, InputError, MeshError, MissingExtraError
from unbend.mesh import Mesh
from unbend.report import pattern_colors
from unbend.report.colors import position_colors
from unbend.report.figures import (
    as_written,
    draw_canonical_forms,
    draw_mesh,
    fitting_height,
    new_figure,
    save_figure,
)
from unbend.report.raster import VIEWS, rasterize, view_rotation

RED, BLUE = [1.0, 0, 0], [0, 0, 1.0]
SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def pixels(ax):
    return np.asarray(ax.get_images()[0].get_array())


@pytest.mark.parametrize("order", [1, -1])
def test_the_nearer_square_hides_the_farther(order):
    vertices = np.concatenate([SQUARE, 0.5 * SQUARE + [0, 0, 1]])
    faces = np.concatenate([TWO, TWO + 4])[::order]
    rgb = np.array([RED] * 4 + [BLUE] * 4)
    picture, extent = rasterize(vertices, faces, rgb, (60, 60))
    height, width = picture.shape[:2]
    middle, side = picture[height // 2, width // 2], picture[height // 2, width // 6]
    assert middle[2] > 0.3
    assert middle[0] < 0.2
    assert side[0] > 0.3
    assert side[2] < 0.2
    np.testing.assert_allclose(picture[..., 3].mean(), 1, atol=0.15)
    np.testing.assert_allclose(extent, [-1, 1, -1, 1], atol=0.1)


def test_crossing_triangles_are_hidden_pixel_by_pixel():
    tilted = SQUARE @ np.array([[1, 0, 0.5], [0, 1, 0], [0, 0, 1]])  # nearer on the right
    vertices, faces = np.concatenate([SQUARE, tilted]), np.concatenate([TWO, TWO + 4])
    picture, _ = rasterize(vertices, faces, np.array([RED] * 4 + [BLUE] * 4), (40, 40))
    row = picture[picture.shape[0] // 2]
    assert row[len(row) // 4, 0] > row[len(row) // 4, 2]
    assert row[3 * len(row) // 4, 2] > row[3 * len(row) // 4, 0]


def test_corners_that_are_not_finite_are_left_out():
    broken = SQUARE.copy()
    broken[3] = np.nan
    whole, _ = rasterize(SQUARE, TWO, np.ones((4, 3)), (40, 40))
    half, _ = rasterize(broken, TWO, np.ones((4, 3)), (40, 40))
    assert np.isfinite(half).all()
    assert 0.4 < half[..., 3].sum() / whole[..., 3].sum() < 0.6
    nothing, _ = rasterize(np.full((4, 3), np.nan), TWO, np.ones((4, 3)), (40, 40))
    assert nothing[..., 3].sum() == 0


def test_views_are_rotations_and_look_from_where_they_say():
    for view in VIEWS:
        rotation = view_rotation(view)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) > 0
    towards_viewer = {name: view_rotation(name)[2] for name in VIEWS}
    np.testing.assert_allclose(towards_viewer["front"], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(towards_viewer["side"], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(towards_viewer["top"], [0, 1, 0], atol=1e-12)


def test_draw_mesh_takes_no_scalar_and_rgb_colors(blob):
    height = blob.vertices[:, 1].copy()
    height[0] = np.nan
    seen = []
    for colors in (None, height, position_colors(blob.vertices)):
        ax = new_figure(1, 1, dpi=80).add_subplot()
        draw_mesh(ax, blob, colors=colors)
        assert ax.get_aspect() == 1
        assert np.isfinite(pixels(ax)).all()
        seen.append(pixels(ax)[..., :3])
    assert np.abs(seen[0] - seen[1]).max() > 0.1
    assert np.abs(seen[1] - seen[2]).max() > 0.1


def test_unreferenced_nan_vertices_are_no_trouble():
    mesh = Mesh(np.concatenate([SQUARE, [[np.nan] * 3]]), TWO)
    ax = new_figure(1, 1).add_subplot()
    draw_mesh(ax, mesh, view="front", colors=position_colors(mesh.vertices))
    assert pixels(ax)[..., 3].mean() > 0.8


def test_position_colors_tell_points_apart(blob):
    colors = position_colors(blob.vertices)
    assert 0 <= colors.min() < colors.max() <= 1
    assert len(np.unique(colors.round(6), axis=0)) == len(colors)


@pytest.mark.parametrize("places", [5, [0, 1, 2], np.zeros((4, 2)), [["a", "b", "c"]]])
def test_positions_have_three_numbers(places: Any) -> None:
    with pytest.raises(InputError, match="vertices"):
        position_colors(places)


def test_without_a_position_colors_are_grey():
    for colors in (position_colors, pattern_colors):
        assert (colors(np.full((2, 3), np.nan)) == 0.6).all()


def test_position_colors_are_those_of_the_pages():
    """The shader's values, written out for the middle of the box and for its ends."""
    line = np.array([[0.0, 0, 0], [2, 4, 1], [1, 2, 0.5], [0, 4, 0], [np.nan, 0, 0]])
    colors = position_colors(line)
    np.testing.assert_allclose(colors[4], 0.6)
    # OKLab of the colours, by Ottosson's formulas from red, green and blue.
    lms = np.cbrt(
        np.maximum(colors[:3], 0) ** 2.2
        @ np.array(
            [
                [0.4122214708, 0.5363325363, 0.0514459929],
                [0.2119034982, 0.6806995451, 0.1073969566],
                [0.0883024619, 0.2817188376, 0.6299787005],
            ]
        ).T
    )
    light = lms @ [0.2104542553, 0.7936177850, -0.0040720468]
    # The longest side, here y, makes them lighter; so does the middle one, x.
    np.testing.assert_allclose(light, [0.5, 0.9, 0.7], atol=0.02)
    assert colors[3].sum() > colors[0].sum()


def test_canonical_forms_figure(blob, tmp_path):
    form = blob.vertices
    bent = Mesh(form + 0.1 * form[:, [1]] ** 2, blob.faces)
    columns = [(f"pose {i}", one, form) for i, one in enumerate((blob, bent))]
    path = tmp_path / "figure.png"
    draw_canonical_forms(columns, path)
    assert path.read_bytes().startswith(b"\x89PNG")
    assert [p.name for p in tmp_path.iterdir()] == ["figure.png"]
    with pytest.raises(InputError, match="642 vertices"):
        draw_canonical_forms([("a", blob, form[:9])], path)
    with pytest.raises(InputError, match="for all columns or for none"):
        draw_canonical_forms([(*columns[0], None, form), columns[1]], path)
    detailed = [(*column, None, form) for column in columns]
    draw_canonical_forms(detailed, tmp_path / "three.png")
    rows = [imread(one).shape[0] for one in (path, tmp_path / "three.png")]
    assert rows[1] > 1.4 * rows[0]
    with pytest.raises(InputError, match="at least one"):
        draw_canonical_forms([], path)


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "figure.png"
    path.write_text("old")

    def fail(file, **_):
        file.write(b"half")
        raise OSError("disk full")

    broken = new_figure(1, 1)
    broken.savefig = fail
    with pytest.raises(FileError, match="disk full"):
        save_figure(broken, path)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["figure.png"]
    with pytest.raises(FileError, match="cannot write"):
        save_figure(new_figure(1, 1), tmp_path / "nowhere" / "figure.png")
    with pytest.raises(FileError, match="cannot write"):
        save_figure(new_figure(1, 1), tmp_path / "figure.nonsense")


def test_unusable_arguments_are_named():
    mesh = Mesh(SQUARE, TWO)
    ax = new_figure(1, 1).add_subplot()
    with pytest.raises(InputError, match="three-quarter"):
        draw_mesh(ax, mesh, view="below")
    for view in (5, (1,), ("a", 2), (np.nan, 0)):
        with pytest.raises(InputError, match="view"):
            draw_mesh(ax, mesh, view=view)
    with pytest.raises(MeshError, match="4 points"):
        draw_mesh(ax, SQUARE)
    with pytest.raises(InputError, match="colors"):
        draw_mesh(ax, mesh, colors=np.ones(3))
    with pytest.raises(InputError, match="colors"):
        draw_mesh(ax, mesh, colors="red")


def test_missing_matplotlib_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingExtraError, match="pip install matplotlib"):
        new_figure(1, 1)


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_the_same_picture_is_the_same_file(tmp_path, suffix, monkeypatch):
    written = []
    for time in ("1000000000", "2000000000"):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", time)
        figure = new_figure(1, 1, dpi=40)
        ax = figure.add_subplot()
        draw_mesh(ax, (SQUARE, TWO))
        ax.set_title(as_written("a$b$ \\frac$ <&>"))  # a name, no formula
        save_figure(figure, tmp_path / f"a{suffix}")
        written.append((tmp_path / f"a{suffix}").read_bytes())
    assert written[0] == written[1]


def test_pictures_are_as_high_as_what_lies_in_them() -> None:
    ball = make_sphere(2)
    for size, height in ((1, 4), (0.5, 2), (0.1, 1), (3, 4)):  # a quarter of the width, or all
        flat = Mesh(ball.vertices * [1, size, 1], ball.faces)
        assert fitting_height(4, [flat], [(0, 0)]) == pytest.approx(height)
    lying = Mesh(ball.vertices * [1, 0.5, 1], ball.faces)
    assert fitting_height(4, [lying, ball], [(0, 0), (180, 0)]) == pytest.approx(4)
