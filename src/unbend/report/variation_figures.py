"""Pictures of how shapes vary."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from unbend.errors import InputError
from unbend.mesh import Mesh
from unbend.report.figures import as_written, draw_mesh, new_figure, same_scale, save_figure

_SIDE = 1.8  # inches


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
    FileError
        If the file cannot be written.
    MissingExtraError
        If matplotlib is not installed.

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
