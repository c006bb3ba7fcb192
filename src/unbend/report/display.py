"""What meshes, forms, matches and evaluations look like in a notebook."""

from __future__ import annotations

import math
from functools import singledispatch
from typing import Any

import numpy as np

from unbend.canonical import CanonicalForm
from unbend.correspondence import THRESHOLDS, Evaluation
from unbend.matching import Match
from unbend.mesh import Mesh, used_vertices
from unbend.report.figures import draw_mesh, new_figure, position_colors
from unbend.report.match_figures import error_curves
from unbend.report.pages import mesh_page, table

__all__ = ["figure_of", "html_of"]


@singledispatch
def html_of(thing: Any) -> str:
    """Show something as HTML: a mesh as it turns, all else as a table.

    Parameters
    ----------
    thing : Mesh, CanonicalForm, Match or Evaluation

    Returns
    -------
    str

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from unbend.report.display import html_of
    >>> html_of(make_sphere(2)).startswith("<iframe")
    True
    """
    raise TypeError(f"nothing is known of how a {type(thing).__name__} looks")


@singledispatch
def figure_of(thing: Any) -> Any:
    """Draw something with matplotlib.

    A mesh as it looks, a form as its points, a match as its functional map, an evaluation as the
    share of points within each error.

    Parameters
    ----------
    thing : Mesh, CanonicalForm, Match or Evaluation

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from unbend.report.display import figure_of
    >>> len(figure_of(make_sphere(2)).axes)
    1
    """
    raise TypeError(f"nothing is known of how a {type(thing).__name__} looks")


@html_of.register
def _(mesh: Mesh) -> str:
    if mesh.is_point_cloud:
        return table([("point cloud", mesh.name), ("points", f"{mesh.n_vertices:,}")])
    return mesh_page(mesh)._repr_html_()


@figure_of.register
def _(mesh: Mesh) -> Any:
    figure = new_figure(5, 5)
    ax = figure.add_axes((0, 0, 1, 1))
    colors = position_colors(used_vertices(mesh))
    if mesh.is_point_cloud:
        ax.scatter(mesh.vertices[:, 0], mesh.vertices[:, 1], s=2, c=colors)
        ax.set_aspect("equal")
        ax.set_axis_off()
    else:
        draw_mesh(ax, mesh, colors=colors)
    return figure


@html_of.register
def _(form: CanonicalForm) -> str:
    n, d = form.points.shape
    rows = [
        ("canonical form", f"{n:,} points in {d} dimensions"),
        ("distance", f"{form.distance}, {form.method}, {form.weighting} weights"),
        ("eigenvalues", ", ".join(f"{value:.4g}" for value in form.eigenvalues[:8])),
        ("stress", f"{form.stress:.3f}"),
        ("done to the input", "; ".join(form.notes) or "nothing"),
    ]
    return table(rows)


@figure_of.register
def _(form: CanonicalForm) -> Any:
    figure = new_figure(5, 5)
    ax = figure.add_subplot()
    points = np.zeros((len(form.points), 3))
    d = min(form.points.shape[1], 3)
    points[:, :d] = form.points[:, :d]
    order = np.argsort(points[:, 2])
    ax.scatter(*points[order, :2].T, s=3, c=position_colors(points)[order])
    ax.set_aspect("equal")
    ax.set(xlabel="first coordinate", ylabel="second coordinate")
    return figure


@html_of.register
def _(match: Match) -> str:
    matched, n = int((match.source_to_target >= 0).sum()), len(match.source_to_target)
    unknown = math.isnan(match.confidence)
    rows = [
        ("match", f"{matched:,} of {n:,} vertices, to {len(match.target_to_source):,}"),
        ("confidence", "not estimated" if unknown else f"{match.confidence:.2f}"),
        ("orientation", f"{match.orientation:+.2f}"),
        ("residual", f"{match.residual:.3f}"),
        *(
            (f"hypothesis {i + 1}", f"energy {one.energy:.4f}, orientation {one.orientation:+.2f}")
            for i, one in enumerate(match.hypotheses[:5])
        ),
    ]
    return table(rows)


@figure_of.register
def _(match: Match) -> Any:
    figure = new_figure(5, 4.4)
    ax = figure.add_subplot()
    most = float(np.abs(match.functional_map).max()) or 1.0
    picture = ax.imshow(match.functional_map, cmap="RdBu", vmin=-most, vmax=most)
    ax.set(xlabel="eigenfunction of the target", ylabel="eigenfunction of the source")
    figure.colorbar(picture, ax=ax)
    return figure


@html_of.register
def _(found: Evaluation) -> str:
    protocols = ["direct"] + ["map-min", "vertex-min"] * (found.map_min is not None)
    rows = [
        (
            name,
            f"{found.mean(name):.4f}",
            f"{found.median(name):.4f}",
            *(f"{found.curve(name)[i]:.1f} %" for i in (4, 8)),
        )
        for name in protocols
    ]
    within = [f"within {THRESHOLDS[i]:g}" for i in (4, 8)]
    return table(rows, ("protocol", "mean error", "median", *within))


@figure_of.register
def _(found: Evaluation) -> Any:
    return error_curves({"map": found})
