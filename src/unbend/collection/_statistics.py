"""Statistics over shapes whose points correspond: mean, principal components, variability.

Generalised Procrustes analysis (Gower, "Generalized Procrustes analysis", Psychometrika 40, 1975;
Dryden & Mardia, "Statistical shape analysis", Wiley 2016): every shape is moved rigidly, and
scaled where sizes do not matter, to fit their mean, and the mean is taken anew.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from unbend._arrays import is_whole
from unbend._types import FloatArray, Progress
from unbend.alignment import procrustes
from unbend.correspondence import register
from unbend.errors import InputError, UnbendError
from unbend.io import MeshLike, as_mesh
from unbend.mesh import Mesh, vertex_areas

_ROUNDS = 100
_SETTLED = 1e-9
# A component below this share of the variance of all is rounding.
_NOTHING = 1e-12


@dataclass(frozen=True, eq=False)
class Statistics:
    """Mean and variation of shapes whose points correspond.

    Attributes
    ----------
    mean : (n, 3) ndarray of float64
        The mean shape. Its centre of area is at the origin; without sizes it has the mean size.
    components : (k, n, 3) ndarray of float64
        The principal components: how the mean moves for one standard deviation along each. From
        the largest variance down; towards the positive side a shape grows rather than shrinks.
    variances : (k,) ndarray of float64
        Variance along each component, by area: the mean square of how far a point moves for one
        standard deviation, in the squared unit of length.
    total_variance : float
        Of all components, kept or not.
    scores : (n_shapes, k) ndarray of float64
        Where each shape lies along each component, in standard deviations.
    variability : (n,) ndarray of float64
        Root mean square distance of each point from its place in the mean.
    sizes : (n_shapes,) ndarray of float64
        Of each shape before: the root mean square distance of its points, by area, from their
        middle.
    """

    mean: FloatArray
    components: FloatArray
    variances: FloatArray
    total_variance: float
    scores: FloatArray
    variability: FloatArray
    sizes: FloatArray

    def at(self, component: int, deviations: float) -> FloatArray:
        """Points (n, 3) of the mean moved along a component by standard deviations."""
        if not is_whole(component) or not 0 <= component < len(self.components):
            raise InputError(
                f"there is no component {component!r}; there are {len(self.components)}, from 0"
            )
        moved: FloatArray = self.mean + deviations * self.components[component]
        return moved


@dataclass(frozen=True, eq=False)
class LeftOut:
    """A shape that statistics were taken without.

    Attributes
    ----------
    name : str
    reason : str
    """

    name: str
    reason: str


@dataclass(frozen=True, eq=False)
class MeanShape:
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
    left_out : tuple of LeftOut
        The others, and why.
    """

    template: Mesh
    statistics: Statistics
    names: tuple[str, ...]
    confidences: FloatArray
    coverages: FloatArray
    left_out: tuple[LeftOut, ...]

    @property
    def mean(self) -> Mesh:
        """The mean shape, with the template's faces."""
        return self._mesh(self.statistics.mean, "mean")

    def at(self, component: int, deviations: float) -> Mesh:
        """Return the mean moved along a component by standard deviations, as a mesh."""
        points = self.statistics.at(component, deviations)
        return self._mesh(points, f"component {component + 1} at {deviations:+g}")

    def _mesh(self, points: FloatArray, name: str) -> Mesh:
        return Mesh(points, self.template.faces, name=name)


def shape_statistics(
    shapes: npt.ArrayLike,
    *,
    weights: npt.ArrayLike | None = None,
    n_components: int | None = None,
    scale: bool = False,
) -> Statistics:
    """Mean, principal components and variability of shapes whose points correspond.

    Parameters
    ----------
    shapes : (n_shapes, n, 3) array_like of float
        Row i of each is the same point.
    weights : (n,) array_like of float, optional
        What each point counts, vertex areas say. Default: all alike.
    n_components : int, optional
        How many components to keep; by default all, one less than there are shapes.
    scale : bool, default=False
        Whether sizes are taken out too: form is then the same for a child and a giant.

    Returns
    -------
    Statistics

    Raises
    ------
    InputError
        If there are fewer than 2 shapes, or something does not fit or is not finite.

    References
    ----------
    Gower, "Generalized Procrustes analysis", Psychometrika 40(1), 1975; Dryden & Mardia,
    "Statistical shape analysis", 2nd edition, Wiley 2016, chapters 7 and 8.

    Examples
    --------
    Eggs that differ in length alone, turned anyhow:

    >>> import numpy as np
    >>> from unbend.collection import shape_statistics
    >>> from unbend.datasets import make_sphere
    >>> ball = make_sphere(2).vertices
    >>> eggs = [ball * [1, 1, length] for length in (1.1, 1.2, 1.3)]
    >>> eggs[1] = eggs[1] @ [[0, 1, 0], [0, 0, 1], [1, 0, 0]] + 5
    >>> found = shape_statistics(eggs)
    >>> np.abs(found.scores[:, 0]).round(3)
    array([1., 0., 1.])
    >>> bool(found.variances[0] > 0.999 * found.total_variance)
    True
    """
    points = np.array(shapes, dtype=np.float64)
    if points.ndim != 3 or points.shape[2] != 3 or not np.isfinite(points).all():
        raise InputError(f"shapes must be finite, of shape (n_shapes, n, 3), not {points.shape}")
    if len(points) < 2:
        raise InputError("statistics need at least 2 shapes")
    most = len(points) - 1
    kept = most if n_components is None else n_components
    if not is_whole(kept) or kept < 1:
        raise InputError(f"n_components must be at least 1, not {n_components!r}")
    n = points.shape[1]
    mass = np.ones(n) if weights is None else np.array(weights, dtype=np.float64)
    if mass.shape != (n,) or not (mass >= 0).all() or not 0 < mass.sum() < np.inf:
        raise InputError(f"weights must be {n} finite non-negative numbers, not all 0")
    mass /= mass.sum()

    points -= (mass @ points)[:, None]
    sizes = np.sqrt(np.einsum("v,svk,svk->s", mass, points, points))
    if not (sizes > 0).all():
        raise InputError(f"shape {int(sizes.argmin())} is a single point")
    if scale:
        points *= (sizes.mean() / sizes)[:, None, None]
    mean = _fit_together(points, mass)
    offsets = points - mean
    variability = np.sqrt((offsets**2).sum(axis=(0, 2)) / most)

    # As many numbers as shapes decide: the eigenvectors of their inner products.
    rows = (offsets * np.sqrt(mass / most)[:, None]).reshape(len(points), -1)
    values, shares = np.linalg.eigh(rows @ rows.T)
    values, shares = values[::-1], shares[:, ::-1]
    extent = float(mass @ (mean**2).sum(axis=1))
    real = min(kept, most, int((values > _NOTHING * extent).sum()))
    values, shares = values[:real], shares[:, :real]
    components = np.einsum("sk,svd->kvd", shares, offsets) / np.sqrt(most)
    outward = np.einsum("v,kvd,vd->k", mass, components, mean)
    signs = np.where(outward < 0, -1.0, 1.0)
    return Statistics(
        mean=mean,
        components=components * signs[:, None, None],
        variances=values,
        total_variance=float((rows**2).sum()),
        scores=shares * signs * np.sqrt(most),
        variability=variability,
        sizes=sizes,
    )


