"""Leading eigenpairs of an operator made of iterative solves, each started from the last."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.linalg

from unbend._parallel import one_blas_thread
from unbend._types import FloatArray
from unbend.errors import SolverError
from unbend.linalg.tall import column_lengths, combine, inner

_MOST_STEPS = 50
# Of what is missing from the eigenpairs, the share that solves may leave.
_SHARE = 1e-2
_START = 0.1

Solves = Callable[[FloatArray, Sequence[FloatArray | None], float], list[FloatArray]]


def subspace_iteration(
    solves: Solves, start: FloatArray, k: int, *, tol: float
) -> tuple[FloatArray, FloatArray, float]:
    """Improve rough eigenvectors of the k largest eigenvalues of a symmetric operator.

    Each solve starts from what the last ones say of it, and is only as exact as the vectors are.

    Parameters
    ----------
    solves : callable
        ``solves(block, guesses, tol)``: the results of the solves, one after the other, that the
        operator consists of, the last of them the operator's image of the block; each to `tol`,
        from its guess.
    start : (n, b) ndarray of float64
        Linearly independent; b > k, the more the faster.
    k : int
    tol : float
        Largest residual |operator(x) - value x| relative to the largest eigenvalue.

    Returns
    -------
    values : (b,) ndarray of float64
        Descending. Those after the first k are not as accurate.
    vectors : (n, k) ndarray of float64
        Orthonormal.
    residual : float
        The one reached.

    Raises
    ------
    SolverError
        If it is not reached, or the vectors cannot be told apart.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.linalg.subspace import subspace_iteration
    >>> diagonal = np.array([[9.0], [4.0], [1.0]])
    >>> rough = np.array([[1.0, 0.1], [0.2, 1.0], [0.1, -0.2]])
    >>> subspace_iteration(lambda x, guess, tol: [diagonal * x], rough, 1, tol=1e-9)[0].round(6)
    array([9., 4.])
    """
    with one_blas_thread():
        vectors = combine(None, start, _orthonormalising(inner(start, start)))
        guesses: list[FloatArray | None] = [None] * 2
        residual = _START
        for _ in range(_MOST_STEPS):
            images = solves(vectors, guesses, max(_SHARE * residual, 1e-2 * tol))
            projection = inner(vectors, images[-1])
            if not np.isfinite(projection).all():
                raise SolverError("the solves returned NaN or infinite values")
            values, rotation = scipy.linalg.eigh((projection + projection.T) / 2)
            values, rotation = values[::-1], rotation[:, ::-1]
            found = combine(None, vectors, rotation[:, :k])
            left = combine(found * -values[:k], images[-1], -rotation[:, :k])
            residual = float(column_lengths(left).max() / values[0])
            if residual <= tol:
                return values, found, residual
            turn = rotation @ _orthonormalising(
                rotation.T @ inner(images[-1], images[-1]) @ rotation
            )
            vectors = combine(None, images[-1], turn)
            # The new block is about the old one times this, and so are its images.
            guesses = [combine(None, image, projection @ turn) for image in images]
    raise SolverError(f"the form's eigenpairs stay at a residual of {residual:.1e}, above {tol:g}")


def _orthonormalising(gram: FloatArray) -> FloatArray:
    """Coordinates of orthonormal combinations of vectors with these inner products."""
    lengths = np.sqrt(np.maximum(gram.diagonal(), 0))
    try:
        with np.errstate(invalid="ignore", divide="ignore"):
            root = np.linalg.cholesky(gram / np.multiply.outer(lengths, lengths))
        if not np.isfinite(root).all():
            raise np.linalg.LinAlgError
    except np.linalg.LinAlgError:
        raise SolverError(
            "the form's eigenvalues are too far apart for n_coarse; leave it out"
        ) from None
    return np.asarray(scipy.linalg.solve_triangular(root, np.diag(1 / lengths), lower=True).T)
