"""Sets of parts of bodies: of one kind of body, and of two kinds, cut in ways drawn by a seed."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from becos import poses, species_pair
from match_cases import Case, Chance, Draw, Pair, Set, coarser, of_pair
from public_sets import SHREC07, marked_pair, rows_pair

from testshapes.damage import Damaged, cut, damaged_truth, unchanged
from testshapes.measures import along_edges
from testshapes.scanning import seen_from
from unbend import Mesh

OVERLAP = (0.2, 0.9)  # share of either part that is on the other one, of the smaller share
_SMALL = (0.05, 0.1, 0.15, 0.2, 0.3)  # share of the area
_N_DRAWS = 30
_COARSE = (2500, 4500)  # vertices of one shape in three
_ARMADILLO = 5000  # vertices
_MARKED = 100  # a pair of which fewer partners are known is marked at some points only


def _by_plane(chance: Chance, mesh: Mesh) -> Damaged:
    return cut(mesh, mesh.vertices @ chance.standard_normal(3), chance.uniform(0.15, 0.7))


def _by_disc(chance: Chance, mesh: Mesh) -> Damaged:
    middle = chance.integers(mesh.n_vertices, size=1)
    return cut(mesh, along_edges(mesh, middle, nearest=True), chance.uniform(0.15, 0.6))


def _half(chance: Chance, mesh: Mesh) -> Damaged:
    return cut(mesh, mesh.vertices @ chance.standard_normal(3), 0.5)


def _limb_off(chance: Chance, mesh: Mesh) -> Damaged:
    """Take off what is around a tip: the vertex farthest from any one."""
    start = chance.integers(mesh.n_vertices, size=1)
    tip = along_edges(mesh, start, nearest=True).argmax()
    return cut(mesh, along_edges(mesh, np.array([tip]), nearest=True), chance.uniform(0.1, 0.35))


def _view(chance: Chance, mesh: Mesh) -> Damaged:
    return seen_from(mesh, chance.standard_normal(3))


CUTS: dict[str, Callable[[Chance, Mesh], Damaged]] = {
    "half": _half, "plane": _by_plane, "limb": _limb_off, "disc": _by_disc, "view": _view,
}  # fmt: skip


class Bodies(NamedTuple):
    """Shapes of a set: kinds of animals of SMAL, people, TOSCA, armadillos.

    ``animals`` is a folder of SMAL, ``people`` a folder and a file of truth for rows_pair, and
    ``classes`` are those of TOSCA.
    """

    animals: str
    people: tuple[str, str]
    classes: tuple[str, ...]
    armadillos: range
    kinds: tuple[tuple[str, str], ...]


_SGA18 = "SGA18_orientation_BCICP_dataset/Dataset/"
_TOSCA = f"{_SGA18}TOSCA_Isometric/vtx_5k"
_ANIMALS = ("ferrari", "lion", "cow", "hippo", "fox", "wolf", "dog")  # in names of SMAL's files
_FIRST = SHREC07["armadillo"]
KNOWN = Bodies(
    "shapes_train", (f"{_SGA18}FAUST/vtx_5k", f"{_SGA18}FAUST/vtx_5k/corres"),
    ("cat", "dog", "michael", "centaur"), range(_FIRST, _FIRST + 10),
    (("cat", "dog"), ("dog", "cat"), ("dog", "horse")),
)  # fmt: skip
HELD_OUT = Bodies(
    "shapes_test", ("DUO-FM/data/SCAPE_a/shapes_test", "DUO-FM/data/SCAPE_a/corres"),
    ("david", "victoria", "horse", "wolf"), range(_FIRST + 10, _FIRST + 20),
    (("wolf", "dog"), ("dog", "wolf"), ("wolf", "cat"), ("wolf", "horse")),
)  # fmt: skip


def parts(bodies: Bodies, two_kinds: bool) -> Set:
    """Make a set of parts of two bodies of one kind, or of two kinds."""
    return _set_of(part_case, bodies, two_kinds)


def small_parts(bodies: Bodies) -> Set:
    """Make a set of small parts, discs around tips and other points, onto another whole body."""
    return _set_of(small_part_case, bodies)


def _set_of(case: Callable[..., Case], *given: object) -> Set:
    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        numbers = range(60 if count is None else count)
        return [functools.partial(case, data, *given, seed, number) for number in numbers]

    return draws


def small_part_case(data: Path, bodies: Bodies, seed: int, number: int) -> Case:
    """Draw two bodies, and cut from one what is around a point."""
    chance = np.random.default_rng([seed, number, *bodies.animals.encode()])
    sources = _people, functools.partial(_animals, alike=True), _poses
    pair = sources[number % len(sources)](chance, data, bodies)
    share = _SMALL[number // len(sources) % len(_SMALL)]
    middle = chance.integers(pair.source.n_vertices, size=1)
    away = along_edges(pair.source, middle, nearest=True)
    if chance.integers(2):  # the tip that is farthest
        away = along_edges(pair.source, np.array([away.argmax()]), nearest=True)
    part = cut(pair.source, -away, 1 - share)
    return of_pair(pair._replace(name=f"{share:.0%}: {pair.name}"), part, unchanged(pair.target))


def part_case(data: Path, bodies: Bodies, two_kinds: bool, seed: int, number: int) -> Case:
    """Draw two bodies and cut one or both, until they have as much in common as they should."""
    chance = np.random.default_rng([seed, number, two_kinds, *bodies.animals.encode()])
    sources = (_two_animals, _two_classes) if two_kinds else (
        _people, functools.partial(_animals, alike=True), _poses, _armadillos,
    )  # fmt: skip
    pair = sources[number % len(sources)](chance, data, bodies)
    marked = np.count_nonzero(pair.truth >= 0) < _MARKED  # and all that is known are some points
    meshed = [
        functools.partial(_meshed, chance, one, not marked) for one in (pair.source, pair.target)
    ]
    case = cut_case(chance, pair, meshed)
    return case._replace(overlap=None) if marked else case


def cut_case(chance: Chance, pair: Pair, meshed: Sequence[Callable[[], Damaged]]) -> Case:
    """Mesh two shapes and cut one or both, until they have as much in common as they should."""
    for _ in range(_N_DRAWS):
        names = [*chance.choice(list(CUTS), 2)]
        if spared := chance.integers(3):  # else both are cut
            names[spared - 1] = "whole"
        left = [_cut(chance, name, draw()) for name, draw in zip(names, meshed, strict=True)]
        case = of_pair(pair._replace(name=f"{names[0]} {names[1]}: {pair.name}"), *left)
        if OVERLAP[0] <= _in_common(pair, *left) <= OVERLAP[1]:
            break
    return case


def _meshed(chance: Chance, mesh: Mesh, may_coarsen: bool) -> Damaged:
    if may_coarsen and chance.integers(3) == 0:
        return coarser(mesh, int(chance.integers(*_COARSE)))
    return unchanged(mesh)


def _cut(chance: Chance, name: str, left: Damaged) -> Damaged:
    return left if name == "whole" else left.then(CUTS[name](chance, left.mesh))


def _in_common(pair: Pair, source: Damaged, target: Damaged) -> float:
    """Share of the vertices with a partner, of the shape of which fewer have one."""
    shares = []
    for truth, one, other in (pair.truth, source, target), (pair.back, target, source):
        known = truth[one.origin] >= 0
        found = damaged_truth(truth, one, other) >= 0
        shares.append(float(found.sum() / max(known.sum(), 1)))
    return min(shares)


def _people(chance: Chance, data: Path, bodies: Bodies) -> Pair:
    folder, truth = (data / one for one in bodies.people)
    names = sorted(path.stem for path in folder.glob("*.off"))
    return rows_pair(folder, truth, *chance.choice(names, 2, replace=False))


def _animals(chance: Chance, data: Path, bodies: Bodies, alike: bool) -> Pair:
    folder = data / "DUO-FM/data/SMAL_r"
    names = sorted(path.stem for path in (folder / bodies.animals).glob("*.off"))
    kinds = {name: kind for name in names for kind in _ANIMALS if kind in name.lower()}
    pairs = [(a, b) for a in kinds for b in kinds if a != b and (kinds[a] == kinds[b]) == alike]
    names = pairs[int(chance.integers(len(pairs)))]
    return rows_pair(folder / bodies.animals, folder / "corres", *names)


def _two_animals(chance: Chance, data: Path, bodies: Bodies) -> Pair:
    return _animals(chance, data, bodies, alike=False)


def _two_classes(chance: Chance, data: Path, bodies: Bodies) -> Pair:
    folder = data / "becos-code"
    kinds = bodies.kinds[int(chance.integers(len(bodies.kinds)))]
    names = [str(chance.choice(poses(folder)[kind])) for kind in kinds]
    return species_pair(folder, *names)


def _poses(chance: Chance, data: Path, bodies: Bodies) -> Pair:
    folder, kind = data / _TOSCA, chance.choice(bodies.classes)
    names = sorted(path.stem for path in folder.glob(f"{kind}*.off"))
    return rows_pair(folder, folder / "corres", *chance.choice(names, 2, replace=False))


def _armadillos(chance: Chance, data: Path, bodies: Bodies) -> Pair:
    one, other = chance.choice(bodies.armadillos, 2, replace=False)
    return marked_pair(data, "armadillo", int(one), int(other), _ARMADILLO)
