"""Search for maps of two meshes, with parts that touch cut apart where that fits far better."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from unbend._arrays import snap
from unbend._parallel import run_all
from unbend._types import IntArray, Progress
from unbend.errors import MeshError, heard, warn
from unbend.matching import _constants as constants
from unbend.matching._inputs import Input, check_points, led, prepare
from unbend.matching._plan import Levels, Sides, candidates, make_sides
from unbend.matching._score import Candidate, nearly_as_good
from unbend.mesh import Mesh, find_edges
from unbend.mesh.decimation import decimate

_FEW = 2000  # vertices with which it is tried first whether parts that touch are better cut apart


class Searched(NamedTuple):
    """Two shapes with their landmarks, and candidate maps between their proxies, best first."""

    inputs: list[Input]
    sides: Sides
    found: list[Candidate]


def search_apart(
    inputs: Sequence[Input],
    pairs: IntArray,
    n_eigenpairs: int,
    progress: Progress | None,
    *,
    reflected: bool = False,
) -> Searched:
    """Find candidates, or if they fit far better, those with parts that touch cut apart.

    That is tried unless poses hardly differ; with few vertices first, if there are many. The target
    may be taken as its mirror image.
    """
    searched = functools.partial(_searched, pairs=pairs, progress=progress, reflected=reflected)
    chosen = given = searched(inputs)
    if not given.sides.partial and given.found[0].energy < constants.FEATURES:
        return given
    levels, most = (given.sides.source, given.sides.target), max(len(one.kept) for one in inputs)
    for count in (_FEW, most) if most > 2 * _FEW else (most,):
        if not (cut := cut_apart(inputs, levels, n_eigenpairs, count)):
            break
        apart = searched(cut)
        if given.sides.partial and not apart.sides.partial:  # what may lack parts costs less
            whole = [one._replace(shape=replace(one.shape, partial=False)) for one in inputs]
            given = searched(whole)
        if nearly_as_good(given.found[0], apart.found[0]):
            break
        chosen = apart
    told = dict.fromkeys(str(one.surface.mesh.name) for one in chosen.inputs if one.uncut)
    if names := " and ".join(told):
        warn(
            f"some parts of {names} touch, as a hand and a hip may; they are matched as if these "
            "were apart"
        )
    return chosen


def _searched(
    inputs: Sequence[Input], pairs: IntArray, progress: Progress | None, reflected: bool
) -> Searched:
    given = led(inputs, pairs)
    sides = make_sides(*(one.shape for one in given))
    if reflected:
        sides = sides.reflected()
    return Searched(given, sides, candidates(sides, progress))


def cut_apart(
    inputs: Sequence[Input], levels: Sequence[Levels], n_eigenpairs: int, count: int
) -> list[Input]:
    """Cut parts of either mesh that touch apart, such as a hand and a hip; empty if none seem to.

    Then both have equally many handles. Meshes that are cut keep so many vertices at most.
    """
    if inputs[0] is inputs[1]:
        one, *others = _cut_or_not(inputs[0], levels[0], n_eigenpairs, count)
        return [one, one] if others else []
    tasks = zip(inputs, levels, strict=True)
    options = run_all(functools.partial(_cut_or_not, *task, n_eigenpairs, count) for task in tasks)
    for pair in itertools.product(*options):
        if _n_handles(pair[0].shape.faces) == _n_handles(pair[1].shape.faces):
            is_new = any(one is not given for one, given in zip(pair, inputs, strict=True))
            return list(pair) if is_new else []
    return []


def _cut_or_not(given: Input, levels: Levels, n_eigenpairs: int, count: int) -> list[Input]:
    """Choose from a mesh as it is, and before that, the surface of so many of its vertices.

    That must have fewer handles, and join nothing that is far apart on the mesh.
    """
    if (n_handles := _n_handles(given.shape.faces)) <= 0 or given.own_faces is None:
        return [given]
    vertices = given.surface.mesh.vertices
    chosen = np.arange(len(given.kept))
    if len(chosen) > count:
        around = snap(vertices - vertices.mean(axis=0))
        chosen = np.sort(decimate(around, given.shape.faces, count)[0])
        chosen = chosen[chosen < len(given.kept)]
    try:
        with heard():
            cut = check_points(Mesh(vertices[chosen], name=given.surface.mesh.name))
    except MeshError:
        return [given]
    edges = find_edges(cut.faces, cut.surface.n_vertices).ends
    points = chosen[cut.kept]
    ends = points[edges[(edges < len(points)).all(axis=1)]].T
    if _n_handles(cut.faces) >= n_handles or (levels.apart(*ends) > constants.LIMB).any():
        return [given]
    away, nearest = cKDTree(vertices[points]).query(vertices)
    local, used = np.maximum(given.representatives, 0), given.representatives >= 0
    found = prepare(cut, n_eigenpairs, given.shape.partial)._replace(
        kept=given.kept[points],
        representatives=np.where(used, nearest[local], -1),
        away=given.away + np.where(used, away[local] / np.sqrt(given.surface.area), 0),
        areas=given.areas,
        uncut=given,
    )
    return [found, given]


def _n_handles(faces: IntArray) -> int:
    """Twice the genus of a surface of which every vertex is in use, from Euler's formula."""
    n = int(faces.max()) + 1
    edges = find_edges(faces, n)
    return 2 - edges.n_boundary_loops - (n - len(edges.ends) + len(faces))
