"""Pictures of matches and of their errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._arrays import numbers_of
from unbend._types import FloatArray, StrPath
from unbend.correspondence import THRESHOLDS, Evaluation, as_point_map, carry
from unbend.errors import InputError
from unbend.io import MeshLike, as_mesh
from unbend.matching import Match
from unbend.mesh import Mesh, used_vertices
from unbend.report.colors import places_in_box, position_colors
from unbend.report.figures import (
    FRONT_AND_BACK,
    as_written,
    draw_grid,
    drawable,
    fit_rigidly,
    fitting_height,
    new_figure,
    save_figure,
    upright,
)

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
    points = numbers_of(vertices, "vertices")
    colors = position_colors(points)
    finite = np.isfinite(points).all(axis=1)
    if finite.any():
        along = places_in_box(points[finite])[:, 0]
        stripes = np.cos(2 * np.pi * _STRIPES * along)
        colors[finite] *= 1 - _STRIPE_DEPTH * (0.5 - 0.5 * np.tanh(3 * stripes))[:, None]
    return colors


def is_symmetry(source: object, target: object, match: object) -> bool:
    """Tell whether a match leads a shape to itself, turned inside out."""
    return source is target and isinstance(match, Match) and match.orientation < 0


def match_colors(
    source: MeshLike, target: MeshLike, match: Match | npt.ArrayLike
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Give corresponding points of both shapes one colour, for :func:`unbend.write_mesh`.

    These are the :func:`pattern_colors` of the source. What has no partner is grey.

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
    source, target = as_mesh(source, "source"), as_mesh(target, "target")
    colors = pattern_colors(used_vertices(source))
    carried = carry(colors, match, "scalar", source, target)
    carried[np.isnan(carried)] = _NO_PARTNER
    colors[as_point_map(match) < 0] = _NO_PARTNER
    ours, theirs = (np.rint(255 * np.clip(one, 0, 1)) for one in (colors, carried))
    return ours.astype(np.uint8), theirs.astype(np.uint8)


def draw_match(
    source: MeshLike,
    target: MeshLike,
    match: Match | npt.ArrayLike,
    path: StrPath,
    *,
    up: str = "y",
) -> None:
    """Write a picture of a match: corresponding points have the same colour.

    What has no partner is grey. Above, both shapes from the same side; below, from behind. The
    target is turned as a whole to fit the source through the map, unless they are one object and
    its :func:`unbend.symmetry`. A limb in the wrong colour is
    a limb matched to another; broken stripes are places where the map slips.

    Parameters
    ----------
    source, target, match
        As for :func:`match_colors`.
    path : path
        The file to write; its ending decides the format (.png, .pdf, .svg).
    up : {"x", "y", "z"}, default="y"
        The source's axis that points upward.

    Raises
    ------
    InputError, FileError, MissingExtraError
        If the map does not fit, there is no such axis, the file cannot be written, or matplotlib is
        not installed.

    Examples
    --------
    >>> from unbend.datasets import make_octopus
    >>> from unbend.report import draw_match
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> draw_match(mesh, mesh, range(600), "match.png")
    """
    mirror = is_symmetry(source, target, match)
    source, target = drawable(source), drawable(target)
    colors = [one / 255 for one in match_colors(source, target, match)]
    turn = upright(up)
    rotation = np.eye(3)
    if not mirror:
        places = carry(source.vertices, match, "scalar", source, target)
        rotation, _ = fit_rigidly(target.vertices, places, reflect=False)
    meshes = [
        Mesh(source.vertices @ turn.T, source.faces),
        Mesh(target.vertices @ rotation.T @ turn.T, target.faces),
    ]
    height = fitting_height(3.9, meshes, FRONT_AND_BACK)
    rows = [
        [(mesh.vertices, mesh, one, view) for mesh, one in zip(meshes, colors, strict=True)]
        for view in FRONT_AND_BACK
    ]
    captions = [f"source: {source.name}", f"target: {target.name}"]
    figure, _ = draw_grid(rows, captions, 4.0, height)
    save_figure(figure, path)


def draw_error_curves(evaluations: Mapping[str, Evaluation], path: StrPath) -> None:
    """Write a picture of the share of points within each geodesic error.

    Parameters
    ----------
    evaluations : mapping of str to Evaluation
        By the name of each map. Where there is a mirrored ground truth, ``map-min`` is drawn too,
        dashed.
    path : path
        As for :func:`draw_match`.

    Raises
    ------
    InputError, FileError, MissingExtraError
        If there is nothing to draw, something is no Evaluation, the file cannot be written, or
        matplotlib is not installed.

    References
    ----------
    Yang, Obaseki & Chen (2019), Figure 2.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from unbend import evaluate
    >>> from unbend.report import draw_error_curves
    >>> found = evaluate(range(162), make_sphere(2), range(162), range(162))
    >>> draw_error_curves({"identity": found}, "curves.png")
    """
    if not isinstance(evaluations, Mapping) or not evaluations:
        raise InputError("give evaluations by their names, as {'ours': ...}, one at least")
    for name, one in evaluations.items():
        if not isinstance(one, Evaluation):
            raise InputError(f"{name}: an Evaluation is drawn, not {type(one).__name__}")
    save_figure(error_curves(evaluations), path)


def error_curves(evaluations: Mapping[str, Evaluation]) -> Any:
    """Draw the curves of :func:`draw_error_curves`, as a matplotlib figure."""
    figure = new_figure(5.2, 3.8)
    figure.set_layout_engine("constrained")
    x, y = "geodesic error / sqrt(target area)", "points within that error, %"
    ax = figure.add_subplot(xlim=(0, 0.2), ylim=(0, 102), xlabel=x, ylabel=y)
    for i, (given, found) in enumerate(evaluations.items()):
        name = as_written(given)
        label = f"{name}, mean {found.mean():.3f}"
        ax.plot(THRESHOLDS, found.curve(), color=f"C{i}", lw=1.8, marker=".", label=label)
        if found.map_min is not None:
            label = f"{name}, mirror allowed, mean {found.mean('map-min'):.3f}"
            ax.plot(THRESHOLDS, found.curve("map-min"), color=f"C{i}", lw=1.2, ls="--", label=label)
    ax.grid(color="0.9")
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(loc="lower right", frameon=False, fontsize=9)
    return figure
