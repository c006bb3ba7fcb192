"""Heat maps of how far apart or how alike many shapes are, ordered by Ward's linkage."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from unbend._arrays import numbers_of
from unbend._types import FloatArray, IntArray, StrPath
from unbend.errors import InputError
from unbend.report.figures import as_written, new_figure, save_figure

_MOST_NAMES, _MOST_NUMBERS = 150, 20  # more would be too small to read


def draw_distances(names: Sequence[str], distances: npt.ArrayLike, path: StrPath) -> None:
    """Write a heat map of distances and the dendrogram that orders it, by Ward's linkage.

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
    InputError, FileError, MissingExtraError
        If the table does not fit the names, the file cannot be written, or matplotlib is not
        installed.

    Examples
    --------
    >>> from unbend.report import draw_distances
    >>> draw_distances(["cat", "dog"], [[0, 2], [2, 0]], "distances.png")
    """
    _draw_table(names, distances, path, alike=False)


def draw_similarities(names: Sequence[str], similarities: npt.ArrayLike, path: StrPath) -> None:
    """Write a heat map of how alike shapes are, and the dendrogram that orders it.

    Parameters
    ----------
    names, path
        As for :func:`draw_distances`.
    similarities : (n, n) array_like of float
        Symmetric; NaN where unknown.

    Raises
    ------
    InputError, FileError, MissingExtraError
        As for :func:`draw_distances`.

    Examples
    --------
    >>> from unbend.report import draw_similarities
    >>> draw_similarities(["cat", "dog"], [[1, 0.9], [0.9, 1]], "similarities.png")
    """
    _draw_table(names, similarities, path, alike=True)


def _draw_table(names: Sequence[str], values: npt.ArrayLike, path: StrPath, *, alike: bool) -> None:
    """Draw a table of similarities, or of distances."""
    names = [str(name) for name in names]  # a column of pandas is asked by its index
    n = len(names)
    table = checked_table(values, n)
    order, heights, places = join_alike(table, alike=alike)
    table = table[np.ix_(order, order)]
    side = min(max(3.0, (0.42 if n <= _MOST_NUMBERS else 0.14) * n), 24.0)
    figure = new_figure(side + 3.0, side + 1.0)
    figure.set_layout_engine("constrained")
    left, right = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1.5, side]})
    left.plot(heights.T, places.T, color="0.3", linewidth=0.8)
    left.set_ylim(n - 0.5, -0.5)
    left.invert_xaxis()
    left.set_yticks([])
    left.spines[["top", "left", "right"]].set_visible(False)
    left.tick_params(labelsize=7)
    picture = right.imshow(table, cmap="viridis" if alike else "viridis_r", aspect="auto")
    right.set_xticks([])
    right.yaxis.tick_right()
    shown = [as_written(names[i]) for i in order] if n <= _MOST_NAMES else []
    right.set_yticks(range(len(shown)), shown, fontsize=min(8, 600 / n))
    right.tick_params(length=0)
    if n <= _MOST_NUMBERS:
        for i, j in np.argwhere(np.isfinite(table)):
            dark = picture.cmap(picture.norm(table[i, j]))[1] < 0.5
            style = {"ha": "center", "va": "center", "color": "white" if dark else "black"}
            right.text(j, i, f"{table[i, j]:.3g}", fontsize=6, **style)
    bar = figure.colorbar(picture, ax=right, location="bottom", fraction=0.05, pad=0.02)
    bar.set_label("similarity" if alike else "distance", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    save_figure(figure, path)


def checked_table(values: npt.ArrayLike, n: int) -> FloatArray:
    """Turn what n shapes are to each other into an array; InputError if that is no such table."""
    table = numbers_of(values, "values")
    if n < 2:
        raise InputError(f"a table of shapes needs two or more, not {n}")
    if table.shape != (n, n):
        raise InputError(f"{n} shapes need values of shape ({n}, {n}), not {table.shape}")
    wrong = np.isinf(table).any() or (table < 0).any()
    if wrong or not np.allclose(table, table.T, equal_nan=True):
        raise InputError("values must be symmetric, finite and not negative, or NaN where unknown")
    return table


def join_alike(values: FloatArray, *, alike: bool) -> tuple[IntArray, FloatArray, FloatArray]:
    """Cluster two shapes or more by Ward's linkage, from similarities or distances (n, n).

    What is unknown is at distance 1. Gives the order of the leaves, and for each join the heights
    and places of a bracket, both (n - 1, 4), that lead from one branch up to the join, along it,
    and down to the other. Leaf ``order[i]`` is at place `i`.
    """
    from scipy.cluster.hierarchy import dendrogram, linkage
    from scipy.spatial.distance import squareform

    far = np.nan_to_num(1 - values if alike else values, nan=1.0)
    near = squareform(np.maximum(far + far.T, 0) / 2, checks=False)
    tree = linkage(near, "ward", optimal_ordering=len(values) <= 1000)
    drawn = dendrogram(tree, no_plot=True)
    # SciPy puts leaf i at 10 i + 5.
    places = (np.array(drawn["icoord"]) - 5) / 10
    return np.array(drawn["leaves"], dtype=np.int64), np.array(drawn["dcoord"]), places
