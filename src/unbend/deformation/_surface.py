"""A surface that deforms as rigidly as possible (Sorkine & Alexa, SGP 2007).

Its energy is minimised in alternation: the global step solves for places, given a rotation for each
vertex; the local step rotates the neighbourhoods to fit them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from threading import RLock
from typing import Any, Self, TypeVar

import numpy as np
import scipy.sparse as sp

from unbend._types import FloatArray, IntArray, SparseMatrix
from unbend.alignment import nearest_rotation
from unbend.deformation._kernels import (
    edge_covariances,
    edge_squares,
    rotated_divergence,
    turn_rotations,
)
from unbend.linalg.factorization import Factorization, factorize
from unbend.mesh import faces_around, measure_corners

# Rotations are averaged over about this length, in sqrt(area): limbs turn as wholes, which keeps
# their ends from sliding, yet joints still bend.
TURNING = 0.03
_LEAST_WEIGHT = 1e-3  # of an edge; the greatest is its inverse

_T = TypeVar("_T")


def cached(compute: Callable[[Any], _T]) -> _T:
    """Make a property that is computed once, under its object's `_lock`.

    Python 3.11's ``cached_property`` has one lock for all objects, later ones have none.
    """

    def get(self: Any) -> Any:
        if compute.__name__ not in self.__dict__:
            with self._lock:
                if compute.__name__ not in self.__dict__:
                    self.__dict__[compute.__name__] = compute(self)
        return self.__dict__[compute.__name__]

    return property(get, doc=compute.__doc__)  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class ElasticSurface:
    """A surface at rest. Threads may share it: whatever is computed on demand is computed once.

    Lengths are in the square root of its area, for the `areas` (n,) of vertices to sum to one.
    """

    vertices: FloatArray
    faces: IntArray
    areas: FloatArray
    _lock: Any = field(init=False, repr=False, default_factory=RLock)
    _factors: dict[tuple[float, float], Factorization] = field(
        init=False, repr=False, default_factory=dict
    )

    @cached
    def edge_weights(self) -> SparseMatrix:
        """Positive cotangent weights of the edges, (n, n) in compressed rows."""
        n = len(self.vertices)
        dots, squared, double_areas = measure_corners(self.vertices, self.faces)
        longer = np.maximum(np.roll(squared, -1, axis=1), np.roll(squared, -2, axis=1))
        floor = np.maximum(np.finfo(float).eps * longer, 1e-300)
        weights = (dots / np.maximum(double_areas[:, None], floor) / 2).ravel()
        ends = [np.roll(self.faces, shift, axis=1).ravel() for shift in (-1, -2)]
        found = sp.csr_matrix((np.tile(weights, 2), np.hstack([ends, ends[::-1]])), shape=(n, n))
        found.data = np.clip(found.data, _LEAST_WEIGHT, 1 / _LEAST_WEIGHT)
        return found

    def with_edge_weights(self, edge_weights: SparseMatrix) -> Self:
        """Return the surface with other weights of its edges, which may join other vertices."""
        changed = replace(self)
        changed.__dict__["edge_weights"] = edge_weights
        return changed

    @cached
    def stiffness(self) -> SparseMatrix:
        """Laplacian of `edge_weights`, (n, n)."""
        return sp.diags(np.asarray(self.edge_weights.sum(axis=1)).ravel()) - self.edge_weights

    @cached
    def edge_squares(self) -> FloatArray:
        """Weighted sum (n,) of the squared edges around each vertex."""
        return edge_squares(self.edge_weights, self.vertices)

    @cached
    def fans(self) -> tuple[IntArray, IntArray]:
        """Faces around each vertex, in compressed rows."""
        return faces_around(self.faces, len(self.vertices))

    def system(self, pull: float, stiffness: float = 1.0) -> Factorization:
        """Factorise so much of the areas plus so much of the stiffness, once for each pair."""
        with self._lock:
            if (pull, stiffness) not in self._factors:
                matrix = sp.diags(pull * self.areas) + stiffness * self.stiffness
                self._factors[pull, stiffness] = factorize(matrix, many=True)
            return self._factors[pull, stiffness]

    def system_of(self, pulls: FloatArray) -> Factorization:
        """Factorise the stiffness plus pulls (n,) on the vertices."""
        return factorize(self.stiffness + sp.diags(pulls), many=True)

    def averaged(self, values: FloatArray, length: float = TURNING) -> FloatArray:
        """Average values (n, ...), each multiplied by its vertex's area, over about a length."""
        flat = values.reshape(len(values), -1)
        return self.system(1.0, length**2).solve(flat).reshape(values.shape)

    def covariances(self, places: FloatArray, rest: FloatArray | None = None) -> FloatArray:
        """Weighted covariances (n, ..., 3, 3) of the edges at rest and in poses (n, ..., 3)."""
        return edge_covariances(self.edge_weights, self.vertices if rest is None else rest, places)

    def fit_places(
        self,
        system: Factorization,
        force: FloatArray,
        rotations: FloatArray,
        sizes: FloatArray | float = 1.0,
    ) -> FloatArray:
        """Places (n, ..., 3) that fit pulls and rotations best; see :meth:`step`."""
        sized = np.asarray(sizes)[..., None, None] * rotations
        load = rotated_divergence(self.edge_weights, self.vertices, sized) + force
        return system.solve(load.reshape(len(load), -1)).reshape(load.shape)

    def fit_rotations(
        self, places: FloatArray, rest: FloatArray | None = None, length: float = TURNING
    ) -> FloatArray:
        """Rotations (n, 3, 3) that fit a pose best, averaged over a length."""
        covariances = self.averaged(self.covariances(places, rest), length)
        return np.ascontiguousarray(nearest_rotation(covariances.transpose(0, 2, 1)))

    def step(
        self,
        system: Factorization,
        force: FloatArray,
        rotations: FloatArray,
        sizes: FloatArray | float = 1.0,
        length: float = TURNING,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Take a global and a local step: solve for places, then turn rotations in place to them.

        The rotations (n, ..., 3, 3) may be those of several poses. The force (n, ..., 3) is the
        system's pulls times the places that they lead to. Edges become as many times longer than
        at rest as `sizes` say, one for each pose or vertex. Rotations are averaged over a length.

        Returns the places (n, ..., 3) and the covariances (n, ..., 3, 3) of the edges at rest and
        posed, around each vertex and averaged.
        """
        places = self.fit_places(system, force, rotations, sizes)
        covariances = self.covariances(places)
        averaged = self.averaged(covariances, length)
        turn_rotations(averaged, rotations)
        return places, covariances, averaged
