"""Sets of bodies of our own, and of shapes that are damaged: cut, scanned, welded, made noisy."""

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np
from match_cases import Case, Chance, Draw, Pair, Set, coarser, of_pair, of_rows
from public_sets import rows_pair

from testshapes.bodies import KINDS, make_body
from testshapes.damage import Damaged, cut, cut_discs, keep
from testshapes.scanning import add_components, add_noise, seen_from
from testshapes.welding import fuse, weld
from unbend import Mesh
from unbend.datasets import Shape, rest_map


def own_pair(
    chance: Chance, kind: str, same_body: bool, n_vertices: int = 2000, places: bool = False
) -> Pair:
    """Pose a body of random proportions twice, or two bodies; mesh each pose on its own.

    ``places`` adds where the source's vertices exactly are on the target: one body's meshing of
    the source in the pose of the target has them there.
    """
    bodies, meshings, poses = (
        [int(seed) for seed in chance.integers(2**31, size=2)] for _ in range(3)
    )
    if same_body:
        bodies[1] = bodies[0]

    def make(body: int, meshing: int) -> Shape:
        return make_body(
            kind,
            bodies[body],
            n_vertices=n_vertices,
            meshing=meshings[meshing],
            random_state=poses[body],
        )

    one, other = make(0, 0), make(1, 1)
    truth = rest_map(one, other)
    limbs = [
        np.array([i if "left" in p or "right" in p else -1 for i, p in enumerate(shape.parts)])[
            shape.labels
        ]
        for shape in (one, other)
    ]
    return Pair(
        f"{kind} {bodies[0]}",
        one.mesh,
        other.mesh,
        truth,
        rest_map(other, one),
        other.mirror[truth],
        make(1, 0).mesh.vertices if places else None,
        (limbs[0], limbs[1]),
    )


def tosca_pair(chance: Chance, data: Path) -> Pair:
    """Take a pair of remeshed TOSCA."""
    folder = data / "SGA18_orientation_BCICP_dataset/Dataset/TOSCA_Isometric/vtx_5k"
    lines = (folder / "../test_pairs.txt").read_text().splitlines()
    pairs = [line.split() for line in lines if line.strip()]
    return rows_pair(
        folder, folder / "corres", *chance.permutation(pairs[int(chance.integers(len(pairs)))])
    )


def _seed(chance: Chance) -> int:
    return int(chance.integers(2**31))


def discs(share: float, n_discs: int, chance: Chance, mesh: Mesh) -> Damaged:
    """Cut discs out."""
    return cut_discs(mesh, share, n_discs, random_state=_seed(chance))


def halved(chance: Chance, mesh: Mesh) -> Damaged:
    """Keep what is on one side of a plane."""
    return cut(mesh, mesh.vertices @ chance.standard_normal(3), 0.5)


def scanned(noise: float, chance: Chance, mesh: Mesh) -> Damaged:
    """Keep what a camera sees."""
    direction = chance.standard_normal(3)
    seen = seen_from(mesh, direction)
    return seen.then(add_noise(seen.mesh, noise, direction=direction, random_state=_seed(chance)))


def welded(n_tubes: int, chance: Chance, mesh: Mesh) -> Damaged:
    """Join places by tubes."""
    return weld(mesh, n_tubes, random_state=_seed(chance))


def fused(share: float, chance: Chance, mesh: Mesh) -> Damaged:
    """Let places that touch grow together."""
    return fuse(mesh, share, random_state=_seed(chance))


def noisy(noise: float, chance: Chance, mesh: Mesh) -> Damaged:
    """Move vertices at random."""
    return add_noise(mesh, noise, random_state=_seed(chance))


def littered(chance: Chance, mesh: Mesh) -> Damaged:
    """Add parts of other bodies."""
    return add_components(mesh, random_state=_seed(chance))


def simplified(n_vertices: int, chance: Chance, mesh: Mesh) -> Damaged:
    """Leave few vertices."""
    return coarser(mesh, n_vertices)


