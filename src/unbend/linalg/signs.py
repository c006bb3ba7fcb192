"""One rule for the sign of an eigenvector, so that equal input gives equal output."""

from __future__ import annotations

import numpy as np

from unbend._arrays import first_largest
from unbend._types import FloatArray

# A third moment below this share of the third absolute moment is rounding, not skewness.
_SYMMETRIC = 1e-6


def fix_signs(vectors: FloatArray, weights: FloatArray) -> FloatArray:
    """Give every column the sign that makes its weighted third moment positive.

    The third moment does not depend on the order of the vertices. Where it vanishes, as for a
    function that is odd under a symmetry of the shape, the first entry whose magnitude is
    within rounding of the largest is made positive.

    Parameters
    ----------
    vectors : (n, k) ndarray of float64
    weights : (n,) ndarray of float64
        Vertex areas, or ones.

    Returns
    -------
    (n, k) ndarray of float64

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.linalg.signs import fix_signs
    >>> fix_signs(np.array([[-3.0], [1.0], [2.0]]), np.ones(3)).ravel()
    array([ 3., -1., -2.])
    """
    size = np.abs(vectors)
    third = weights @ (size * size * vectors)
    scale = weights @ (size * size * size)
    at_peak = vectors[first_largest(size), np.arange(vectors.shape[1])]
    deciding = np.where(np.abs(third) > _SYMMETRIC * scale, third, at_peak)
    signed: FloatArray = vectors * np.where(deciding < 0, -1.0, 1.0)
    return signed
