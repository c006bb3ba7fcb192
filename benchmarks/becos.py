"""Sets of pairs of different animals or people, from a folder in the layout of BeCoS.

FOLDER holds ``data/tosca-off/NAME.off``, poses of a class numbered alike, and
``precomputed_corr_templates/A_B_corres.txt``: for each vertex of the first pose of A a face of the
first pose of B, counted from 0, and three barycentric coordinates; -1 where nothing corresponds.
Ways through a third shape need its faces in ``corres_comp/default_faces/NAME.npy``
(Ehm et al., "Beyond complete shapes", 2025; github.com/NafieAmrani/becos-code has all of it).
"""

import functools
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from match_cases import Case, Draw, Pair, Set, coarser, of_pair

from testshapes.damage import damaged_truth
from unbend import read_mesh
from unbend._types import IntArray


class Links(NamedTuple):
    """Truth files: from one of our shapes to another, and by way of a shape we do not have."""

    direct: dict[tuple[str, str], Path]
    out: dict[str, dict[str, Path]]
    back: dict[str, dict[str, Path]]


def class_of(name: str) -> str:
    """Name without its number."""
    return re.sub(r"\d+$", "", name)


def mesh_file(folder: Path, name: str) -> Path:
    """File of a shape."""
    return folder / "data" / "tosca-off" / f"{name}.off"


@cache
def poses(folder: Path) -> dict[str, list[str]]:
    """Names of the shapes of each class."""
    found: dict[str, list[str]] = {}
    for path in sorted(mesh_file(folder, "x").parent.glob("*.off")):
        found.setdefault(class_of(path.stem), []).append(path.stem)
    if not found:
        raise SystemExit(f"{folder}: there are no shapes in data/tosca-off")
    return found


@cache
def links(folder: Path) -> Links:
    """Find what the truth files connect, by their names alone."""
    found = Links({}, {}, {})
    pattern = "|".join(rf"tosca_({kind})0(?!\d)" for kind in poses(folder))
    for path in sorted((folder / "precomputed_corr_templates").glob("*_corres.txt")):
        stem = path.name.removesuffix("_corres.txt")
        hits = list(re.finditer(pattern, stem))
        ours = [str(hit[hit.lastindex or 0]) for hit in hits]
        if len(ours) > 1:
            found.direct[ours[0], ours[-1]] = path
        elif ours and hits[0].start() == 0:
            found.out.setdefault(stem[hits[0].end() + 1 :], {})[ours[0]] = path
        elif ours and hits[0].end() == len(stem):
            found.back.setdefault(stem[: hits[0].start() - 1], {})[ours[0]] = path
    return found


@cache
def class_pairs(folder: Path) -> tuple[tuple[str, str], ...]:
    """Ordered pairs of different classes between which the truth is known."""
    known = links(folder)
    pairs = set(known.direct)
    for middle in known.out.keys() & known.back.keys():
        pairs |= {(a, b) for a in known.out[middle] for b in known.back[middle]}
    pairs |= {(a, d) for a, b in known.direct for c, d in known.direct if b == c}
    return tuple(sorted((a, b) for a, b in pairs if a != b))


@cache
def truth(folder: Path, source: str, target: str) -> IntArray:
    """Target vertex of each source vertex, -1 for none, between classes of :func:`class_pairs`."""
    known = links(folder)
    if (source, target) in known.direct:
        faces = read_mesh(mesh_file(folder, f"{target}0")).faces
        return _nearest_corners(known.direct[source, target], faces)
    for middle in known.out.keys() & known.back.keys():
        if source in known.out[middle] and target in known.back[middle]:
            name = max((path for path in _faces(folder) if middle.endswith(path)), key=len)
            there = _nearest_corners(known.out[middle][source], np.load(_faces(folder)[name]))
            faces = read_mesh(mesh_file(folder, f"{target}0")).faces
            return _then(there, _nearest_corners(known.back[middle][target], faces))
    middle = next(b for a, b in known.direct if a == source and (b, target) in known.direct)
    return _then(truth(folder, source, middle), truth(folder, middle, target))


def _faces(folder: Path) -> dict[str, Path]:
    return {path.stem: path for path in (folder / "corres_comp" / "default_faces").glob("*.npy")}


def _nearest_corners(path: Path, faces: IntArray) -> IntArray:
    rows = np.loadtxt(path)
    face = rows[:, 0].astype(np.int64)
    return np.where(face >= 0, faces[face, rows[:, 1:].argmax(axis=1)], -1)


def _then(one: IntArray, other: IntArray) -> IntArray:
    return np.where(one >= 0, other[one], -1)


def species(all_of_it: bool) -> Set:
    """Make a set of different animals or people, of which all have partners or only some."""

    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        folder = data / "becos-code"
        return [
            functools.partial(species_case, folder, all_of_it, seed, i)
            for i in range(20 if count is None else count)
        ]

    return draws


def species_case(folder: Path, all_of_it: bool, seed: int, number: int) -> Case:
    """Draw two animals or people of different kinds, of 3,000 vertices each."""
    chance = np.random.default_rng([seed, number, all_of_it])
    kinds = [
        pair for pair in class_pairs(folder) if bool((truth(folder, *pair) >= 0).all()) == all_of_it
    ]
    one, other = kinds[int(chance.integers(len(kinds)))]
    names = [str(chance.choice(poses(folder)[kind])) for kind in (one, other)]
    return of_pair(species_pair(folder, *names))


def species_pair(folder: Path, source: str, target: str) -> Pair:
    """Read two animals or people, and simplify each to 3,000 vertices."""
    coarse = [coarser(read_mesh(mesh_file(folder, name)), 3000) for name in (source, target)]
    one, other = class_of(source), class_of(target)
    there = damaged_truth(truth(folder, one, other), *coarse)
    back = damaged_truth(truth(folder, other, one), *coarse[::-1])
    return Pair(f"{source} {target}", coarse[0].mesh, coarse[1].mesh, there, back)
