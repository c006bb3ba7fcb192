"""Pictures of one shape: beside its canonical form, with values on it, and as it varies."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from unbend._types import BoolArray, FloatArray
from unbend.alignment import procrustes
from unbend.canonical import CanonicalForm, check_form
from unbend.errors import InputError
from unbend.io import MeshLike
from unbend.mesh import Mesh
from unbend.report.colors import position_colors
from unbend.report.figures import (
    FORM_THICKER,
    FRONT_AND_BACK,
    UPRIGHT,
    as_written,
    check_up,
    check_values,
    draw_mesh,
    draw_places,
    drawable,
    fitting_height,
    new_figure,
    same_scale,
    save_figure,
)

_SIDE = 1.8  # inches, of a picture of how a shape varies


def draw_form(
    mesh: MeshLike,
    form: CanonicalForm,
    path: str | os.PathLike[str],
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
    InputError
        If the form is not of this mesh, or there is no such axis.
    FileError, MissingExtraError
        If the file cannot be written, or matplotlib is not installed.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from unbend import canonical_form
    >>> from unbend.datasets import make_octopus
    >>> from unbend.report import draw_form
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     draw_form(mesh, canonical_form(mesh), pathlib.Path(folder, "form.png"))
    """
    mesh = checked_shape(mesh, form, up)
    inside = np.asarray(np.isfinite(form.points).all(axis=1))
    places = turned_to_fit(form.points, mesh.vertices, inside)
    columns = [
        (as_written(mesh.name), mesh.vertices, 0.0),
        ("its canonical form", places, FORM_THICKER),
    ]
    if posed is not None:
        fitted = turned_to_fit(posed, mesh.vertices, inside, reflect=False)
        columns.append(("the surface in its form's pose", fitted, 0.0))
    colors = position_colors(np.where(inside[:, None], mesh.vertices, np.nan))
    figure = new_figure(4.0 * len(columns), 3.9)
    width = 1 / len(columns)
    for i, (caption, seen, thicker) in enumerate(columns):
        ax = figure.add_axes(((i + 0.03) * width, 0.1, 0.94 * width, 0.88))
        draw_places(ax, seen @ UPRIGHT[up].T, mesh, colors, FRONT_AND_BACK[0], thicker)
        figure.text((i + 0.5) * width, 0.03, caption, ha="center", fontsize=10)
    save_figure(figure, path)


def draw_values(
    mesh: MeshLike,
    values: npt.ArrayLike,
    path: str | os.PathLike[str],
    *,
    label: str = "",
    up: str = "y",
) -> None:
    """Write a picture of a shape from both sides, coloured by a value per vertex.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    values : (n,) array_like of float
        Drawn in the viridis colours from the least to the greatest; grey where not finite.
    path : path
        The file to write; its ending decides the format (.png, .pdf, .svg).
    label : str, default=""
        What the values are, beside the scale of colours.
    up : {"x", "y", "z"}, default="y"
        The shape's axis that points upward.

    Raises
    ------
    InputError
        If there is not one value per vertex, none is finite, or there is no such axis.
    FileError, MissingExtraError
        If the file cannot be written, or matplotlib is not installed.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from unbend import distance
    >>> from unbend.datasets import make_octopus
    >>> from unbend.report import draw_values
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "distances.png")
    ...     draw_values(mesh, distance(mesh, 0)[0], path, label="distance")
    ...     path.exists()
    True
    """
    mesh = drawable(mesh)
    check_up(up)
    array = check_values(values, mesh)
    finite = array[np.isfinite(array)]
    upright = Mesh(mesh.vertices @ UPRIGHT[up].T, mesh.faces)
    views = FRONT_AND_BACK
    height = fitting_height(3.7, [upright], views)
    total = height + 0.5  # inches
    figure = new_figure(8.6, total)
    for i, seen_from in enumerate(views):
        ax = figure.add_axes((0.01 + 0.44 * i, 0.4 / total, 0.43, height / total))
        draw_mesh(ax, upright, colors=array, view=seen_from)
    figure.text(0.44, 0.14 / total, as_written(mesh.name), ha="center", fontsize=10)
    scale = figure.add_axes((0.9, 0.4 / total, 0.02, 0.9 * height / total))
    steps = np.linspace(0, 1, 256)[:, None]
    ends = (0, 1, float(finite.min()), float(finite.max()))
    scale.imshow(steps, origin="lower", aspect="auto", cmap="viridis", extent=ends)
    scale.set_xticks([])
    scale.yaxis.tick_right()
    scale.yaxis.set_label_position("right")
    scale.set_ylabel(label, fontsize=9)
    save_figure(figure, path)


def draw_variation(
    rows: Sequence[tuple[str, Sequence[Mesh]]],
    captions: Sequence[str],
    path: str | os.PathLike[str],
) -> None:
    """Write rows of one shape as it changes, all at one scale; what moves most is brightest.

    Parameters
    ----------
    rows : sequence of (str, sequence of Mesh)
        A name for each row, and its shapes from left to right, with the same vertices.
    captions : sequence of str
        One for each column.
    path : path
        The file to write; its ending decides the format (.png, .pdf, .svg).

    Raises
    ------
    InputError
        If there are no rows, or a row has not one shape for each caption.
    FileError, MissingExtraError
        If the file cannot be written, or matplotlib is not installed.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from unbend import Mesh
    >>> from unbend.datasets import make_sphere
    >>> from unbend.report import draw_variation
    >>> ball = make_sphere(2)
    >>> eggs = [Mesh(ball.vertices * [1, high, 1], ball.faces) for high in (0.8, 1, 1.2)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     draw_variation([("height", eggs)], ["-1", "0", "+1"], pathlib.Path(folder, "a.png"))
    """
    if not rows or any(len(meshes) != len(captions) for _, meshes in rows):
        raise InputError(f"each row needs {len(captions)} shapes, one for each caption")
    figure = new_figure(_SIDE * len(captions), _SIDE * len(rows) + 0.3)
    height = _SIDE / (_SIDE * len(rows) + 0.3)
    drawn = []
    for i, (name, meshes) in enumerate(rows):
        moved = np.linalg.norm(meshes[-1].vertices - meshes[0].vertices, axis=1)
        for j, mesh in enumerate(meshes):
            place = (j / len(captions), 1 - (i + 1) * height, 1 / len(captions), 0.9 * height)
            axes = figure.add_axes(place)
            draw_mesh(axes, mesh, colors=moved)
            drawn.append(axes)
        figure.text(0.01, 1 - i * height - 0.02, as_written(name), va="top", fontsize=8)
    for j, caption in enumerate(captions):
        figure.text((j + 0.5) / len(captions), 0.02, caption, ha="center", fontsize=9)
    same_scale(drawn)
    save_figure(figure, path)


def checked_shape(mesh: MeshLike, form: CanonicalForm, up: str) -> Mesh:
    """Return the shape as it is drawn; check that the form is of it, and that `up` is an axis."""
    mesh = drawable(mesh)
    check_form(mesh, form)
    check_up(up)
    return mesh


def turned_to_fit(
    points: FloatArray, vertices: FloatArray, inside: BoolArray, *, reflect: bool = True
) -> FloatArray:
    """Rotate the first three dimensions onto the shape, with a reflection if that fits better."""
    places = np.zeros((len(points), 3))
    places[:, : points.shape[1]] = points[:, :3]
    turn, _ = procrustes(places[inside], vertices[inside], reflect=reflect)
    return np.asarray(np.where(inside[:, None], places @ turn.T, np.nan))
