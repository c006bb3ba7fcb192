"""Products over tall arrays, rows split among threads."""

from __future__ import annotations

import functools

import numpy as np

from unbend._parallel import row_slices, run_all
from unbend._types import FloatArray, SparseMatrix


def inner(left: FloatArray, right: FloatArray) -> FloatArray:
    """Compute ``left.T @ right`` of tall arrays, rows split among threads.

    Parameters
    ----------
    left : (n, p) array of float64
    right : (n, q) array of float64

    Returns
    -------
    (p, q) array of float64

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.linalg.tall import inner
    >>> inner(np.ones((4, 1)), np.ones((4, 2)))
    array([[4., 4.]])
    """
    parts = run_all(
        functools.partial(lambda rows: left[rows].T @ right[rows], rows)
        for rows in row_slices(len(left))
    )
    total: FloatArray = functools.reduce(np.add, parts)
    return total


def combine(target: FloatArray | None, tall: FloatArray, small: FloatArray) -> FloatArray:
    """Compute ``tall @ small``, or subtract it from ``target`` in place, in threads.

    Parameters
    ----------
    target : (n, q) array of float64, or None
        Changed in place; a new array is made for None.
    tall : (n, p) array of float64
    small : (p, q) array of float64

    Returns
    -------
    (n, q) array of float64

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.linalg.tall import combine
    >>> combine(None, np.ones((2, 1)), np.array([[3.0]])).tolist()
    [[3.0], [3.0]]
    """
    if target is None:
        result = np.empty((len(tall), small.shape[1]))

        def work(rows: slice) -> None:
            result[rows] = (small.T @ tall[rows].T).T  # transposed, BLAS is faster
    else:
        result = target

        def work(rows: slice) -> None:
            result[rows] -= (small.T @ tall[rows].T).T

    run_all(functools.partial(work, rows) for rows in row_slices(len(tall)))
    return result


def rotate(tall: FloatArray, small: FloatArray) -> None:
    """Replace tall columns by ``tall @ small``, in place, in threads.

    Parameters
    ----------
    tall : (n, p) array of float64
        Changed in place.
    small : (p, p) array of float64

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.linalg.tall import rotate
    >>> columns = np.eye(2)
    >>> rotate(columns, np.array([[0.0, 1.0], [1.0, 0.0]]))
    >>> columns.tolist()
    [[0.0, 1.0], [1.0, 0.0]]
    """

    def work(rows: slice) -> None:
        tall[rows] = (small.T @ tall[rows].T).T

    run_all(functools.partial(work, rows) for rows in row_slices(len(tall)))


def column_dots(left: FloatArray, right: FloatArray) -> FloatArray:
    """Compute the inner product of each column with the other's, rows split among threads.

    Parameters
    ----------
    left, right : (n, r) arrays of float64

    Returns
    -------
    (r,) array of float64

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.linalg.tall import column_dots
    >>> column_dots(np.ones((4, 2)), np.eye(4, 2)).tolist()
    [1.0, 1.0]
    """

    def work(rows: slice) -> FloatArray:
        return np.asarray(np.einsum("ij,ij->j", left[rows], right[rows]))

    return np.asarray(sum(run_all(functools.partial(work, rows) for rows in row_slices(len(left)))))


def column_lengths(block: FloatArray) -> FloatArray:
    """Compute the Euclidean norm of each column, (n, r) to (r,), rows split among threads."""
    return np.asarray(np.sqrt(column_dots(block, block)))


def scale_and_add(
    target: FloatArray, share: FloatArray | float, factor: FloatArray | float, other: FloatArray
) -> None:
    """Replace each column by a share of it and a multiple of the other's, in place, in threads.

    Parameters
    ----------
    target : (n, r) array of float64
        Changed in place.
    share, factor : float or (r,) array of float64
    other : (n, r) array of float64

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.linalg.tall import scale_and_add
    >>> target = np.ones((1, 2))
    >>> scale_and_add(target, 1.0, np.array([2.0, 3.0]), np.ones((1, 2)))
    >>> target.tolist()
    [[3.0, 4.0]]
    """

    def work(rows: slice) -> None:
        if np.any(share != 1.0):
            target[rows] *= share
        target[rows] += factor * other[rows]

    run_all(functools.partial(work, rows) for rows in row_slices(len(target)))


def sparse_product(matrix: SparseMatrix, block: FloatArray, out: FloatArray) -> None:
    """Compute ``matrix @ block``, rows split among threads.

    Parameters
    ----------
    matrix : (m, n) sparse matrix of float64 in compressed rows
    block : (n, r) array of float64
    out : (m, r) array of float64
        The product goes there.

    Examples
    --------
    >>> import numpy as np, scipy.sparse as sp
    >>> from unbend.linalg.tall import sparse_product
    >>> product = np.empty((2, 1))
    >>> sparse_product(sp.eye_array(2).tocsr(), np.ones((2, 1)), product)
    >>> product.tolist()
    [[1.0], [1.0]]
    """

    def work(rows: slice) -> None:
        out[rows] = matrix[rows] @ block

    run_all(functools.partial(work, rows) for rows in row_slices(len(out)))
