"""Landmarks as they are given, and what is told of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._arrays import array_of
from unbend._types import IntArray
from unbend.errors import InputError, warn
from unbend.matching._result import Match
from unbend.mesh import Mesh, vertex_ids

# The highest confidence of a map that landmarks lead to and another fits better, and of a symmetry
# that leads too much near to where it is.
MISLED = 0.5


def landmark_pairs(landmarks: npt.ArrayLike, name: str = "landmarks") -> IntArray:
    """Check that landmarks are rows of two whole numbers, or none; return them (l, 2)."""
    pairs = array_of(landmarks, name)
    if not pairs.size:
        return np.empty((0, 2), dtype=np.int64)
    whole = np.issubdtype(pairs.dtype, np.integer)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not whole:
        raise InputError(
            f"{name} must be rows of two vertex numbers, of the source and of the target, not an "
            f"array of shape {pairs.shape} and type {pairs.dtype}"
        )
    return pairs


def labelled(
    landmarks: npt.ArrayLike | Mapping[str, Any] | None, source: Mesh, target: Mesh
) -> tuple[list[str], IntArray]:
    """Give labels of landmarks, if they have any, and their vertices (l, 2), which exist."""
    labels: list[str] = []
    if isinstance(landmarks, Mapping):
        labels, landmarks = list(landmarks), list(landmarks.values())
    pairs = landmark_pairs([] if landmarks is None else landmarks)
    for vertices, mesh in zip(pairs.T, (source, target), strict=True):
        vertex_ids(vertices, mesh.n_vertices, mesh.name)
    return labels, pairs


def warn_of_missed(result: Match, labels: list[str], pairs: IntArray) -> None:
    for row in result.missed_landmarks:
        told, (source, target) = _named_landmark(row, labels, pairs), pairs[row]
        if result.source_to_target[source] < 0 or result.target_to_source[target] < 0:
            warn(f"{told} has no partner by the map")
        else:
            warn(f"{told} is ignored: it contradicts the best-fitting map")


def warn_of_misleading(rows: Sequence[int], labels: list[str], pairs: IntArray) -> None:
    names = [_named_landmark(row, labels, pairs) for row in rows]
    if len(names) > 2:
        names[2:] = [f"{len(names) - 2} more"]
    if names:
        warn(
            f"{' and '.join(names)}: another map fits far better, so perhaps a landmark is wrong, "
            f"or left and right are exchanged; the confidence is at most {MISLED}"
        )


def _named_landmark(row: int, labels: list[str], pairs: IntArray) -> str:
    which = f"landmark {labels[row]!r}" if labels else "the landmark"
    return f"{which} at vertices {pairs[row, 0]} and {pairs[row, 1]}"
