"""Classes of shapes, and how well a search finds them: the field's measures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._arrays import array_of, numbers_of
from unbend._display import Brief
from unbend._types import FloatArray, StrPath
from unbend.errors import FileError, InputError, warn
from unbend.io import as_path, read_table

_FIRST_PAGE = 32  # of results, which the E-measure looks at
_RECALL_LEVELS = np.arange(1, 21) / 20  # shares of a class found at which precision is told


@dataclass(frozen=True, eq=False, repr=False)
class Retrieval(Brief):
    """How well shapes of a class are found, as means over all queries; fractions, 1 is best.

    R is the number of other shapes of a query's class.

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
        Mean average precision: the mean of the precisions at the ranks of the R.
    recall, precision : (20,) ndarray of float64
        The precision-recall curve: where 5 %, 10 %, ..., 100 % of the R are found, the share of
        what is found so far that is of the class.
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
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in vars(self).items()
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
        From each query to each shape; of equals the first comes first. NaN leaves a shape out of
        the query's list, as it should be where the query is a damaged copy of it.
    labels : (n,) array_like
        The class of each shape; one whose label is None, as :func:`read_labels` gives it, or
        missing in a column of pandas (NaN, NA), is left out.
    query_labels : (n_queries,) array_like, optional
        Default: the queries are the shapes themselves, and none finds itself.

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
    >>> import numpy as np
    >>> from unbend.collection import retrieval_measures
    >>> places = np.array([0, 1, 3, 4.5])  # on a line
    >>> found = retrieval_measures(abs(places[:, None] - places), ["cat", "cat", "dog", "dog"])
    >>> found.nearest_neighbor, found.second_tier
    (1.0, 1.0)
    """
    matrix = numbers_of(distances, "distances").copy()
    classes = _classes(labels, "labels")
    asked = classes if query_labels is None else _classes(query_labels, "query_labels")
    if matrix.shape != (len(asked), len(classes)):
        raise InputError(
            f"distances of shape {matrix.shape} do not fit {len(asked)} queries and "
            f"{len(classes)} shapes"
        )
    if query_labels is None:
        np.fill_diagonal(matrix, np.nan)
    matrix[:, [label is None for label in classes]] = np.nan
    rows = [_of_query(*pair) for pair in zip(matrix, asked[:, None] == classes, strict=True)]
    kept = np.array([row for row in rows if row is not None])
    if not len(kept):
        raise InputError("no shape has another one of its class: there is nothing to find")
    means = kept.mean(axis=0)
    found: list[Any] = [*means[:6].tolist(), _RECALL_LEVELS.copy(), means[6:], len(kept)]
    return Retrieval(*found)


def _classes(labels: Sequence[Any] | npt.ArrayLike, what: str) -> npt.NDArray[Any]:
    """Turn labels into an array; what does not equal itself, as NaN, becomes None."""
    array = array_of(labels, what)
    if array.ndim != 1:
        raise InputError("labels must be lists, with one label for each shape")
    each = np.array(labels, dtype=object).tolist()  # the other array may have NaN as text
    alike = [label == label for label in each]  # pandas' NA is neither
    missing = [not isinstance(one, bool | np.bool_) or not one for one in alike]
    if any(missing):
        array = array.astype(object)
        array[missing] = None
    return array


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
    gains = 1 / np.log2(np.maximum(np.arange(len(order)) + 1, 2))
    levels = np.ceil(_RECALL_LEVELS * n - 1e-9).astype(int) - 1
    measures = [
        ranks[0] == 1,
        (ranks <= n).sum() / n,
        (ranks <= 2 * n).sum() / n,
        2 * (ranks <= page).sum() / (page + n),
        gains[ranks - 1].sum() / gains[:n].sum(),
        precisions.mean(),
    ]
    return np.concatenate([measures, precisions[levels]])


def read_labels(table: StrPath, shapes: Sequence[Sequence[str]]) -> list[str | None]:
    r"""Read the class of each shape.

    Parameters
    ----------
    table : path
        A CSV file with the columns path and label, in any order and among others. A path is meant
        from the folder we are in or from the table's; where nothing is there, it may be the end of
        a single shape's path (as `cats/cat0.off`).
    shapes : sequence of sequence of str
        The paths of each shape; a shape has several where files are identical.

    Returns
    -------
    list of str or None
        A label for each shape; None where the table has none, or different ones for its files.

    Raises
    ------
    FileError
        If the table cannot be read or lacks a column, if a path is that of no shape or of several,
        or a file has two labels.

    Warns
    -----
    UnbendWarning
        If files of one shape have different labels.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend.collection import read_labels
    >>> table = Path(tempfile.mkdtemp()) / "labels.csv"
    >>> _ = table.write_text("path,label\ncat0.off,cat\n")
    >>> read_labels(table, [["/shapes/cat0.off", "/copies/cat0.off"], ["/shapes/dog1.off"]])
    ['cat', None]
    """
    table = as_path(table)
    rows = read_table(table, ("path", "label"))
    files = {os.path.abspath(path): (i, path) for i, some in enumerate(shapes) for path in some}
    ends: dict[str, list[tuple[int, str]]] = {}
    for file in files.values():
        parts = Path(file[1]).parts
        for start in range(len(parts)):
            ends.setdefault("/".join(parts[start:]), []).append(file)
    labels: list[dict[str, str]] = [{} for _ in shapes]  # by path
    for line, (path, label) in enumerate(rows, start=2):
        places = (os.path.abspath(folder / path) for folder in (Path(), table.parent))
        found = [files[place] for place in places if place in files]
        found = found or ends.get("/".join(Path(path).parts), [])
        if len({i for i, _ in found}) != 1:
            what = "several shapes" if found else "no shape"
            more = "; write the whole path" if found else "; add it, or remove its line"
            raise FileError(f"{table}: line {line}: {path} is {what} of the collection{more}")
        i, path = found[0]
        if labels[i].setdefault(path, label) != label:
            raise FileError(
                f"{table}: line {line} labels {path} {label}, but an earlier line labels it "
                f"{labels[i][path]}; keep one of them"
            )
    for one in labels:
        names: dict[str, str] = {}  # the first path of each label
        for path, label in one.items():
            names.setdefault(label, path)
        if len(names) > 1:
            said = " and ".join(f"{path} a {label}" for label, path in names.items())
            warn(f"{table} calls {said}, but these files are identical: their shape is left out")
            one.clear()
    return [next(iter(one.values()), None) for one in labels]
