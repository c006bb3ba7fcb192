"""Pictures of meshes for papers and reports, drawn with matplotlib and no display."""

from __future__ import annotations

import functools
import io
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._arrays import check_choice, numbers_of
from unbend._text import plural, printable
from unbend._types import FloatArray, StrPath
from unbend.alignment import procrustes
from unbend.errors import InputError, MissingExtraError
from unbend.io import MeshLike, as_mesh, atomic_write, check_writable
from unbend.mesh import Mesh, used_vertices
from unbend.preparation import triangulate_points
from unbend.report.colors import position_colors
from unbend.report.raster import rasterize, view_rotation

# Formats of pictures, and the metadata that keeps matplotlib from writing the time into them.
_UNDATED = {".png": {}, ".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
# Pixels added to the outline of canonical forms, whose limbs are thin as threads.
FORM_THICKER = 2.5
# Views from which all of a shape is seen: azimuth and elevation in degrees.
FRONT_AND_BACK = ((60.0, 15.0), (240.0, 15.0))
_UPRIGHT = {
    "x": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "y": np.eye(3),
    "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
}
_BELOW = 0.4  # inches for captions


def new_figure(width: float, height: float, *, dpi: float = 150) -> Any:
    """Make a blank white figure that needs no display and touches no global state.

    Parameters
    ----------
    width, height : float
        In inches.
    dpi : float, default=150
        Pixels per inch.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    MissingExtraError, InputError
        If matplotlib is not installed, or its settings are wrong.

    Examples
    --------
    >>> from unbend.report import new_figure
    >>> new_figure(4, 3).dpi
    150
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib") from None
    except ValueError as error:
        raise InputError(f"matplotlib does not start; is MPLBACKEND set? {error}") from None

    figure: Any = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    # What notebooks ask for, which have not set matplotlib up themselves.
    figure._repr_png_ = functools.partial(_png, figure)
    return figure


def _png(figure: Any) -> bytes:
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue()


def draw_mesh(
    ax: Any,
    mesh: MeshLike,
    *,
    colors: Any = None,
    view: str | tuple[float, float] = "three-quarter",
) -> None:
    """Draw a lit, smoothly shaded mesh into an axes, at equal scale and without ticks.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Its place in the figure decides the resolution; the shape fills it.
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts. Vertices that are not finite are left out. y is up.
    colors : (n,) or (n, 3) array_like, optional
        Per vertex: a number (drawn with the viridis colours from the least to the greatest, or from
        blue to red if there are both signs; grey where not finite) or red, green and blue from 0 to
        1. None: clay.
    view : str or (azimuth, elevation), default="three-quarter"
        ``"front"``, ``"side"``, ``"back"``, ``"top"``, ``"three-quarter"`` or two angles in
        degrees: 0, 0 looks at the shape's face (along -z), 90, 0 at its left side, and an elevation
        of 90 from above.

    Raises
    ------
    InputError
        If the view is unknown, or the colours do not fit the vertices.

    Examples
    --------
    >>> from unbend.datasets import make_octopus
    >>> from unbend.report import draw_mesh, new_figure, position_colors
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> ax = new_figure(1, 1).add_subplot()
    >>> draw_mesh(ax, mesh, colors=position_colors(mesh.vertices), view="front")
    """
    mesh = drawable(mesh)
    draw_places(ax, mesh.vertices, mesh, colors, view)


def draw_canonical_forms(
    columns: Sequence[tuple[Any, ...]],
    path: StrPath,
    *,
    canonical_view: str | tuple[float, float] = "front",
) -> None:
    """Write a picture of shapes above their canonical forms, like Figure 1 of the paper.

    Parameters
    ----------
    columns : sequence of (caption, original, canonical[, colors[, surface]])
        The shapes, left to right: a mesh, the points (n, 3) of its form, colours as for
        :func:`draw_mesh` (by default those of the first column, or by position), and perhaps the
        surface in the form's pose (n, 3), drawn below it, for all columns or for none. Forms are
        drawn thicker, as by :func:`draw_form`.
    path : path
        The file to write; its ending decides the format (.png, .pdf, .svg).
    canonical_view : str or (azimuth, elevation), default="front"
        Of the row of forms, as for :func:`draw_mesh`.

    Raises
    ------
    InputError, FileError, MissingExtraError
        If there are no columns, a canonical form does not fit its original, the file cannot be
        written, or matplotlib is not installed.

    References
    ----------
    Yang, Obaseki and Chen (2019), Figure 1.

    Examples
    --------
    >>> from unbend.datasets import make_octopus
    >>> from unbend.report import draw_canonical_forms
    >>> shape = make_octopus(n_vertices=600)
    >>> draw_canonical_forms([("octopus", shape.mesh, shape.rest)], "figure.png")
    """
    if not columns:
        raise InputError("a figure of canonical forms needs at least one column")
    filled = [(*column, None, None)[:5] for column in columns]
    if len({surface is None for *_, surface in filled}) > 1:
        raise InputError("give the surface in the form's pose for all columns or for none")
    cells: list[list[tuple[Any, ...]]] = []
    first_colors: Any = None
    for caption, original, canonical, colors, surface in filled:
        mesh = drawable(original)
        if colors is None and first_colors is not None and len(first_colors) == mesh.n_vertices:
            colors = first_colors
        elif colors is None:
            colors = position_colors(used_vertices(mesh))
        if first_colors is None:
            first_colors = colors
        points = _places(canonical, mesh, f"the canonical form of {caption!r}")
        column = [
            (mesh.vertices, mesh, colors),
            (points, mesh, colors, canonical_view, FORM_THICKER),
        ]
        if surface is not None:
            column.append((_places(surface, mesh, f"the surface of {caption!r}"), mesh, colors))
        cells.append(column)
    captions = [caption for caption, *_ in filled]
    figure, axes = draw_grid(list(zip(*cells, strict=True)), captions, 2.4, 2.4)
    for row in axes:
        same_scale(row)
    save_figure(figure, path)


def _places(given: Any, mesh: Mesh, what: str) -> FloatArray:
    points = numbers_of(given, what)
    if points.shape != mesh.vertices.shape:
        raise InputError(
            f"{what} has shape {points.shape}, but its original has "
            f"{plural(mesh.n_vertices, 'vertex')}"
        )
    return points


def draw_grid(
    rows: Sequence[Sequence[tuple[Any, ...]]],
    captions: Sequence[str],
    width: float,
    height: float,
    *,
    above: float = 0.05,
    right: float = 0.0,
) -> tuple[Any, list[list[Any]]]:
    """Draw rows of pictures, with a caption below each column: the figure and its axes.

    A picture is what :func:`draw_places` takes after the axes. Sizes are in inches: of a picture,
    and of what is left free above each and to the right of all.
    """
    across, tall = width * len(captions) + right, (height + above) * len(rows) + _BELOW
    figure = new_figure(across, tall)
    axes: list[list[Any]] = []
    for i, row in enumerate(rows):
        bottom = _BELOW + (height + above) * (len(rows) - 1 - i)
        axes.append([])
        for j, picture in enumerate(row):
            left = width * (j + 0.02)
            place = (left / across, bottom / tall, 0.96 * width / across, height / tall)
            axes[i].append(figure.add_axes(place))
            draw_places(axes[i][j], *picture)
    for j, caption in enumerate(captions):
        middle = width * (j + 0.5) / across
        figure.text(middle, 0.14 / tall, as_written(caption), ha="center", fontsize=10)
    return figure, axes


def as_written(name: str) -> str:
    """Escape a name for matplotlib, which reads text between dollars as a formula."""
    return printable(name).replace("$", r"\$")


def save_figure(figure: Any, path: StrPath) -> None:
    """Write a figure to a file that is either complete or not there.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : path
        The file to write or replace: .png, .pdf or .svg.

    Raises
    ------
    FileError
        If the folder does not exist or cannot be written, or the ending is not one of these.

    Examples
    --------
    >>> from unbend.report import new_figure, save_figure
    >>> save_figure(new_figure(1, 1), "blank.png")
    """
    from matplotlib import rc_context

    suffix = check_writable(path, tuple(_UNDATED)).suffix.lower()
    # Neither the time nor chance: the same picture is the same file.
    with atomic_write(path) as file, rc_context({"svg.hashsalt": "unbend"}):
        figure.savefig(file, format=suffix[1:], metadata=_UNDATED[suffix])


def upright(up: str) -> FloatArray:
    """Rotation of a shape's upward axis to the picture's, y; InputError if there is no such."""
    check_choice(up, "up", _UPRIGHT)
    return _UPRIGHT[up]


def check_values(values: npt.ArrayLike, mesh: Mesh) -> FloatArray:
    """Numbers (n,), NaN where there is no face or none that is finite; InputError if none is."""
    array = numbers_of(values, "values")
    check_one_each(array, mesh)
    drawn = np.full(mesh.n_vertices, np.nan)
    drawn[mesh.faces] = array[mesh.faces]
    drawn[np.isinf(drawn)] = np.nan
    if np.isnan(drawn).all():
        raise InputError("none of the values on faces is finite: there is nothing to draw")
    return drawn


def check_one_each(values: npt.NDArray[Any], mesh: Mesh) -> None:
    """Raise InputError if there is not one value for each vertex."""
    if values.shape != (mesh.n_vertices,):
        raise InputError(
            f"{mesh.name} needs one value for each of {plural(mesh.n_vertices, 'vertex')}, but "
            f"values have shape {values.shape}"
        )


def fit_rigidly(
    points: FloatArray, places: FloatArray, *, reflect: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Rotation and translation that fit points (n, 3) to places, by the rows finite in both.

    The identity if there are fewer than three such rows.
    """
    both = (np.isfinite(points) & np.isfinite(places)).all(axis=1)
    if both.sum() < 3:
        return np.eye(3), np.zeros(3)
    return procrustes(points[both], places[both], reflect=reflect)


def drawable(shape: MeshLike) -> Mesh:
    """Return a mesh, or a point cloud with triangles between its points."""
    mesh = as_mesh(shape)
    return triangulate_points(mesh) if mesh.is_point_cloud else mesh


def fitting_height(
    width: float, meshes: Sequence[Mesh], views: Sequence[tuple[float, float]]
) -> float:
    """Height of pictures so wide that each of the meshes fills them from each of the views.

    At most the width, and at least a quarter of it.
    """
    shares = []
    for mesh, view in itertools.product(meshes, views):
        seen = used_vertices(mesh) @ view_rotation(view).T
        across, up, _ = np.ptp(seen[np.isfinite(seen).all(axis=1)], axis=0)
        shares.append(up / max(across, np.finfo(float).tiny))
    return width * float(np.clip(max(shares), 0.25, 1))


def draw_places(
    ax: Any,
    vertices: FloatArray,
    mesh: Mesh,
    colors: Any,
    view: str | tuple[float, float] = "three-quarter",
    thicker: float = 0.0,
) -> None:
    """Draw a mesh with its vertices at other positions, its outline some pixels thicker."""
    box = ax.get_window_extent()
    size = max(16, int(box.width)), max(16, int(box.height))
    picture, extent = rasterize(vertices, mesh.faces, colors, size, view, thicker)
    smooth = {"interpolation": "bilinear", "interpolation_stage": "rgba"}
    ax.imshow(picture, extent=extent, origin="lower", **smooth)
    ax.set_aspect("equal")
    ax.set_axis_off()


def same_scale(axes: Sequence[Any]) -> None:
    """Give axes with meshes of one size in the figure the same span, so that sizes compare.

    Parameters
    ----------
    axes : sequence of matplotlib.axes.Axes

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from unbend.report import draw_mesh, new_figure, same_scale
    >>> ball = make_sphere(2)
    >>> axes = new_figure(2, 1).subplots(1, 2)
    >>> for ax, size in zip(axes, (1, 2)):
    ...     draw_mesh(ax, (size * ball.vertices, ball.faces))
    >>> same_scale(axes)
    >>> bool(axes[0].get_xlim()[1] == axes[1].get_xlim()[1])
    True
    """
    limits = [(ax.get_xlim(), ax.get_ylim()) for ax in axes]
    span_x = max(x[1] - x[0] for x, _ in limits) / 2
    span_y = max(y[1] - y[0] for _, y in limits) / 2
    for ax, (x, y) in zip(axes, limits, strict=True):
        ax.set_xlim(sum(x) / 2 - span_x, sum(x) / 2 + span_x)
        ax.set_ylim(sum(y) / 2 - span_y, sum(y) / 2 + span_y)
