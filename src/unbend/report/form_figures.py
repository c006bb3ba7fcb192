"""Pictures of a shape beside its canonical form."""

from __future__ import annotations

import os

import numpy as np

from unbend._types import BoolArray, FloatArray
from unbend.alignment import procrustes
from unbend.canonical import CanonicalForm, check_form
from unbend.io import MeshLike
from unbend.mesh import Mesh
from unbend.report.colors import position_colors
from unbend.report.figures import (
    FORM_THICKER,
    UPRIGHT,
    as_written,
    check_up,
    draw_places,
    drawable,
    new_figure,
    save_figure,
)

_VIEW = (60.0, 15.0)


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
    FileError
        If the file cannot be written.
    MissingExtraError
        If matplotlib is not installed.

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
        draw_places(ax, seen @ UPRIGHT[up].T, mesh, colors, _VIEW, thicker)
        figure.text((i + 0.5) * width, 0.03, caption, ha="center", fontsize=10)
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
