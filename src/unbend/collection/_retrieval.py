"""How well a search by distance finds the shapes of a class: the field's measures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._arrays import array_of, numbers_of
from unbend._display import Brief
from unbend._types import FloatArray
from unbend.errors import InputError

# The first page of results that the E-measure looks at.
_FIRST_PAGE = 32
# Shares of a class found at which precision is told.
_RECALL_LEVELS = np.arange(1, 21) / 20


@dataclass(frozen=True, eq=False, repr=False)
class Retrieval(Brief):
    """How well shapes of a class are found, as means over all queries; fractions, 1 is best.

    Of a query, R other shapes are of its class.

    Attributes
    ----------
    nearest_neighbor : float
        How often the nearest shape is of the query's class.
    first_tier, second_tier : float
        Share of the R that are among the nearest R, and among the nearest 2 R.
    e_measure : float
        Harmonic mean of precision and recall among the nearest 32 (or all, where there are fewer).
        Classes smaller than 33 cannot reach 1.
    dcg : float
        Discounted cumulative gain: a shape of the class counts 1 at the ranks 1 and 2, 1 / log2(i)
        at rank i; over the most that R shapes can reach.
    map : float
        Mean average precision: of the precisions at the ranks of the R, the mean.
    recall, precision : (20,) ndarray of float64
        The precision-recall curve: at the rank where 5 %, 10 %, ..., 100 % of the R are found,
        the share of what is found so far that is of the class.
    n_queries : int
        Queries of which another shape of their class is there; only they count.
    """

    nearest_neighbor: float
    first_tier: float
    second_tier: float
    e_measure: float
    dcg: float
    map: float
    recall: FloatArray
    precision: FloatArray
    n_queries: int

    def to_dict(self) -> dict[str, Any]:
        """Return everything as numbers and lists, ready for JSON."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in values.items()
        }


def retrieval_measures(
    distances: npt.ArrayLike,
    labels: Sequence[Any] | npt.ArrayLike,
    query_labels: Sequence[Any] | npt.ArrayLike | None = None,
) -> Retrieval:
    """Measure how well distances find the shapes of a class.

    Parameters
    ----------
    distances : (n_queries, n) array_like of float
        From each query to each shape. NaN: the shape is left out of this query's list, as a shape
        itself should be where the query is a damaged copy of it. Of shapes at one distance, the
        first comes first.
    labels : (n,) array_like
        The class of each shape.
    query_labels : (n_queries,) array_like, optional
        The class of each query. By default the queries are the shapes themselves, and none finds
        itself.

    Returns
    -------
    Retrieval

    Raises
    ------
    InputError
        If the sizes do not fit, or no query has another shape of its class.

    References
    ----------
    Shilane, Min, Kazhdan & Funkhouser, "The Princeton Shape Benchmark", SMI 2004. The gain is
    divided by what the R shapes that can be found would reach, so that a perfect list has 1.

    Examples
    --------
    Two cats at 0 and 1, two dogs at 3 and 4.5, on a line:

    >>> import numpy as np
    >>> from unbend.collection import retrieval_measures
    >>> places = np.array([0, 1, 3, 4.5])
    >>> found = retrieval_measures(abs(places[:, None] - places), ["cat", "cat", "dog", "dog"])
    >>> found.nearest_neighbor, found.second_tier
    (1.0, 1.0)
    """
    matrix = numbers_of(distances, "distances").copy()
    classes = array_of(labels, "labels")
    asked = classes if query_labels is None else array_of(query_labels, "query_labels")
    if classes.ndim != 1 or asked.ndim != 1:
        raise InputError("labels must be lists, with one label for each shape")
    if matrix.shape != (len(asked), len(classes)):
        raise InputError(
            f"distances of shape {matrix.shape} do not fit {len(asked)} queries and "
            f"{len(classes)} shapes"
        )
    if query_labels is None:
        np.fill_diagonal(matrix, np.nan)
    rows = [_of_query(*pair) for pair in zip(matrix, asked[:, None] == classes, strict=True)]
    kept = np.array([row for row in rows if row is not None])
    if not len(kept):
        raise InputError("no shape has another one of its class: there is nothing to find")
    means = kept.mean(axis=0)
    nearest, first, second, e_measure, dcg, mean_precision = means[:6].tolist()
    return Retrieval(
        nearest_neighbor=nearest,
        first_tier=first,
        second_tier=second,
        e_measure=e_measure,
        dcg=dcg,
        map=mean_precision,
        recall=_RECALL_LEVELS.copy(),
        precision=means[6:],
        n_queries=len(kept),
    )


def _of_query(distances: FloatArray, alike: npt.NDArray[np.bool_]) -> FloatArray | None:
    """Measures of one query, then its precisions; None where there is nothing to find."""
    listed = np.flatnonzero(~np.isnan(distances))
    order = listed[np.argsort(distances[listed], kind="stable")]
    ranks = np.flatnonzero(alike[order]) + 1
    n = len(ranks)
    if not n:
        return None
    count = np.arange(1, n + 1)
    page = min(_FIRST_PAGE, len(order))
    precisions = count / ranks
    levels = np.ceil(_RECALL_LEVELS * n - 1e-9).astype(int) - 1
    measures = [
        ranks[0] == 1,
        (ranks <= n).sum() / n,
        (ranks <= 2 * n).sum() / n,
        2 * (ranks <= page).sum() / (page + n),
        _gains(ranks).sum() / _gains(count).sum(),
        precisions.mean(),
    ]
    return np.concatenate([measures, precisions[levels]])


def _gains(ranks: npt.NDArray[np.int64]) -> FloatArray:
    return np.asarray(1 / np.log2(np.maximum(ranks, 2)))
