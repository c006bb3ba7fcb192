"""The mean of many shapes, and how they vary, on the vertices of a template."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from unbend._arrays import is_number
from unbend._display import Brief
from unbend._types import FloatArray, Progress
from unbend.alignment import procrustes
from unbend.collection._engine import engine
from unbend.collection._progress import counted
from unbend.collection._rows import Failure
from unbend.collection._statistics import Statistics, shape_statistics
from unbend.correspondence import register
from unbend.errors import InputError
from unbend.io import MeshLike, as_mesh
from unbend.mesh import Mesh, vertex_areas


@dataclass(frozen=True, eq=False, repr=False)
class MeanShape(Brief):
    """Statistics of shapes, on the vertices of a template.

    Attributes
    ----------
    template : Mesh
    statistics : Statistics
        Of the shapes that count, in their order.
    names : tuple of str
        Of these shapes.
    confidences, coverages : (n_shapes,) ndarray of float64
        Of their registrations.
    left_out : tuple of Failure
        The others, and why.
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


class Task(NamedTuple):
    """A shape to register the template to."""

    number: int
    mesh: MeshLike
    template: Mesh


class Registered(NamedTuple):
    """The template's vertices on a shape."""

    name: str
    vertices: FloatArray
    confidence: float
    coverage: float


def mean_shape(
    meshes: Iterable[MeshLike],
    template: MeshLike,
    *,
    n_components: int | None = None,
    scale: bool = False,
    min_confidence: float = 0.5,
    min_coverage: float = 0.5,
    workers: int | None = 0,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> MeanShape:
    """Mean, principal components and variability of shapes, on the vertices of a template.

    Every shape is given the template's vertices by :func:`unbend.register`. Shapes that do not
    match it are left out and listed.

    Parameters
    ----------
    meshes : iterable of mesh-like
        Files, best, which the workers read themselves; or meshes.
    template : mesh-like
        A shape of the same kind, in about the same pose. What counts is its vertices.
    n_components, scale
        See :func:`shape_statistics`. Points count by their area on the template.
    min_confidence : float, default=0.5
        A match less sure than this is no basis for statistics.
    min_coverage : float, default=0.5
        Least share of the template's area that must lie on the shape.
    workers : int or None, default=0
        Local processes; None: as many as the machine has processors for; 0: work in this one.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:port``, whose workers to use.
    progress : callable, optional
        Called with how far it is, in words, and the share that is done.

    Returns
    -------
    MeanShape

    Raises
    ------
    InputError
        If fewer than 2 shapes are left; the message says why the first was left out.
    MeshError
        If the template cannot be used.
    MissingExtraError
        If there are to be workers and Dask is not installed.

    See Also
    --------
    shape_statistics : The same for vertices that correspond already.

    Examples
    --------
    >>> from unbend.collection import mean_shape
    >>> from unbend.datasets import make_biped
    >>> people = [make_biped("standing", n_vertices=500, legs=legs).mesh for legs in (0.9, 1.1)]
    >>> found = mean_shape(people, make_biped("standing", n_vertices=500).mesh)
    >>> found.mean, found.left_out
    (Mesh(500 vertices, 996 faces), ())
    """
    for name, share in (("min_confidence", min_confidence), ("min_coverage", min_coverage)):
        if not is_number(share) or not 0 <= share <= 1:
            raise InputError(f"{name} must be from 0 to 1, not {share!r}")
    template = as_mesh(template)
    if template.is_point_cloud:
        raise InputError(f"{template.name}: a template needs faces, and this is a point cloud")
    tasks = [Task(i, mesh, template) for i, mesh in enumerate(meshes)]
    rows: dict[int, Registered | Failure] = {}
    tell = counted(progress, "shapes", len(tasks))
    if scheduler is not None and workers == 0:
        workers = None
    with engine(workers=workers, scheduler=scheduler) as run:
        for outcomes in run(register_to, tasks):
            for task, found, reason in outcomes:
                rows[task.number] = found or Failure(_name(task), reason or "")
            tell(len(rows), 0, sum(isinstance(one, Failure) for one in rows.values()))
    every = [_checked(rows[i], min_confidence, min_coverage) for i in range(len(tasks))]
    kept = [one for one in every if not isinstance(one, Failure)]
    left_out = tuple(one for one in every if isinstance(one, Failure))
    if len(kept) < 2:
        why = f"; {left_out[0].path} was left out: {left_out[0].reason}" if left_out else ""
        raise InputError(f"statistics need at least 2 shapes, and {len(kept)} are left{why}")
    weights = vertex_areas(template)
    # Aligned with the template, so that the mean is, too.
    placed = [
        one.vertices
        @ procrustes(one.vertices, template.vertices, weights=weights, reflect=False)[0].T
        for one in kept
    ]
    return MeanShape(
        template=template,
        statistics=shape_statistics(
            placed, weights=weights, n_components=n_components, scale=scale
        ),
        names=tuple(one.name for one in kept),
        confidences=np.array([one.confidence for one in kept]),
        coverages=np.array([one.coverage for one in kept]),
        left_out=left_out,
    )


def register_to(task: Task) -> Registered | Failure:
    """Register the template to a shape; any error becomes the shape's failure."""
    name = _name(task)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = register(task.template, as_mesh(task.mesh))
    except Exception as error:  # of any kind: other shapes go on
        return Failure.of(name, error)
    return Registered(name, found.mesh.vertices, found.confidence, found.coverage)


def _checked(
    one: Registered | Failure, min_confidence: float, min_coverage: float
) -> Registered | Failure:
    if isinstance(one, Failure):
        return one
    if one.confidence < min_confidence:
        said = f"the match's confidence is {one.confidence:.4g}, less than {min_confidence:g}"
        return Failure(one.name, said)
    if one.coverage < min_coverage:
        said = f"{100 * one.coverage:.4g}% of the template lies on it, less than"
        return Failure(one.name, f"{said} {100 * min_coverage:g}%")
    return one


def _name(task: Task) -> str:
    if isinstance(task.mesh, (str, os.PathLike)):
        return os.fspath(task.mesh)
    return task.mesh.name if isinstance(task.mesh, Mesh) else f"shape {task.number}"
