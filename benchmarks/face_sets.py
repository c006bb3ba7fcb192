"""Sets of faces of the Surrey Face Model: people and expressions drawn by a seed, whole or cut."""

import functools
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
from match_cases import Case, Chance, Draw, Pair, Set, coarser, of_pair
from part_sets import cut_case
from scipy.spatial.transform import Rotation
from shapes import subdivide

from unbend import Mesh
from unbend._types import FloatArray, IntArray

_VERTICES = (2500, 6000)  # of each face, after it was refined to 13,600


class Model(NamedTuple):
    """Mean (n, 3), components (n, 3, 63) and expressions (6, n, 3) in mm, and faces."""

    mean: FloatArray
    components: FloatArray
    expressions: FloatArray
    faces: IntArray


@functools.cache
def read_model(folder: Path) -> Model:
    """Read the files that the eos library keeps its face model in."""
    data = (folder / "sfm_shape_3448.bin").read_bytes()
    mean, at = _matrix(data, 4)
    basis, at = _matrix(data, at)
    variances, at = _matrix(data, at)
    (count,) = struct.unpack_from("<Q", data, at)
    faces = np.frombuffer(data, "<i4", 3 * count, at + 8).reshape(-1, 3).astype(np.int64)
    data = (folder / "expression_blendshapes_3448.bin").read_bytes()
    (count,), at, expressions = struct.unpack_from("<Q", data), 8, []
    for _ in range(count):
        at += 8 + struct.unpack_from("<Q", data, at)[0]  # the expression's name
        offsets, at = _matrix(data, at)
        expressions.append(offsets.reshape(-1, 3))
    mean, components = mean.reshape(-1, 3), basis * np.sqrt(variances[:, 0])
    return Model(mean, components.reshape(*mean.shape, -1), np.array(expressions), faces)


def _matrix(data: bytes, at: int) -> tuple[FloatArray, int]:
    """Take a matrix, column by column after its size, and where it ends."""
    rows, columns = struct.unpack_from("<ii", data, at)
    values = np.frombuffer(data, "<f4", rows * columns, at + 8)
    return values.reshape(columns, rows).T.astype(np.float64), at + 8 + values.nbytes


def faces(in_parts: bool) -> Set:
    """Make a set of faces of two people, or of parts of them."""

    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        case = functools.partial(face_case, data / "eos" / "share", in_parts, seed)
        return [functools.partial(case, i) for i in range(48 if count is None else count)]

    return draws


def face_case(folder: Path, in_parts: bool, seed: int, number: int) -> Case:
    """Draw two faces, mesh each on its own, and cut one or both if asked to."""
    chance, model = np.random.default_rng([seed, number]), read_model(folder)
    one, other = (_face(chance, model) for _ in range(2))
    every = np.arange(one.n_vertices)
    pair = Pair(f"faces {number}", one, other, every, every)
    meshed = [coarser(face, int(chance.integers(*_VERTICES))) for face in (one, other)]
    if not in_parts:
        return of_pair(pair, *meshed)
    return cut_case(chance, pair, [lambda face=face: face for face in meshed])


def _face(chance: Chance, model: Model) -> Mesh:
    """Draw a person and some expressions, each with even odds, and turn the face."""
    points = model.mean + model.components @ chance.standard_normal(model.components.shape[2])
    weights = chance.uniform(size=6) * (chance.uniform(size=6) < 0.5)
    points = points + np.tensordot(weights, model.expressions, 1)
    turn = Rotation.random(random_state=chance).as_matrix()
    return subdivide(Mesh(points @ turn.T, model.faces), "face")
