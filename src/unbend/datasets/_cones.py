"""Rounded cones and the smooth implicit surface of their union."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from unbend._parallel import slices
from unbend._types import FloatArray, IntArray

# From points (n, 3) to the values there, negative inside, and their gradients.
Field = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

_CHUNK = 200_000  # point-cone pairs measured at once: what keeps the arrays in cache
_CREASE = 0.2  # blend within a chain, as a share of the blend between chains


class Cones(NamedTuple):
    """Rounded cones (convex hulls of two balls each) that flow into each other.

    Cone ``i`` is flattened along the unit vector ``flats[i]`` by the factor ``1 + extra[i]``.
    Cones of one chain are joined almost without rounding: they share a ball at each joint, and
    rounding would swell it. Chains are joined over a distance of about ``blend``.
    """

    heads: FloatArray
    tails: FloatArray
    head_radii: FloatArray
    tail_radii: FloatArray
    flats: FloatArray
    extra: FloatArray
    chains: IntArray
    blend: float

    def turned(self, rotation: FloatArray, shift: FloatArray) -> Cones:
        """Rotate the body, then shift it."""
        return self._replace(
            heads=self.heads @ rotation.T + shift,
            tails=self.tails @ rotation.T + shift,
            flats=self.flats @ rotation.T,
        )

    def measure(
        self, cones: IntArray, points: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance, its gradient, and the radius nearby, for each cone with each point.

        ``cones`` and ``points`` broadcast: (m,) with (m, 3), or (b, 1) with (n, 3).
        """
        flats, extra = self.flats[cones], self.extra[cones]
        heads = self.heads[cones]
        axes = _squeezed(self.tails[cones] - heads, flats, extra)
        lengths = np.maximum(np.sqrt(_dot(axes, axes)), 1e-9)
        axes = axes / lengths[..., None]
        radii = self.head_radii[cones]
        slopes = np.clip((self.tail_radii[cones] - radii) / lengths, -0.95, 0.95)
        offsets = _squeezed(points - heads, flats, extra)
        along = _dot(offsets, axes)
        across = np.sqrt(np.maximum(_dot(offsets, offsets) - along**2, 0))
        # The closest of the cone's balls: where |p - c(t)| - r(t) is smallest.
        nearest = along + slopes / np.sqrt(1 - slopes**2) * across
        nearest = np.clip(nearest, 0, lengths)
        offsets -= nearest[..., None] * axes
        far = np.sqrt(_dot(offsets, offsets))
        offsets /= np.maximum(far, 1e-12)[..., None]
        ball = radii + slopes * nearest
        return far - ball, _squeezed(offsets, flats, extra), ball / (1 + extra)

    def distances(self, points: FloatArray, cones: Sequence[int] | None = None) -> FloatArray:
        """Signed distances, (n_cones, n_points)."""
        which = np.arange(len(self.heads)) if cones is None else np.asarray(cones)
        some = slices(len(points), max(1, _CHUNK // len(which)))
        return np.concatenate([self.measure(which[:, None], points[s])[0] for s in some], axis=1)

    def local_field(self, near: FloatArray) -> tuple[Field, FloatArray]:
        """Blend the cones into one function that holds for points that stay close to ``near``.

        Returns it, and the body's thickness at each point, the radius of the nearest cone there.
        """
        cone, point = self._candidates(near, 7 * self.blend + 0.02)
        distances, _, radii = self.measure(cone, near[point])
        low = np.minimum.reduceat(distances, np.flatnonzero(np.diff(point, prepend=-1)))[point]
        thickness = np.empty(len(near))
        thickness[point[distances == low]] = radii[distances == low]
        close = distances < low + 7 * self.blend + 0.02
        cone, point = cone[close], point[close]
        key = point * (int(self.chains.max()) + 1) + self.chains[cone]
        _, chain_start, chain_of = np.unique(key, return_index=True, return_inverse=True)
        point_of = point[chain_start]
        _, point_start = np.unique(point_of, return_index=True)

        def field(points: FloatArray) -> tuple[FloatArray, FloatArray]:
            values, gradients, _ = self.measure(cone, points[point])
            values, share = _soft_min(values, chain_start, chain_of, self.blend * _CREASE)
            gradients = np.add.reduceat(gradients * share[:, None], chain_start)
            values, share = _soft_min(values, point_start, point_of, self.blend)
            return values, np.add.reduceat(gradients * share[:, None], point_start)

        return field, thickness

    def _candidates(self, points: FloatArray, margin: float) -> tuple[IntArray, IntArray]:
        """Pairs of a cone and a point that may be within ``margin`` of the closest pair.

        They are sorted by point, then by chain. Balls around and within the cones decide.
        """
        middles = (self.heads + self.tails) / 2
        radii = np.maximum(self.head_radii, self.tail_radii)
        outer = radii + np.linalg.norm(self.tails - self.heads, axis=1) / 2
        inner = np.minimum(self.head_radii, self.tail_radii)
        apart = cdist(points, middles)
        highest = (apart * (1 + self.extra) - inner).min(axis=1, keepdims=True)
        by_chain = np.argsort(self.chains, kind="stable")
        point, position = np.nonzero((apart - outer < highest + margin)[:, by_chain])
        return by_chain[position], point


def newton_step(field: Field, points: FloatArray) -> FloatArray:
    """Move points towards the surface of a field, along its gradient."""
    values, gradients = field(points)
    step = values / np.einsum("ni,ni->n", gradients, gradients)
    return np.asarray(points - np.clip(step, -0.02, 0.02)[:, None] * gradients)


def _soft_min(
    values: FloatArray, starts: IntArray, group: IntArray, blend: float
) -> tuple[FloatArray, FloatArray]:
    """Smooth minimum of each group, and each member's share in its gradient."""
    low = np.minimum.reduceat(values, starts)
    share = np.exp((low[group] - values) / blend)
    total = np.add.reduceat(share, starts)
    return low - blend * np.log(total), share / total[group]


def _squeezed(vectors: FloatArray, flats: FloatArray, extra: FloatArray) -> FloatArray:
    if not extra.any():
        return vectors
    return np.asarray(vectors + (extra * _dot(vectors, flats))[..., None] * flats)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])
