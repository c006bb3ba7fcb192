"""Rigid alignment of point sets in any dimension: Procrustes, and ICP over sign choices."""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from unbend._arrays import check_whole, is_number, nearest_rows, numbers_of, unit_of
from unbend._display import Brief
from unbend._parallel import one_blas_thread
from unbend._types import FloatArray, IntArray
from unbend.alignment._nearest import nearest_pairs
from unbend.errors import InputError, warn
from unbend.linalg.signs import fix_signs

_SIGNED_AXES = 8  # makes 256 starts; later axes keep their sign
_START_POINTS, _START_STEPS = 500, 10  # of the subset that starts are tried on
_FOLLOWED_STARTS, _REFINED_STARTS = 16, 4  # starts refined on the subset, and on all points
# Misfits, as shares of the shape's size, that agree to this many digits are equal.
_DIGITS = 8
# The source in sizes of the target: squares of more overflow single precision.
_LARGEST = 1e15
# Coordinates: sums of larger ones overflow.
_FARTHEST = 1e300


@dataclass(frozen=True, eq=False, repr=False)
class Alignment(Brief):
    """A rigid motion ``x -> rotation @ x + translation`` from source to target.

    Attributes
    ----------
    rotation : (d, d) ndarray of float64
        Orthogonal. Its determinant is -1 when the motion reflects.
    translation : (d,) ndarray of float64
    residuals : (n_iterations + 1,) ndarray of float64
        Symmetric root-mean-square distance, in the points' unit: before the first iteration,
        then after each.
    source_to_target : (n_source,) ndarray of int64
        Nearest target point to each moved source point.
    target_to_source : (n_target,) ndarray of int64
        Nearest moved source point to each target point.
    """

    rotation: FloatArray
    translation: FloatArray
    residuals: FloatArray
    source_to_target: IntArray
    target_to_source: IntArray

    @property
    def residual(self) -> float:
        """The last of `residuals`."""
        return float(self.residuals[-1])

    def apply(self, points: Any) -> FloatArray:
        """Move points (m, d) of the source to the target."""
        array = numbers_of(points, "points")
        if array.shape[-1:] != self.translation.shape:
            d = len(self.translation)
            raise InputError(f"points must have shape (m, {d}), not {array.shape}")
        return np.asarray(array @ self.rotation.T + self.translation)


