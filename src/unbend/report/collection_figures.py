"""Pictures of many shapes at once."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from unbend.errors import InputError
from unbend.report.figures import as_written, new_figure, save_figure
from unbend.report.trees import join_alike

_MOST_NAMES = 150  # more names would be too small to read


def draw_distances(
    names: Sequence[str], distances: npt.ArrayLike, path: str | os.PathLike[str]
) -> None:
    """Write a heat map of distances and the dendrogram that orders it, by average linkage.

    Parameters
    ----------
    names : sequence of str
        Of the n shapes.
    distances : (n, n) array_like of float
        Symmetric, 0 on the diagonal.
    path : path
        The file to write; its ending decides the format (.png, .pdf, .svg).

    Raises
    ------
    InputError
        If the table does not fit the names.
    FileError
        If the file cannot be written.
    MissingExtraError
        If matplotlib is not installed.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from unbend.report import draw_distances
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     draw_distances(["cat", "dog"], [[0, 2], [2, 0]], pathlib.Path(folder, "a.png"))
    """
    table = np.asarray(distances, dtype=np.float64)
    n = len(names)
    if table.shape != (n, n) or n < 2:
        raise InputError(f"{n} names need distances of shape ({n}, {n}), two at least")
    order, heights, places = join_alike(table)
    side = min(max(3.0, 0.14 * n), 24.0)
    figure = new_figure(side + 3.0, side + 1.0)
    figure.set_layout_engine("constrained")
    left, right = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1.5, side]})
    left.plot(heights.T, places.T, color="0.3", linewidth=0.8)
    left.set_ylim(n - 0.5, -0.5)
    left.invert_xaxis()
    left.set_yticks([])
    left.spines[["top", "left", "right"]].set_visible(False)
    left.tick_params(labelsize=7)
    picture = right.imshow(table[np.ix_(order, order)], cmap="viridis_r", aspect="auto")
    right.set_xticks([])
    if n <= _MOST_NAMES:
        right.yaxis.tick_right()
        right.set_yticks(range(n), [as_written(names[i]) for i in order], fontsize=min(8, 600 / n))
    else:
        right.set_yticks([])
    right.tick_params(length=0)
    bar = figure.colorbar(picture, ax=right, location="bottom", fraction=0.05, pad=0.02)
    bar.set_label("distance", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    save_figure(figure, path)