def _fit_together(points: FloatArray, mass: FloatArray) -> FloatArray:
    """Turn centred shapes (s, n, 3), in place, until they fit their mean; return the mean."""
    mean: FloatArray = points[0].copy()
    for _ in range(_ROUNDS):
        for i, shape in enumerate(points):
            turn, _ = procrustes(shape, mean, weights=mass, reflect=False)
            points[i] = shape @ turn.T
        before, mean = mean, points.mean(axis=0)
        if ((mean - before) ** 2).sum() <= _SETTLED**2 * (mean**2).sum():
            break
    return mean


def mean_shape(
    meshes: Iterable[MeshLike],
    template: MeshLike,
    *,
    names: Sequence[str] | None = None,
    n_components: int | None = None,
    scale: bool = False,
    min_confidence: float = 0.5,
    min_coverage: float = 0.5,
    cache: bool = True,
    progress: Progress | None = None,
) -> MeanShape:
    """Mean, principal components and variability of shapes, on the vertices of a template.

    Every shape is given the template's vertices by :func:`unbend.register`. Shapes that do not
    match it are left out and listed.

    Parameters
    ----------
    meshes : iterable of mesh-like
        One after the other; only their registrations are kept.
    template : mesh-like
        A shape of the same kind, in about the same pose. What counts is its vertices.
    names : sequence of str, optional
        Of the shapes; by default the meshes' own.
    n_components, scale
        See :func:`shape_statistics`. Points count by their area on the template.
    min_confidence : float, default=0.5
        A match less sure than this is no basis for statistics.
    min_coverage : float, default=0.5
        Least share of the template's area that must lie on the shape.
    cache : bool, default=True
        Whether a match keeps eigenpairs on disk; see :func:`unbend.spectrum`.
    progress : callable, optional
        Called with a shape's name and the share of all that is done.

    Returns
    -------
    MeanShape

    Raises
    ------
    InputError
        If fewer than 2 shapes are left; the message says why the first was left out.
    MeshError
        If the template cannot be used.

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
    template = as_mesh(template)
    shapes = list(meshes) if names is None else meshes
    found, kept, left_out = [], [], []
    for i, given in enumerate(shapes):
        name = names[i] if names is not None else ""
        try:
            mesh = as_mesh(given)
            name = name or mesh.name
            if progress is not None:
                total = len(names) if names is not None else len(shapes)  # type: ignore[arg-type]
                progress(name, i / total)
            one = register(template, mesh, cache=cache)
        except UnbendError as error:
            left_out.append(LeftOut(name or f"shape {i}", str(error)))
            continue
        if one.confidence < min_confidence:
            left_out.append(LeftOut(name, f"the match's confidence is {one.confidence:.2f}"))
        elif one.coverage < min_coverage:
            left_out.append(LeftOut(name, f"{one.coverage:.0%} of the template lies on it"))
        else:
            found.append(one)
            kept.append(name)
    if len(found) < 2:
        why = f"; {left_out[0].name} was left out: {left_out[0].reason}" if left_out else ""
        raise InputError(f"statistics need at least 2 shapes, and {len(found)} is left{why}")
    statistics = shape_statistics(
        [_turned(one.mesh.vertices, template.vertices) for one in found],
        weights=vertex_areas(template),
        n_components=n_components,
        scale=scale,
    )
    return MeanShape(
        template,
        statistics,
        tuple(kept),
        np.array([one.confidence for one in found]),
        np.array([one.coverage for one in found]),
        tuple(left_out),
    )


def _turned(points: FloatArray, template: FloatArray) -> FloatArray:
    """Turn a registered shape as the template stands, so that the mean stands so too."""
    return np.asarray(points @ procrustes(points, template, reflect=False)[0].T)