def procrustes(
    source_points: Any, target_points: Any, *, weights: Any = None, reflect: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Rigid motion that brings points nearest to corresponding points, in least squares.

    Parameters
    ----------
    source_points, target_points : (n, d) array_like of float
        Row i corresponds to row i.
    weights : (n,) array_like of float, optional
        Weight of each pair, all equal by default. Pairs of weight 0 are ignored and may be NaN.
    reflect : bool, default=True
        Whether the motion may be a reflection (determinant -1).

    Returns
    -------
    rotation : (d, d) ndarray of float64
    translation : (d,) ndarray of float64
        ``source @ rotation.T + translation`` is nearest to the target.

    Raises
    ------
    InputError
        If the shapes differ or a point that counts is not finite.

    References
    ----------
    Schönemann, "A generalized solution of the orthogonal Procrustes problem", Psychometrika
    31(1), 1966; Kabsch, Acta Crystallographica A32, 1976 (without reflections).

    Examples
    --------
    >>> from unbend.alignment import procrustes
    >>> rotation, translation = procrustes([[0, 0], [1, 0], [0, 2]], [[1, 1], [1, 2], [-1, 1]])
    >>> rotation.round(6) + 0.0
    array([[ 0., -1.],
           [ 1.,  0.]])
    """
    mass = None if weights is None else numbers_of(weights, "weights")
    source, target = _points(source_points, "source", mass), _points(target_points, "target", mass)
    if source.shape != target.shape:
        raise InputError(
            f"corresponding points must have one shape, not {source.shape} and {target.shape}"
        )
    mass = np.ones(len(source)) if mass is None else mass
    if mass.shape != (len(source),) or not (mass >= 0).all() or not 0 < mass.sum() < np.inf:
        raise InputError(f"weights must be {len(source)} finite non-negative numbers, not all 0")
    counted = mass > 0
    source, target, mass = source[counted], target[counted], mass[counted] / mass.sum()
    source_center, target_center = mass @ source, mass @ target
    left, right = source - source_center, target - target_center
    cross = (left / unit_of(left) * mass[:, None]).T @ (right / unit_of(right))
    rotation = nearest_rotation(cross.T, reflect=reflect)
    return rotation, target_center - rotation @ source_center


def nearest_rotation(matrices: FloatArray, *, reflect: bool = False) -> FloatArray:
    """Rotations nearest to matrices (..., d, d), in the sum of squares.

    The rotation nearest to ``target.T @ source`` rotates the source onto the target. With
    `reflect`, it may be any orthogonal matrix.
    """
    left, _, right = np.linalg.svd(matrices)
    rotations: FloatArray = left @ right
    if not reflect:
        left[..., -1] *= np.sign(np.linalg.det(rotations))[..., None]
        rotations = left @ right
    return rotations


def largest_traces(matrices: FloatArray) -> FloatArray:
    """Largest trace (n,) that a rotation times each matrix (n, 3, 3) has.

    It is the sum of the singular values, the least taken negative if the determinant is. The
    greatest is found by Viète's formula; squares and product of the others follow from the
    cofactors and the determinant.
    """
    a, b, c = np.ascontiguousarray(matrices.transpose(1, 2, 0))  # rows of the matrices, (3, n) each
    minors = _cross(b, c), _cross(c, a), _cross(a, b)
    determinant = (a * minors[0]).sum(axis=0)
    squares = sum((one**2).sum(axis=0) for one in minors)
    diagonal = a**2 + b**2 + c**2
    size = diagonal.sum(axis=0) / 3
    is_zero = size < 1e-140
    size[is_zero] = 1
    on = diagonal / size - 1
    off = sum(row[[1, 2, 0]] * row[[2, 0, 1]] for row in (a, b, c)) / size
    spread = np.sqrt((on**2 + 2 * off**2).sum(axis=0) / 6)
    half = on.prod(axis=0) / 2 + off.prod(axis=0) - (on * off**2).sum(axis=0) / 2
    angle = np.arccos(np.clip(half / np.maximum(spread**3, 1e-300), -1, 1)) / 3
    greatest = size * (1 + 2 * spread * np.cos(angle))
    others = (squares - determinant**2 / greatest) / greatest
    both = others + 2 * determinant / np.sqrt(greatest)
    return np.where(is_zero, 0, np.sqrt(greatest) + np.sqrt(np.maximum(both, 0)))


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Cross products (3, n), several times as fast as NumPy's."""
    return np.asarray(one[[1, 2, 0]] * other[[2, 0, 1]] - one[[2, 0, 1]] * other[[1, 2, 0]])


@one_blas_thread()
def align(
    source_points: Any,
    target_points: Any,
    *,
    reflect: bool = True,
    max_iterations: int = 100,
    tolerance: float = 1e-6,
) -> Alignment:
    """Align two point sets by iterative closest points, from every choice of axis signs.

    The principal axes of both sets are aligned with every choice of signs of the first 8 axes.
    Each choice is tried on a subset of the points, and the best are refined on all of them. If
    several motions fit equally well, because the shape is symmetric, the first choice is taken.

    Parameters
    ----------
    source_points : (n_source, d) array_like of float
    target_points : (n_target, d) array_like of float
        In any dimension d; the counts may differ.
    reflect : bool, default=True
        Whether the motion may be a reflection. With False its determinant is +1.
    max_iterations : int, default=100
        Limit for the final iterations.
    tolerance : float, default=1e-6
        Stop when the residual falls by less than this share.

    Returns
    -------
    Alignment

    Raises
    ------
    InputError
        If the dimensions differ, a set is empty, something is not finite, or an option is out of
        range.

    Warns
    -----
    UnbendWarning
        If `max_iterations` end the search while the residual still falls.

    References
    ----------
    Besl & McKay, "A method for registration of 3-D shapes", IEEE TPAMI 14(2), 1992. The residual
    is symmetric: closest pairs of both directions count, each direction with the same weight.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend import align
    >>> points = np.random.default_rng(0).normal(size=(60, 3)) * [3, 2, 1]
    >>> align(points, -points + 5).residual < 1e-9
    True
    """
    source, target = _points(source_points, "source"), _points(target_points, "target")
    if source.shape[1] != target.shape[1]:
        raise InputError(
            f"points to align must have one dimension, not {source.shape[1]} and {target.shape[1]}"
        )
    check_whole(max_iterations, "max_iterations")
    if not is_number(tolerance) or not 0 <= tolerance < 1:
        raise InputError(f"tolerance must be at least 0 and below 1, not {tolerance!r}")
    centers = source.mean(axis=0), target.mean(axis=0)
    left, right = source - centers[0], target - centers[1]
    unit = unit_of(right)
    left, right = left / unit, right / unit
    if np.abs(left).max() > _LARGEST:
        raise InputError(
            f"the source is {np.abs(left).max():.0e} times as large as the target; bring both to "
            "one unit"
        )
    few = _subset(left), _subset(right)
    choices = np.array(_axis_choices(left, right, reflect))
    tried = nearest_pairs(few[0] @ choices.transpose(0, 2, 1), few[1]).residual
    refine = functools.partial(icp, reflect=reflect, tolerance=tolerance)
    starts = [
        refine(*few, choices[i], max_iterations=_START_STEPS)
        for i in np.sort(np.argsort(tried, kind="stable")[:_FOLLOWED_STARTS])
    ]
    size = float(np.linalg.norm(right, axis=1).max()) or 1.0

    def misfit(start: tuple[FloatArray, FloatArray, FloatArray]) -> float:
        return round(float(start[2][-1]) / size, _DIGITS)

    starts.sort(key=misfit)
    found = [
        refine(left, right, rotation, translation, max_iterations=max_iterations)
        for rotation, translation, _ in starts[:_REFINED_STARTS]
    ]
    rotation, translation, residuals = min(found, key=misfit)
    unsettled = len(residuals) > max_iterations > 0 and residuals[-2] > 0
    fall = 1 - residuals[-1] / residuals[-2] if unsettled else 0.0
    if fall > tolerance:
        warn(
            f"the alignment has not converged: its residual still fell by {fall:.1e} of itself in "
            f"the last of {max_iterations} iterations; allow more with max_iterations"
        )
    forward, backward, _ = _closest_points(left @ rotation.T + translation, right)
    return Alignment(
        rotation=rotation,
        translation=translation * unit + centers[1] - rotation @ centers[0],
        residuals=residuals * unit,
        source_to_target=forward,
        target_to_source=backward,
    )


def _points(points: Any, name: str, weights: FloatArray | None = None) -> FloatArray:
    array = numbers_of(points, f"{name} points")
    if array.ndim != 2 or 0 in array.shape:
        raise InputError(f"{name} points must have shape (n, d), not {array.shape}")
    if weights is not None and weights.shape == array.shape[:1]:
        array = np.where(weights[:, None] == 0, 0.0, array)
    infinite = ~np.isfinite(array).all(axis=1)
    if infinite.any():
        raise InputError(f"{name} point {infinite.argmax()} is not finite; leave such points out")
    if np.abs(array).max() > _FARTHEST:
        raise InputError(
            f"{name} points have coordinates of {np.abs(array).max():.0e}; give them in a sensible "
            "unit"
        )
    return array


def _subset(points: FloatArray) -> FloatArray:
    rows = np.unique(np.linspace(0, len(points) - 1, min(_START_POINTS, len(points))).astype(int))
    return np.asarray(points[rows])


def _axis_choices(source: FloatArray, target: FloatArray, reflect: bool) -> list[FloatArray]:
    """Rotations of principal axes onto principal axes, one for every choice of signs."""
    ours, theirs = _principal_axes(source), _principal_axes(target)
    d = len(ours)
    signed = min(d, _SIGNED_AXES)
    signs = itertools.product([1.0, -1.0], repeat=signed)
    choices = [theirs * (*some, *np.ones(d - signed)) @ ours.T for some in signs]
    return [one for one in choices if reflect or np.linalg.det(one) > 0]


def _principal_axes(points: FloatArray) -> FloatArray:
    """Principal axes as columns, the longest first; the points alone determine their signs."""
    axes = np.linalg.eigh(points.T @ points)[1][:, ::-1]
    along = points @ axes
    signs = np.sign((along * fix_signs(along, np.ones(len(points)))).sum(axis=0))
    return np.asarray(axes * np.where(signs < 0, -1.0, 1.0))


def icp(
    source: FloatArray,
    target: FloatArray,
    rotation: FloatArray,
    translation: FloatArray | None = None,
    *,
    reflect: bool = True,
    max_iterations: int = 100,
    tolerance: float = 1e-6,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Run ICP from one start, an orthogonal matrix and a translation; :func:`align` tries many.

    Returns the rotation, the translation and the residuals, as in :class:`Alignment`.
    """
    if translation is None:
        translation = np.zeros(source.shape[1])
    forward, backward, residual = _closest_points(source @ rotation.T + translation, target)
    residuals = [residual]
    weights = np.repeat([0.5 / len(source), 0.5 / len(target)], [len(source), len(target)])
    for _ in range(max_iterations):
        left = np.concatenate([source, source[backward]])
        right = np.concatenate([target[forward], target])
        rotation, translation = procrustes(left, right, weights=weights, reflect=reflect)
        forward, backward, residual = _closest_points(source @ rotation.T + translation, target)
        residuals.append(residual)
        if residuals[-2] - residual <= tolerance * residuals[-2]:
            break
    return rotation, translation, np.array(residuals)


def _closest_points(source: FloatArray, target: FloatArray) -> tuple[IntArray, IntArray, float]:
    """Nearest neighbours in both directions, and their symmetric root mean square distance."""
    forward, backward = nearest_rows(source, target), nearest_rows(target, source)
    ahead = ((source - target[forward]) ** 2).sum(axis=1)
    back = ((target - source[backward]) ** 2).sum(axis=1)
    return forward, backward, float(np.sqrt((ahead.mean() + back.mean()) / 2))
