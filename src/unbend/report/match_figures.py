"""Pictures of matches, of their errors, and of how alike many shapes are."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._types import FloatArray
from unbend.correspondence import THRESHOLDS, Evaluation, as_point_map, transfer
from unbend.errors import InputError
from unbend.io import MeshLike, as_mesh
from unbend.matching import Match
from unbend.mesh import Mesh, used_vertices
from unbend.report.colors import position_colors
from unbend.report.figures import (
    UPRIGHT,
    as_written,
    check_up,
    draw_mesh,
    drawable,
    fit_rigidly,
    fitting_height,
    front_and_back,
    new_figure,
    save_figure,
)
from unbend.report.trees import apart, join_alike

__all__ = [
    "draw_error_curves",
    "draw_match",
    "draw_similarities",
    "error_curves",
    "match_colors",
    "pattern_colors",
]

# Stripes along the longest side of the shape show slips that smooth colours hide.
_STRIPES = 9
_STRIPE_DEPTH = 0.35
_NO_PARTNER = 0.6  # grey


def pattern_colors(vertices: npt.ArrayLike) -> FloatArray:
    """Colour each point by its position, with faint stripes that make small slips visible.

    Parameters
    ----------
    vertices : (n, 3) array_like of float

    Returns
    -------
    (n, 3) ndarray of float64
        Red, green and blue from 0 to 1.

    Examples
    --------
    >>> from unbend.report import pattern_colors
    >>> pattern_colors([[0, 0, 0], [1, 2, 4]]).shape
    (2, 3)
    """
    points = np.asarray(vertices, dtype=np.float64)
    colors = position_colors(points)
    finite = np.isfinite(points).all(axis=1)
    if finite.any():
        spread = points[finite] - points[finite].min(axis=0)
        longest = spread[:, spread.max(axis=0).argmax()]
        stripes = np.cos(2 * np.pi * _STRIPES * longest / max(float(longest.max()), 1e-300))
        colors[finite] *= 1 - _STRIPE_DEPTH * (0.5 - 0.5 * np.tanh(3 * stripes))[:, None]
    return colors


def match_colors(
    source: MeshLike, target: MeshLike, match: Match | npt.ArrayLike
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Give corresponding points of both shapes one colour, for :func:`unbend.write_mesh`.

    Colours change with the place on the source, and faint stripes across it show small slips.
    What has no partner is grey.

    Parameters
    ----------
    source, target : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    match : Match or (n_source,) array_like of int
        From source to target; or the target vertex of each source vertex, -1 where there is none.

    Returns
    -------
    source_colors : (n_source, 3) ndarray of uint8
    target_colors : (n_target, 3) ndarray of uint8

    Raises
    ------
    InputError
        If the map does not fit the shapes.

    Examples
    --------
    >>> from unbend.report import match_colors
    >>> from unbend.datasets import make_sphere
    >>> ball = make_sphere(1)
    >>> ours, theirs = match_colors(ball, ball, range(42))
    >>> bool((ours == theirs).all())
    True
    """
    source, target = as_mesh(source), as_mesh(target)
    colors = pattern_colors(used_vertices(source))
    carried = transfer(colors, match, kind="scalar", source=source, target=target)
    if len(carried) != target.n_vertices:
        raise InputError(
            f"the map has {len(carried)} rows, but {target.name} has {target.n_vertices} vertices"
        )
    carried[np.isnan(carried)] = _NO_PARTNER
    colors[as_point_map(match) < 0] = _NO_PARTNER
    ours, theirs = (np.rint(255 * np.clip(one, 0, 1)) for one in (colors, carried))
    return ours.astype(np.uint8), theirs.astype(np.uint8)


def draw_match(
    source: MeshLike,
    target: MeshLike,
    match: Match | npt.ArrayLike,
    path: str | os.PathLike[str],
    *,
    up: str = "y",
    view: tuple[float, float] = (60.0, 15.0),
) -> None:
    """Write a picture of a match: corresponding points have the same colour.

    What has no partner is grey. Above, both shapes from the same side; below, from behind. The
    target is turned as a whole to fit the source through the map. A limb in the wrong colour is
    a limb matched to another; broken stripes are places where the map slips.

    Parameters
    ----------
    source, target : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    match : Match or (n_source,) array_like of int
        From source to target; or the target vertex of each source vertex, -1 where there is none.
    path : path
        The file to write; its ending decides the format (.png, .pdf, .svg).
    up : {"x", "y", "z"}, default="y"
        The source's axis that points upward.
    view : (azimuth, elevation), default=(60, 15)
        Of the upper pictures, in degrees; see :func:`unbend.report.figures.draw_mesh`.

    Raises
    ------
    InputError
        If the map does not fit, or there is no such axis.
    FileError
        If the file cannot be written.
    MissingExtraError
        If matplotlib is not installed.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from unbend.datasets import make_octopus
    >>> from unbend.report import draw_match
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "match.png")
    ...     draw_match(mesh, mesh, np.arange(600), path)
    ...     path.exists()
    True
    """
    source, target = drawable(source), drawable(target)
    colors, carried = (one / 255 for one in match_colors(source, target, match))
    check_up(up)
    upright = UPRIGHT[up]
    places = transfer(source.vertices, match, source=source, target=target)
    rotation, _ = fit_rigidly(target.vertices, places, reflect=False)
    turned = target.vertices @ rotation.T @ upright.T
    columns: list[tuple[str, Mesh, FloatArray]] = [
        (f"source: {source.name}", Mesh(source.vertices @ upright.T, source.faces), colors),
        (f"target: {target.name}", Mesh(turned, target.faces), carried),
    ]
    views = front_and_back(view)
    height = fitting_height(3.9, [mesh for _, mesh, _ in columns], views)
    total = 2 * height + 0.5  # inches
    figure = new_figure(8.0, total)
    for i, (caption, mesh, painted) in enumerate(columns):
        for row, seen_from in enumerate(views):
            below = (0.4 + (1 - row) * (height + 0.05)) / total
            ax = figure.add_axes((0.01 + 0.5 * i, below, 0.48, height / total))
            draw_mesh(ax, mesh, colors=painted, view=seen_from)
        figure.text(0.25 + 0.5 * i, 0.14 / total, as_written(caption), ha="center", fontsize=10)
    save_figure(figure, path)


