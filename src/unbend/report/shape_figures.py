"""Pictures of one shape: beside its canonical form, with values on it, and as it varies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from unbend._arrays import numbers_of
from unbend._types import BoolArray, FloatArray, StrPath
from unbend.canonical import CanonicalForm, check_form
from unbend.errors import InputError
from unbend.io import MeshLike, scale_limits, value_colors
from unbend.mesh import Mesh
from unbend.report.colors import position_colors
from unbend.report.figures import (
    FORM_THICKER,
    FRONT_AND_BACK,
    as_written,
    check_values,
    draw_grid,
    drawable,
    fit_rigidly,
    fitting_height,
    same_scale,
    save_figure,
    upright,
)

_SIDE = 1.8  # inches, of a picture of how a shape varies


def draw_form(
    mesh: MeshLike,
    form: CanonicalForm,
    path: StrPath,
    *,
    posed: FloatArray | None = None,
    up: str = "y",
) -> None:
    """Write a picture of a shape beside its canonical form, in the same colours.

    The form is turned or mirrored as a whole to lie as the shape does, and drawn 2.5 pixels
    thicker on each side than it is, for its limbs are threads. Each is drawn as large as its place
    allows.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    form : CanonicalForm
        Of that mesh; of more than three dimensions the first three are drawn.
    path : path
        The file to write; its ending decides the format (.png, .pdf, .svg).
    posed : (n, 3) ndarray of float64, optional
        The surface in the form's pose, from :func:`unbend.lay_into_pose`, to be drawn too.
    up : {"x", "y", "z"}, default="y"
        The shape's axis that points upward.

    Raises
    ------
    InputError, FileError, MissingExtraError
        If the form is of another mesh, there is no such axis, the file cannot be written, or
        matplotlib is not installed.

    Examples
    --------
    >>> from unbend import canonical_form
    >>> from unbend.datasets import make_octopus
    >>> from unbend.report import draw_form
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> draw_form(mesh, canonical_form(mesh), "form.png")
    """
    mesh = drawable(mesh)
    check_form(mesh, form)
    turn = upright(up)
    inside = np.asarray(np.isfinite(form.points).all(axis=1, keepdims=True))
    colors = position_colors(np.where(inside, mesh.vertices, np.nan))
    drawn = [
        (mesh.name, mesh.vertices, 0.0),
        ("its canonical form", turned_to_fit(form.points, mesh), FORM_THICKER),
    ]
    if posed is not None:
        drawn.append(("the surface in its form's pose", posed_to_fit(posed, inside, mesh), 0.0))
    row = [(one @ turn.T, mesh, colors, FRONT_AND_BACK[0], thicker) for _, one, thicker in drawn]
    figure, _ = draw_grid([row], [caption for caption, *_ in drawn], 4.0, 3.45)
    save_figure(figure, path)


def draw_values(
    mesh: MeshLike, values: npt.ArrayLike, path: StrPath, *, label: str = "", up: str = "y"
) -> None:
    """Write a picture of a shape from both sides, coloured by a value per vertex.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    values : (n,) array_like of float
        Drawn in the viridis colours from the least to the greatest on a face, or from blue over
        white, which is 0, to red if there are both signs; grey where not finite.
    label : str, default=""
        What the values are, beside the scale of colours.
    path, up
        As for :func:`draw_form`.

    Raises
    ------
    InputError, FileError, MissingExtraError
        If there is not one value per vertex, none is finite, there is no such axis, the file cannot
        be written, or matplotlib is not installed.

    Examples
    --------
    >>> from unbend import distance
    >>> from unbend.datasets import make_octopus
    >>> from unbend.report import draw_values
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> draw_values(mesh, distance(mesh, 0)[0], "distances.png", label="distance")
    """
    mesh = drawable(mesh)
    turned = Mesh(mesh.vertices @ upright(up).T, mesh.faces)
    array = check_values(values, mesh)
    height = fitting_height(3.7, [turned], FRONT_AND_BACK)
    row = [(turned.vertices, turned, array, view) for view in FRONT_AND_BACK]
    figure, ((first, _),) = draw_grid([row], ["", ""], 3.85, height, right=0.9)
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    place = first.get_position()
    figure.text(0.44, 0.35 * place.y0, as_written(mesh.name), ha="center", fontsize=10)
    scale = figure.add_axes((0.9, place.y0, 0.02, 0.9 * place.height))
    low, high = scale_limits(float(np.nanmin(array)), float(np.nanmax(array)))
    shades = ListedColormap(value_colors(np.linspace(low, high, 256)) / 255)
    colors = ScalarMappable(Normalize(low, high), shades)
    figure.colorbar(colors, scale).set_label(as_written(label), fontsize=9)
    save_figure(figure, path)


def draw_variation(
    rows: Sequence[tuple[str, Sequence[Mesh]]], captions: Sequence[str], path: StrPath
) -> None:
    """Write rows of one shape as it changes, all at one scale; what moves most is brightest.

    Parameters
    ----------
    rows : sequence of (str, sequence of Mesh)
        A name for each row, and its shapes from left to right, with the same vertices.
    captions : sequence of str
        One for each column.
    path : path
        As for :func:`draw_form`.

    Raises
    ------
    InputError, FileError, MissingExtraError
        If there are no rows, a row has not one shape for each caption, the numbers of their
        vertices differ, the file cannot be written, or matplotlib is not installed.

    Examples
    --------
    >>> from unbend import Mesh
    >>> from unbend.datasets import make_sphere
    >>> from unbend.report import draw_variation
    >>> ball = make_sphere(2)
    >>> eggs = [Mesh(ball.vertices * [1, high, 1], ball.faces) for high in (0.8, 1, 1.2)]
    >>> draw_variation([("height", eggs)], ["-1", "0", "+1"], "eggs.png")
    """
    if not rows or any(len(meshes) != len(captions) for _, meshes in rows):
        raise InputError(f"each row needs {len(captions)} shapes, one for each caption")
    cells = []
    for name, meshes in rows:
        if len({mesh.n_vertices for mesh in meshes}) > 1:
            raise InputError(f"{name}: its shapes must have the same vertices")
        moved = np.linalg.norm(meshes[-1].vertices - meshes[0].vertices, axis=1)
        cells.append([(mesh.vertices, mesh, moved) for mesh in meshes])
    figure, axes = draw_grid(cells, captions, _SIDE, 0.9 * _SIDE, above=0.1 * _SIDE)
    for (name, _), (first, *_) in zip(rows, axes, strict=True):
        place = first.get_position()
        above = place.y1 + 0.02 * place.height
        figure.text(0.01, above, as_written(name), va="bottom", fontsize=8)
    same_scale([one for row in axes for one in row])
    save_figure(figure, path)


def posed_to_fit(posed: npt.ArrayLike, inside: BoolArray, mesh: Mesh) -> FloatArray:
    """Rotate the surface in its form's pose onto the shape, where `inside` (n, 1)."""
    places = numbers_of(posed, "posed")
    if places.shape != mesh.vertices.shape or not np.isfinite(places).any():
        raise InputError(
            f"posed must be places of shape {mesh.vertices.shape}, as lay_into_pose gives them"
        )
    return turned_to_fit(np.where(inside, places, np.nan), mesh, reflect=False)


def in_space(points: FloatArray) -> FloatArray:
    """Places (n, 3): the first three coordinates of points, 0 where they have fewer."""
    places = np.zeros((len(points), 3))
    places[:, : points.shape[1]] = points[:, :3]
    return places


def turned_to_fit(points: FloatArray, mesh: Mesh, *, reflect: bool = True) -> FloatArray:
    """Rotate the first three dimensions onto the shape, with a reflection if that fits better."""
    places = in_space(points)
    turn, _ = fit_rigidly(places, mesh.vertices, reflect=reflect)
    return np.asarray(places @ turn.T)
