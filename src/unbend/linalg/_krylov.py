"""A growing orthonormal basis of a Krylov space, with the operator projected onto it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg

from unbend._types import FloatArray
from unbend.errors import SolverError
from unbend.linalg.tall import column_lengths, inner, multiply, subtract_product

Operator = Callable[[FloatArray], FloatArray]

_ORTHOGONAL = 1e-10  # largest inner product of two columns that is left alone
_LOST = 1e-13  # a direction that loses all but this lies in the basis: rounding errors remain
_ROUNDING = float(np.finfo(np.float64).eps)


class KrylovBasis:
    """Orthonormal columns Q and the projection T = Q^T op(Q) of a symmetric operator.

    Block Lanczos without restarts and with full orthogonalisation. The operator has been applied
    to the first ``done`` columns: ``op(Q[:, :done]) = Q T[:, :done]``; those after them are the
    next block. T is kept whole, not as a band, which lets a random block enter at any time.

    One pass of orthogonalisation against a basis with Q^T Q = I + E leaves errors of E times the
    coefficients, over the length of what remains. So an estimate of E is carried along, and only
    where it grows too large there is a second pass.
    """

    def __init__(
        self,
        operator: Operator,
        n: int,
        block_size: int,
        rng: np.random.Generator,
        capacity: int = 64,
    ) -> None:
        self.n, self.done, self.size = n, 0, 0
        self._operator, self._rng = operator, rng
        self._columns = np.empty((n, 0), order="F")
        self._projection = np.zeros((0, 0))
        self._errors = np.zeros((0, 0))  # the estimate of E
        self._reserve(min(capacity, n))
        self.add_random(block_size)

    def add_random(self, count: int) -> None:
        """Put random columns into the next block: new directions for what the old ones miss."""
        if count := min(count, self.n - self.size):
            self._append(self._rng.standard_normal((self.n, count)))

    def grow(self) -> None:
        """Apply the operator to the next block, and append what is new in the result."""
        block = slice(self.done, self.size)
        image = self._operator(np.ascontiguousarray(self._columns[:, block]))
        if not np.isfinite(image.sum()):
            raise SolverError("the operator returned NaN or infinite values")
        self.done = self.size
        coefficients = self._append(np.array(image, dtype=np.float64))
        self._projection[: self.size, block] = coefficients

    def ritz(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Diagonalise the projection: values (done,), ascending, and coordinates of the vectors.

        Last come those of the residuals ``op(x) - value * x`` in the next block.
        """
        square = self._projection[: self.done, : self.done]
        if np.abs(square - square.T).max() > 1e-6 * np.abs(square).max():
            raise SolverError("the operator is not symmetric")
        values, vectors = scipy.linalg.eigh((square + square.T) / 2, driver="evd")
        return values, vectors, self._projection[self.done : self.size, : self.done] @ vectors

    def combine(self, coordinates: FloatArray) -> FloatArray:
        """Form the vectors with these coordinates in the basis."""
        return multiply(self._columns[:, : len(coordinates)], coordinates)

    def _append(self, block: FloatArray) -> FloatArray:
        """Append the block's new directions; return its coordinates in the basis so extended."""
        count = block.shape[1]
        room = min(count, self.n - self.size)
        old = self._columns[:, : self.size]
        along = np.zeros((self.size, count))
        beyond = np.eye(count)
        before = float(column_lengths(block).max())
        while True:
            step = inner(old, block)
            along += step @ beyond
            subtract_product(block, old, step)
            # Rotate to the principal directions. The Gram matrix resolves short ones poorly, which
            # is why their lengths are measured anew.
            rotation = np.linalg.eigh(inner(block, block))[1][:, ::-1][:, :room]
            block = multiply(block, rotation)
            lengths = column_lengths(block)
            alive = lengths > _LOST * before
            beyond = np.where(alive, lengths, 0.0)[:, None] * (rotation.T @ beyond)
            scale = np.where(alive, lengths, 1.0)
            block /= scale
            noise = self._rng.standard_normal((self.size, room)) * (_ROUNDING * before)
            errors = (noise - self._errors[: self.size, : self.size] @ step @ rotation) / scale
            if alive.all() and np.abs(errors).max(initial=0) < _ORTHOGONAL:
                break
            fresh = self._rng.standard_normal((self.n, int((~alive).sum())))
            block[:, ~alive] = fresh / np.sqrt(self.n)
            before = 1.0
        self._reserve(self.size + room)
        new = slice(self.size, self.size + room)
        self._columns[:, new] = block
        self._errors[: self.size, new] = errors
        self._errors[new, : self.size] = errors.T
        self.size += room
        return np.concatenate([along, beyond])

    def _reserve(self, size: int) -> None:
        if size <= self._columns.shape[1]:
            return
        capacity = min(self.n, max(size, 3 * self._columns.shape[1] // 2))
        columns = np.empty((self.n, capacity), order="F")
        columns[:, : self.size] = self._columns[:, : self.size]
        self._columns = columns
        more = (0, capacity - len(self._projection))
        self._projection = np.pad(self._projection, (more, more))
        self._errors = np.pad(self._errors, (more, more))
