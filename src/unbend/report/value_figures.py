"""Pictures of values on a shape, such as distances."""

from __future__ import annotations

import os

import numpy as np
import numpy.typing as npt

from unbend.io import MeshLike
from unbend.mesh import Mesh
from unbend.report.figures import (
    UPRIGHT,
    as_written,
    check_up,
    check_values,
    draw_mesh,
    drawable,
    fitting_height,
    front_and_back,
    new_figure,
    save_figure,
)


def draw_values(
    mesh: MeshLike,
    values: npt.ArrayLike,
    path: str | os.PathLike[str],
    *,
    label: str = "",
    up: str = "y",
    view: tuple[float, float] = (60.0, 15.0),
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
    view : (azimuth, elevation), default=(60, 15)
        Of the left picture, in degrees; see :func:`unbend.report.draw_mesh`.

    Raises
    ------
    InputError
        If there is not one value per vertex, none is finite, or there is
        no such axis.
    FileError
        If the file cannot be written.
    MissingExtraError
        If matplotlib is not installed.

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
    views = front_and_back(view)
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
