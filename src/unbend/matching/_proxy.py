"""Coarse stand-ins for shapes, on which many hypotheses can be tried."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from unbend._arrays import snap
from unbend._types import IntArray
from unbend.matching._shape import Shape
from unbend.mesh.decimation import decimate


class Proxy(NamedTuple):
    """A coarse copy of a shape.

    Attributes
    ----------
    shape : Shape
        Its vertices are some of the fine shape's, its basis the fine one's there.
    kept : (m,) ndarray of int64
        Those vertices.
    parents : (n,) ndarray of int64
        The coarse vertex that stands for each fine one.
    """

    shape: Shape
    kept: IntArray
    parents: IntArray


def make_proxy(shape: Shape, count: int) -> Proxy:
    """Make a copy of so many vertices, or of all if there are no more.

    Areas are gathered, so that what was decimated more does not weigh less.
    """
    # Which of equal edges collapses is then the same on every processor.
    kept, faces, parents = decimate(snap(shape.vertices), shape.faces, count)
    areas = np.asarray(np.bincount(parents, shape.areas, len(kept)), dtype=np.float64)
    basis = np.ascontiguousarray(shape.basis[kept])
    coarse = replace(
        shape,
        vertices=shape.vertices[kept],
        faces=faces,
        areas=areas,
        basis=basis,
        landmarks=parents[shape.landmarks],
    )
    # Those of the fine shape are the better ones.
    coarse.__dict__["position_coefficients"] = shape.position_coefficients
    return Proxy(coarse, kept, parents)