def draw_error_curves(
    evaluations: Mapping[str, Evaluation], path: str | os.PathLike[str], *, title: str = ""
) -> None:
    """Write a picture of the share of points within each geodesic error.

    Parameters
    ----------
    evaluations : mapping of str to Evaluation
        By the name of each map. Where there is a mirrored ground truth, ``map-min`` is drawn too,
        dashed.
    path : path
        The file to write; its ending decides the format (.png, .pdf, .svg).
    title : str, default=""

    Raises
    ------
    InputError
        If there is nothing to draw.
    FileError
        If the file cannot be written.
    MissingExtraError
        If matplotlib is not installed.

    References
    ----------
    Yang, Obaseki & Chen (2019), Figure 2.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from unbend.datasets import make_sphere
    >>> from unbend import evaluate
    >>> from unbend.report import draw_error_curves
    >>> every = np.arange(162)
    >>> found = evaluate(every, make_sphere(2), every, every)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     draw_error_curves({"identity": found}, pathlib.Path(folder, "curves.png"))
    """
    if not evaluations:
        raise InputError("there are no evaluations to draw")
    figure = error_curves(evaluations)
    if title:
        figure.axes[0].set_title(as_written(title), fontsize=10)
    save_figure(figure, path)


def error_curves(evaluations: Mapping[str, Evaluation]) -> Any:
    """Draw the curves of :func:`draw_error_curves`, as a matplotlib figure."""
    figure = new_figure(5.2, 3.8)
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    for i, (given, found) in enumerate(evaluations.items()):
        name = as_written(given)
        label = f"{name}, mean {found.mean():.3f}"
        ax.plot(THRESHOLDS, found.curve(), color=f"C{i}", lw=1.8, marker=".", label=label)
        if found.map_min is not None:
            label = f"{name}, mirror allowed, mean {found.mean('map-min'):.3f}"
            ax.plot(THRESHOLDS, found.curve("map-min"), color=f"C{i}", lw=1.2, ls="--", label=label)
    ax.set(xlim=(0, 0.2), ylim=(0, 102))
    ax.set_xlabel("geodesic error / sqrt(target area)")
    ax.set_ylabel("points within that error, %")
    ax.grid(color="0.9")
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(loc="lower right", frameon=False, fontsize=9)
    return figure


def draw_similarities(
    names: Sequence[str], similarities: npt.ArrayLike, path: str | os.PathLike[str]
) -> None:
    """Write a heat map of how alike shapes are, the most alike beside each other.

    Parameters
    ----------
    names : sequence of str
        Of the n shapes.
    similarities : (n, n) array_like of float
        Symmetric; NaN where unknown.
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
    >>> from unbend.report import draw_similarities
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     draw_similarities(["cat", "dog"], [[1, 0.9], [0.9, 1]], pathlib.Path(folder, "a.png"))
    """
    table = np.asarray(similarities, dtype=np.float64)
    n = len(names)
    if table.shape != (n, n) or n == 0:
        raise InputError(f"{n} names need similarities of shape ({n}, {n}), not {table.shape}")
    order = join_alike(apart(table)).order if n > 2 else np.arange(n)
    table, labels = table[np.ix_(order, order)], [as_written(names[i]) for i in order]
    side = 1.2 + max(0.42, 2.0 / n) * n
    figure = new_figure(side + 1.0, side)
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    others = table[~np.eye(n, dtype=bool) & np.isfinite(table)]
    low = float(others.min()) if len(others) else 0.0
    picture = ax.imshow(table, cmap="viridis", vmin=min(low, 0.999), vmax=1.0)
    ax.set_xticks(range(n), labels, rotation=60, ha="right", rotation_mode="anchor", fontsize=8)
    ax.set_yticks(range(n), labels, fontsize=8)
    ax.tick_params(length=0)
    if n <= 20:
        middle = (low + 1) / 2
        digits = int(np.clip(np.ceil(-np.log10(max(1 - low, 1e-9) / 50)), 2, 4))
        for i, j in np.argwhere(np.isfinite(table)):
            ax.text(
                j, i, f"{table[i, j]:.{digits}f}", ha="center", va="center", fontsize=7,
                color="black" if table[i, j] > middle else "white",
            )  # fmt: skip
    bar = figure.colorbar(picture, ax=ax, fraction=0.05, pad=0.03)
    bar.set_label("similarity", fontsize=9)
    bar.ax.tick_params(labelsize=8)
    save_figure(figure, path)
