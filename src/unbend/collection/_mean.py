"""The mean of many shapes, and how they vary, on the vertices of a template."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from unbend._arrays import is_number, listed
from unbend._display import Brief
from unbend._types import FloatArray, StrPath
from unbend.alignment import procrustes
from unbend.collection._files import make_folder
from unbend.collection._rows import Failure
from unbend.collection._statistics import Statistics, shape_statistics
from unbend.correspondence import Registration, warn_of_units
from unbend.errors import InputError, MissingExtraError
from unbend.io import MeshLike, as_mesh, value_colors, write_mesh, write_table
from unbend.mesh import Mesh, vertex_areas

_DEVIATIONS, _MOST_DRAWN = 3, 5  # standard deviations up to which components are shown; how many


@dataclass(frozen=True, eq=False, repr=False)
class MeanShape(Brief):
    """Statistics of shapes, on the vertices of a template.

    Attributes
    ----------
    template : Mesh
    statistics : Statistics
        Of the shapes that count, in the order of `names`.
    names : tuple of str
    confidences, coverages : (n_shapes,) ndarray of float64
        Of their registrations.
    left_out : tuple of Failure
        The other shapes, and why.
    """

    template: Mesh
    statistics: Statistics
    names: tuple[str, ...]
    confidences: FloatArray
    coverages: FloatArray
    left_out: tuple[Failure, ...]

    @property
    def mean(self) -> Mesh:
        """The mean shape, with the template's faces."""
        return Mesh(self.statistics.mean, self.template.faces, name="mean")

    def at(self, component: int, deviations: float) -> Mesh:
        """Move the mean along a component (from 0) by standard deviations; a mesh."""
        points = self.statistics.at(component, deviations)
        name = f"component {component + 1} at {deviations:+g}"
        return Mesh(points, self.template.faces, name=name)


def mean_shape(
    registrations: Iterable[Registration],
    template: MeshLike,
    *,
    n_components: int | None = None,
    scale: bool = False,
    min_confidence: float = 0.5,
    min_coverage: float = 0.5,
) -> MeanShape:
    """Mean, principal components and variability of shapes, on the vertices of a template.

    Shapes that do not match the template well are left out and listed. For vertices that correspond
    already, see :func:`shape_statistics`.

    Parameters
    ----------
    registrations : iterable of Registration
        Of the template to each shape, by :func:`unbend.register`, or in files by
        :meth:`Collection.register` and :func:`read_registrations`.
    template : mesh-like
        A shape of the same kind, in about the same pose.
    n_components, scale
        See :func:`shape_statistics`. Points are weighted by their area on the template.
    min_confidence : float, default=0.5
        Least confidence of a match. Registrations along maps that were given have none, and stay.
    min_coverage : float, default=0.5
        Least share of the template's area that must lie on the shape.

    Returns
    -------
    MeanShape

    Raises
    ------
    InputError
        If a registration is not of this template, or fewer than 2 shapes are left; the message
        says why the first was left out.

    Warns
    -----
    UnbendWarning
        If sizes are kept, and one is more than five times another.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend import Mesh, register
    >>> from unbend.collection import mean_shape
    >>> from unbend.datasets import make_sphere
    >>> template = make_sphere(2)
    >>> same = np.arange(template.n_vertices)  # without a map, register looks for one
    >>> eggs = [Mesh(template.vertices * [1, 1, height], template.faces) for height in (1.2, 1.4)]
    >>> found = mean_shape([register(template, egg, same) for egg in eggs], template)
    >>> found.mean, found.left_out
    (Mesh(162 vertices, 320 faces), ())
    """
    for name, share in (("min_confidence", min_confidence), ("min_coverage", min_coverage)):
        if not is_number(share) or not 0 <= share <= 1:
            raise InputError(f"{name} must be from 0 to 1, not {share!r}")
    template = as_mesh(template)
    kept: list[Registration] = []
    left_out: list[Failure] = []
    for one in listed(registrations, "registrations"):
        if not isinstance(one, Registration):
            raise InputError(f"mean_shape needs Registrations, not {type(one).__name__}")
        same = one.mesh.n_vertices == template.n_vertices
        if not same or not np.array_equal(one.mesh.faces, template.faces):
            raise InputError(f"{one.mesh.name}: is not registered to {template.name}")
        if one.confidence < min_confidence:
            reason = f"the match's confidence is {one.confidence:.4g}, less than {min_confidence:g}"
        elif one.coverage < min_coverage:
            covered = f"{100 * one.coverage:.4g}% of the template lies on it"
            reason = f"{covered}, less than {100 * min_coverage:g}%"
        else:
            kept.append(one)
            continue
        left_out.append(Failure(one.mesh.name, reason))
    if len(kept) < 2:
        why = f"; {left_out[0].path} was left out: {left_out[0].reason}" if left_out else ""
        raise InputError(f"statistics need at least 2 shapes, and {len(kept)} are left{why}")
    weights = vertex_areas(template)
    placed = np.empty((len(kept), *template.vertices.shape))
    for i, points in enumerate(one.mesh.vertices for one in kept):
        # As the template is, so that the mean is, too.
        turn, _ = procrustes(points, template.vertices, weights=weights, reflect=False)
        placed[i] = points @ turn.T
    statistics = shape_statistics(placed, weights=weights, n_components=n_components, scale=scale)
    names = tuple(one.mesh.name for one in kept)
    advice = "use one, or remove sizes with scale=True (--scale)"
    if scale:
        advice = "use one, or none of the sizes"
    warn_of_units(statistics.sizes, names, advice)
    confidences = np.array([one.confidence for one in kept])
    coverages = np.array([one.coverage for one in kept])
    return MeanShape(template, statistics, names, confidences, coverages, tuple(left_out))