def cut_limb(chance: Chance, pair: Pair) -> Case:
    """Take one limb off the target."""
    if pair.limbs is None:  # not marked on TOSCA: a disc of 30 % instead
        pair = pair._replace(name=pair.name.replace("limb", "30%"))
        return of_pair(pair, None, discs(0.3, 1, chance, pair.target))
    limb = chance.choice(np.unique(pair.limbs[1][pair.limbs[1] >= 0]))
    return of_pair(pair, None, keep(pair.target, pair.limbs[1] != limb))


def cut_apart(chance: Chance, pair: Pair) -> Case:
    """Cut a quarter off either end: what both still have is half of the body."""
    height = pair.source.vertices @ chance.standard_normal(3)
    return of_pair(pair, cut(pair.source, height, 0.25), cut(pair.target, -height[pair.back], 0.25))


HARM: dict[str, dict[str, Callable[[Chance, Mesh], Damaged]]] = {
    "cuts": {f"{share:.0%}": functools.partial(discs, share, 1) for share in (0.05, 0.1, 0.2, 0.4)}
    | {"half": halved},
    "holes": {f"{s:.0%}": functools.partial(discs, s, 8) for s in (0.02, 0.05, 0.1, 0.2)},
    "scans": {f"noise {noise}": functools.partial(scanned, noise) for noise in (0.0, 0.2)},
    "welds": {f"{n} tubes": functools.partial(welded, n) for n in (1, 4)}
    | {f"{share:.0%} fused": functools.partial(fused, share) for share in (0.01, 0.03)},
    "noise": {f"{noise}": functools.partial(noisy, noise) for noise in (0.2, 0.5)}
    | {"components": littered},
    "coarse": {f"{n} vertices": functools.partial(simplified, n) for n in (200, 500)},
}
BOTH: dict[str, Callable[[Chance, Pair], Case]] = {"limb": cut_limb, "overlap 50%": cut_apart}


def bodies(shapes: str, done: str, n_vertices: int = 2000) -> Set:
    """Make a set of own bodies, by turns of each kind (shapes "own"), or of remeshed TOSCA."""

    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        number = 24 if count is None else count
        case = functools.partial(body_case, data, shapes, done, n_vertices, seed)
        return [functools.partial(case, i) for i in range(number)]

    return draws


def body_case(data: Path, shapes: str, done: str, n_vertices: int, seed: int, number: int) -> Case:
    """Draw a pair and do something to one of the shapes, by turns of every strength."""
    chance = np.random.default_rng([seed, number, *f"{shapes} {done}".encode()])
    kinds = [kind for kind in KINDS if (kind == "octopus") == (shapes == "octopuses")]
    if shapes == "tosca":
        pair = tosca_pair(chance, data)
    else:
        kind = kinds[number % len(kinds)]
        same_body = done != "proportions"
        pair = own_pair(chance, kind, same_body, n_vertices, places=done == "poses")
    if done in ("poses", "proportions"):
        return of_pair(pair)
    strengths = [*HARM[done], *(BOTH if done == "cuts" else ())]
    strength = strengths[number // 2 % len(strengths)]
    pair = pair._replace(name=f"{strength}: {pair.name}")
    if strength in BOTH:
        return BOTH[strength](chance, pair)
    harm = HARM[done][strength]
    if chance.integers(2):
        return of_pair(pair, harm(chance, pair.source), None)
    return of_pair(pair, None, harm(chance, pair.target))


def different(data: Path, seed: int, count: int | None) -> list[Draw]:
    """List pairs of bodies of different kinds, of which no map is right."""
    return [
        functools.partial(different_case, seed, i) for i in range(12 if count is None else count)
    ]


def different_case(seed: int, number: int) -> Case:
    """Draw a body and one of another kind."""
    chance = np.random.default_rng([seed, number])
    one, other = (
        own_pair(chance, KINDS[(number + i) % len(KINDS)], same_body=True) for i in range(2)
    )
    nothing = np.empty(0, dtype=np.int64)
    return of_rows(f"{one.name} {other.name}", one.source, other.target, nothing, nothing)
