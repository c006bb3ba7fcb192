"""A pair of shapes with its ground truth: what a set of benchmarks/match_sets.py is made of."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from testshapes.damage import Damaged, damaged_truth, unchanged
from unbend import Mesh
from unbend._types import BoolArray, FloatArray, IntArray

Chance = np.random.Generator


class Case(NamedTuple):
    """Two shapes to match, and what is known of them.

    ``rows`` are source vertices whose partner is known, and ``images`` that partner, a vertex of
    ``whole``: the target before anything was cut off it, on which errors are measured. ``origin``
    is the vertex of ``whole`` of each target vertex. ``overlap`` says which vertices of source and
    target have a partner on the other. ``mirrored`` is the mirror image of ``images``. ``places``
    are the exact places of all source vertices on the target, which lie between its vertices.
    """

    name: str
    source: Mesh
    target: Mesh
    rows: IntArray
    images: IntArray
    whole: Mesh
    origin: IntArray
    overlap: tuple[BoolArray, BoolArray] | None = None
    mirrored: IntArray | None = None
    places: FloatArray | None = None


class Pair(NamedTuple):
    """Two whole shapes: the target vertex of each source vertex, and back; -1 for none."""

    name: str
    source: Mesh
    target: Mesh
    truth: IntArray
    back: IntArray
    mirrored: IntArray | None = None
    places: FloatArray | None = None
    limbs: tuple[IntArray, IntArray] | None = None


Draw = Callable[[], Case]
Set = Callable[[Path, int, int | None], list[Draw]]


def of_rows(name: str, source: Mesh, target: Mesh, rows: IntArray, *images: IntArray) -> Case:
    """Make a case of two shapes that are matched as they are; give the mirrored images last."""
    every = np.arange(target.n_vertices)
    return Case(name, source, target, rows, images[0], target, every, None, *images[1:])


def of_pair(pair: Pair, source: Damaged | None = None, target: Damaged | None = None) -> Case:
    """Make a case of what is left of two shapes."""
    if source is None and target is None and (pair.truth >= 0).all():
        every = np.arange(pair.source.n_vertices)
        mirrored = () if pair.mirrored is None else (pair.mirrored,)
        whole = of_rows(pair.name, pair.source, pair.target, every, pair.truth, *mirrored)
        return whole._replace(places=pair.places)
    source, target = source or unchanged(pair.source), target or unchanged(pair.target)
    truth = damaged_truth(pair.truth, source, target)
    back = damaged_truth(pair.back, target, source)
    rows = np.flatnonzero(truth >= 0)
    whole_rows = source.origin[rows]
    mirrored = None if pair.mirrored is None else pair.mirrored[whole_rows]
    overlap = truth >= 0, back >= 0
    images = pair.truth[whole_rows]
    return Case(
        pair.name, source.mesh, target.mesh, rows, images, pair.target, target.origin, overlap,
        mirrored,
    )  # fmt: skip


def chosen(pairs: Iterable[Any], seed: int, count: int | None) -> list[Any]:
    """Draw so many pairs, or all; pair i is the same whatever the number."""
    found = list(pairs)
    return [found[i] for i in np.random.default_rng(seed).permutation(len(found))[:count]]


def coarser(mesh: Mesh, n_vertices: int) -> Damaged:
    """Simplify a mesh to so many vertices, or leave it as it is."""
    if mesh.n_vertices <= n_vertices:
        return unchanged(mesh)
    from fast_simplification import simplify

    vertices, faces = simplify(
        mesh.vertices.astype(np.float32),
        mesh.faces.astype(np.int32),
        target_reduction=1 - n_vertices / mesh.n_vertices,
    )
    used, corners = np.unique(faces, return_inverse=True)
    vertices = vertices[used].astype(np.float64)
    origin = cKDTree(mesh.vertices).query(vertices)[1]
    image = cKDTree(vertices).query(mesh.vertices)[1]
    return Damaged(Mesh(vertices, corners.reshape(-1, 3), name=mesh.name), origin, image)
