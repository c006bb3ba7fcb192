"""Statistics over many shapes: their mean, principal components and variability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from unbend._arrays import check_whole, is_number, is_whole, numbers_of
from unbend._display import Brief
from unbend._types import FloatArray
from unbend.alignment import procrustes
from unbend.errors import InputError, warn

_ROUNDS = 100
_SETTLED = 1e-9
_LEAST_SIZE, _MOST_SIZE = 1e-60, 1e60  # whose fourth powers double precision can hold
_NOTHING = 1e-12  # a component with less of the mean's own extent, squared, is rounding


@dataclass(frozen=True, eq=False, repr=False)
class Statistics(Brief):
    """Mean and variation of shapes whose points correspond.

    Attributes
    ----------
    mean : (n, 3) ndarray of float64
        The arithmetic mean of the shapes after fitting, with its centre of area at the origin. The
        more they differ, the smaller it is. NaN where a point of weight 0 has no position.
    components : (k, n, 3) ndarray of float64
        How the mean moves for one standard deviation along each principal component. From the
        largest variance down; towards the positive side a shape grows rather than shrinks.
    variances : (k,) ndarray of float64
        The mean square, by area, of how far a point moves for one standard deviation.
    total_variance : float
        Of all components, kept or not.
    scores : (n_shapes, k) ndarray of float64
        Where each shape lies along each component, in standard deviations.
    variability : (n,) ndarray of float64
        Standard deviation of each point: the square root of its summed squared distances from its
        place in the mean, divided by ``n_shapes - 1``, as the variances are.
    sizes : (n_shapes,) ndarray of float64
        Size of each shape before fitting: the root mean square distance of its points, by weight,
        from their centre. With equal weights this is the centroid size over ``sqrt(n)``.
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
        count = len(self.components)
        if not is_whole(component) or not 0 <= component < count:
            raise InputError(f"there is no component {component!r}; there are {count}, from 0")
        if not is_number(deviations):
            raise InputError(f"deviations must be a number, not {deviations!r}")
        return np.asarray(self.mean + deviations * self.components[component])


def shape_statistics(
    shapes: npt.ArrayLike,
    *,
    weights: npt.ArrayLike | None = None,
    n_components: int | None = None,
    scale: bool = False,
) -> Statistics:
    """Mean, principal components and variability of shapes whose points correspond.

    Every shape is rigidly fitted to the mean of all until convergence (generalised Procrustes
    analysis).

    Parameters
    ----------
    shapes : (n_shapes, n, 3) array_like of float
        Row i of each is the same point.
    weights : (n,) array_like of float, optional
        Weight of each point, vertex areas for instance. Default: all equal. A point of weight 0
        does not count, and may lie anywhere or be NaN.
    n_components : int, optional
        How many components to keep; by default all, one less than there are shapes.
    scale : bool, default=False
        Whether to remove differences in size: every shape is first scaled to the mean of `sizes`.

    Returns
    -------
    Statistics

    Raises
    ------
    InputError
        If there are fewer than 2 shapes, or something does not fit or is not finite.

    Warns
    -----
    UnbendWarning
        If the mean does not converge.

    References
    ----------
    Gower, "Generalized Procrustes analysis", Psychometrika 40(1), 1975; Dryden & Mardia,
    "Statistical shape analysis", 2nd edition, Wiley 2016, chapters 2 (centroid size) and 7
    (partial Procrustes fits: equal sizes, and no scaling beyond that).

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
    points = numbers_of(shapes, "shapes")
    if points.ndim != 3 or points.shape[2] != 3:
        raise InputError(f"shapes must have shape (n_shapes, n, 3), not {points.shape}")
    if len(points) < 2:
        raise InputError("statistics need at least 2 shapes")
    most = len(points) - 1
    kept = most if n_components is None else n_components
    check_whole(kept, "n_components", 1)
    n = points.shape[1]
    mass = np.ones(n) if weights is None else numbers_of(weights, "weights").copy()
    if mass.shape != (n,) or not (mass >= 0).all() or not 0 < mass.sum() < np.inf:
        raise InputError(f"weights must be {n} finite non-negative numbers, not all 0")
    counted = mass > 0
    share = mass[counted] / mass.sum()
    infinite = ~np.isfinite(points).all(axis=2)
    if (infinite & counted).any():
        shape, point = np.argwhere(infinite & counted)[0]
        raise InputError(f"shape {shape}: point {point} is not finite; give it weight 0 or a place")
    adrift = ~counted & ~(np.abs(points) < _MOST_SIZE).all(axis=2)
    points = points - (share @ points[:, counted])[:, None]
    points[adrift] = np.nan
    with np.errstate(over="ignore"):
        sizes = np.sqrt(np.einsum("v,svk->s", share, points[:, counted] ** 2))
    if not (sizes > 0).all():
        raise InputError(f"shape {int(sizes.argmin())} is a single point")
    wrong = ~((sizes > _LEAST_SIZE) & (sizes < _MOST_SIZE))
    if wrong.any():
        raise InputError(
            f"shape {int(wrong.argmax())} has a size of {sizes[wrong.argmax()]:.0e}; give "
            f"coordinates in a unit in which that is between {_LEAST_SIZE:g} and {_MOST_SIZE:g}"
        )
    if scale:
        points *= (sizes.mean() / sizes)[:, None, None]
    mean = _fit_together(points, mass)
    points -= mean
    variability = np.sqrt(np.einsum("svd,svd->v", points, points) / most)

    # As many numbers as shapes decide: the eigenvectors of their inner products.
    rows = (points[:, counted] * np.sqrt(share / most)[:, None]).reshape(len(points), -1)
    values, shares = np.linalg.eigh(rows @ rows.T)
    values, shares = values[::-1], shares[:, ::-1]
    extent = float(share @ (mean[counted] ** 2).sum(axis=1))
    real = min(kept, most, int((values > _NOTHING * extent).sum()))
    values, shares = values[:real], shares[:, :real]
    components = np.einsum("sk,svd->kvd", shares, points) / np.sqrt(most)
    outward = np.einsum("v,kvd,vd->k", share, components[:, counted], mean[counted])
    signs = np.where(outward < 0, -1.0, 1.0)
    return Statistics(
        mean=mean,
        components=components * signs[:, None, None],
        variances=values,
        total_variance=float(np.vdot(rows, rows)),
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
        inner, change = mean[mass > 0], (mean - before)[mass > 0]
        moved = float(np.sqrt((change**2).sum() / (inner**2).sum()))
        if moved <= _SETTLED:
            return mean
    warn(
        f"the mean still moves by {moved:.1e} of its size after {_ROUNDS} rounds: the shapes may "
        "be too unlike each other to have one"
    )
    return mean