def write_mean(folder: StrPath, found: MeanShape) -> tuple[Path, ...]:
    """Write a mean shape, its components and its tables into a folder.

    Parameters
    ----------
    folder : path
        Made if it does not exist.
    found : MeanShape

    Returns
    -------
    tuple of Path
        What was written. The picture only where matplotlib is installed.

    Raises
    ------
    FileError
        If something cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from unbend import Mesh, register
    >>> from unbend.collection import mean_shape, write_mean
    >>> from unbend.datasets import make_sphere
    >>> ball = make_sphere(2)
    >>> same = np.arange(ball.n_vertices)
    >>> eggs = [Mesh(ball.vertices * [1, 1, height], ball.faces) for height in (1.2, 1.4)]
    >>> found = mean_shape([register(ball, egg, same) for egg in eggs], ball)
    >>> [path.name for path in write_mean(tempfile.mkdtemp(), found)[:3]]
    ['mean.ply', 'component_1_minus.ply', 'component_1_plus.ply']
    """
    if not isinstance(found, MeanShape):
        raise InputError(f"write_mean needs a MeanShape, not a {type(found).__name__}")
    folder = make_folder(folder)
    statistics = found.statistics
    k = len(statistics.variances)
    spread = statistics.variability
    colors = value_colors(spread, limits=(0, float(np.nanmax(spread))))
    written = [folder / "mean.ply"]
    write_mesh(written[0], found.mean, scalars={"variability": spread}, colors=colors)
    for i in range(k):
        for word, deviations in (("minus", -_DEVIATIONS), ("plus", _DEVIATIONS)):
            written.append(folder / f"component_{i + 1}_{word}.ply")
            write_mesh(written[-1], found.at(i, deviations))
    shares = statistics.variances / max(statistics.total_variance, 1e-300)
    variances = zip(range(1, k + 1), statistics.variances.tolist(), shares.tolist(), strict=True)
    columns = statistics.sizes, found.confidences, found.coverages, statistics.scores
    scores = zip(found.names, np.column_stack(columns).tolist(), strict=True)
    heads = "path", "size", "confidence", "coverage", *(f"score_{i + 1}" for i in range(k))
    tables: dict[str, list[Iterable[object]]] = {
        "variances.csv": [("component", "variance", "share"), *variances],
        "scores.csv": [heads, *((name, *row) for name, row in scores)],
        "left_out.csv": [("path", "reason"), *((one.path, one.reason) for one in found.left_out)],
    }
    for name, rows in tables.items():
        written.append(folder / name)
        write_table(written[-1], rows)
    picture = folder / "components.png"
    picture.unlink(missing_ok=True)  # of an earlier mean
    if k:
        with suppress(MissingExtraError):
            draw_components(found, picture)
            written.append(picture)
    for old in folder.glob("component_*_*.ply"):  # of an earlier mean with more components
        if re.fullmatch(r"component_\d+_(minus|plus)\.ply", old.name) and old not in written:
            old.unlink()
    return tuple(written)


def draw_components(found: MeanShape, path: Path) -> None:
    """Draw the mean as it changes along each of the first components."""
    from unbend.report.shape_figures import draw_variation

    steps = np.linspace(-_DEVIATIONS, _DEVIATIONS, 5).tolist()
    shares = found.statistics.variances[:_MOST_DRAWN] / found.statistics.total_variance
    rows = [
        (f"component {i + 1}: {share:.0%}", [found.at(i, step) for step in steps])
        for i, share in enumerate(shares)
    ]
    draw_variation(rows, [f"{step:+g} SD" if step else "mean" for step in steps], path)
