"""One picture of a mesh, a form, a match or an evaluation."""

from __future__ import annotations

from typing import Any

import numpy as np

from unbend.canonical import CanonicalForm
from unbend.correspondence import Evaluation
from unbend.io import MeshLike, as_mesh
from unbend.matching import Match
from unbend.mesh import used_vertices
from unbend.report.colors import position_colors
from unbend.report.figures import draw_mesh, new_figure
from unbend.report.match_figures import error_curves
from unbend.report.shape_figures import in_space


def plot(thing: MeshLike | CanonicalForm | Match | Evaluation) -> Any:
    """Draw a result with matplotlib; notebooks show the figure, ``savefig`` writes it.

    A mesh as it looks, a form as its points, a match as its functional map, an evaluation as the
    share of points within each error.

    Parameters
    ----------
    thing : mesh-like, CanonicalForm, Match or Evaluation

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If it is none of these.
    MissingExtraError
        If matplotlib is not installed.

    Examples
    --------
    >>> from unbend import plot
    >>> from unbend.datasets import make_sphere
    >>> len(plot(make_sphere(2)).axes)
    1
    """
    if isinstance(thing, Evaluation):
        return error_curves({"map": thing})
    figure = new_figure(5, 4.4 if isinstance(thing, Match) else 5)
    if isinstance(thing, Match):
        ax = figure.add_subplot()
        most = float(np.abs(thing.functional_map).max()) or 1.0
        picture = ax.imshow(thing.functional_map, cmap="RdBu", vmin=-most, vmax=most)
        ax.set(xlabel="eigenfunction of the target", ylabel="eigenfunction of the source")
        figure.colorbar(picture, ax=ax)
    elif isinstance(thing, CanonicalForm):
        ax = figure.add_subplot(aspect="equal")
        points = in_space(thing.points)
        order = np.argsort(points[:, 2])
        ax.scatter(*points[order, :2].T, s=3, c=position_colors(points)[order])
        ax.set(xlabel="first coordinate")
        if thing.points.shape[1] > 1:
            ax.set(ylabel="second coordinate")
    else:
        mesh = as_mesh(thing)
        ax = figure.add_axes((0, 0, 1, 1))
        colors = position_colors(used_vertices(mesh))
        if mesh.is_point_cloud:
            ax.scatter(*mesh.vertices[:, :2].T, s=2, c=colors)
            ax.set_aspect("equal")
            ax.set_axis_off()
        else:
            draw_mesh(ax, mesh, colors=colors)
    return figure
