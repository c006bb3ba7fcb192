"""Hard pairs with exact truth: other bodies, torn, cut and scanned surfaces, welded parts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import becos
import numpy as np
from scipy.spatial import cKDTree

from unbend import Mesh, read_mesh
from unbend._types import IntArray
from unbend.datasets import (
    Damaged,
    Shape,
    add_components,
    add_noise,
    cut,
    cut_discs,
    damaged_truth,
    keep,
    make_body,
    rest_map,
    seen_from,
    weld,
)
from unbend.datasets.bodies import KINDS
from unbend.datasets.damage import unchanged

Chance = np.random.Generator


class Pair(NamedTuple):
    """Two whole shapes and their truth.

    ``truth`` is the target vertex of each source vertex and ``back`` the other way, -1 for none;
    ``mirrored`` is the truth composed with the target's symmetry, and ``limbs`` the limb of each
    vertex of source and target, -1 for the trunk, where these are known.
    """

    name: str
    source: Mesh
    target: Mesh
    truth: IntArray
    back: IntArray
    mirrored: IntArray | None = None
    limbs: tuple[IntArray, IntArray] | None = None


class Case(NamedTuple):
    """A pair and what is left of both: what is to be matched."""

    pair: Pair
    source: Damaged
    target: Damaged


class Options(NamedTuple):
    """What to draw: seed, number of vertices, folders of data."""

    seed: int
    n_vertices: int
    tosca: Path | None
    becos: Path | None


def own_pair(chance: Chance, options: Options, kind: str, same_body: bool) -> Pair:
    """Two poses of one body of random proportions, or of two; each meshed on its own."""
    bodies, meshings, poses = (
        [int(seed) for seed in chance.integers(2**31, size=2)] for _ in range(3)
    )
    one, other = (
        make_body(
            kind,
            bodies[0 if same_body else i],
            n_vertices=options.n_vertices,
            meshing=meshings[i],
            random_state=poses[i],
        )
        for i in range(2)
    )
    truth = rest_map(one, other)
    assert other.mirror is not None
    return Pair(
        f"{kind} {bodies[0]}",
        one.mesh,
        other.mesh,
        truth,
        rest_map(other, one),
        other.mirror[truth],
        (_limbs(one), _limbs(other)),
    )


def _limbs(shape: Shape) -> IntArray:
    sided = [i if "left" in part or "right" in part else -1 for i, part in enumerate(shape.parts)]
    return np.array(sided)[shape.labels]


def tosca_pair(chance: Chance, options: Options) -> Pair:
    """Take a pair of remeshed TOSCA; vertices without a row of the truth take the nearest's."""
    folder = options.tosca
    assert folder is not None
    lines = (folder / "pairs.txt").read_text().split("\n")
    pairs = [line.split() for line in lines if line.strip()]
    names = [str(name) for name in chance.permutation(pairs[int(chance.integers(len(pairs)))])]
    one, other = (read_mesh(folder / f"{name}.off") for name in names)
    rows, images, mirrored = (
        np.loadtxt(folder / "corres" / f"{name}.vts", dtype=np.int64) - 1
        for name in (names[0], names[1], f"{names[1]}.sym")
    )
    nearest = cKDTree(one.vertices[rows]).query(one.vertices)[1]
    nearest_back = cKDTree(other.vertices[images]).query(other.vertices)[1]
    return Pair(" ".join(names), one, other, images[nearest], rows[nearest_back], mirrored[nearest])


def species_pair(chance: Chance, options: Options, all_of_it: bool) -> Pair:
    """Two animals or people of different kinds, coarsened to the number of vertices."""
    folder = options.becos
    assert folder is not None
    kinds = [
        pair
        for pair in becos.class_pairs(folder)
        if bool((becos.truth(folder, *pair) >= 0).all()) == all_of_it
    ]
    one, other = kinds[int(chance.integers(len(kinds)))]
    names = [str(chance.choice(becos.poses(folder)[kind])) for kind in (one, other)]
    coarse = [
        _coarser(read_mesh(becos.mesh_file(folder, name)), options.n_vertices) for name in names
    ]
    return Pair(
        " ".join(names),
        coarse[0].mesh,
        coarse[1].mesh,
        damaged_truth(becos.truth(folder, one, other), *coarse),
        damaged_truth(becos.truth(folder, other, one), *coarse[::-1]),
    )


def _coarser(mesh: Mesh, n_vertices: int) -> Damaged:
    from fast_simplification import simplify

    reduction = max(0.0, 1 - n_vertices / mesh.n_vertices)
    vertices, faces = simplify(mesh.vertices.copy(), mesh.faces.copy(), target_reduction=reduction)
    origin = cKDTree(mesh.vertices).query(vertices)[1]
    image = cKDTree(vertices).query(mesh.vertices)[1]
    return Damaged(Mesh(vertices, faces, name=mesh.name), origin, image)


# What is done to one of the two shapes. Drawn anew for each pair.
Harm = Callable[[Chance, Mesh], Damaged]


def _seed(chance: Chance) -> int:
    return int(chance.integers(2**31))


def _discs(share: float, n_discs: int) -> Harm:
    return lambda chance, mesh: cut_discs(mesh, share, n_discs, random_state=_seed(chance))


def _half(chance: Chance, mesh: Mesh) -> Damaged:
    return cut(mesh, mesh.vertices @ chance.standard_normal(3), 0.5)


def _scan(noise: float) -> Harm:
    def scan(chance: Chance, mesh: Mesh) -> Damaged:
        direction = chance.standard_normal(3)
        seen = seen_from(mesh, direction)
        noisy = add_noise(seen.mesh, noise, direction=direction, random_state=_seed(chance))
        return seen.then(noisy)

    return scan


HARM: dict[str, dict[str, Harm]] = {
    "cuts": {f"{share:.0%}": _discs(share, 1) for share in (0.05, 0.1, 0.2, 0.4)} | {"half": _half},
    "holes": {f"{share:.0%}": _discs(share, 8) for share in (0.02, 0.05, 0.1, 0.2)},
    "scans": {"clean": _scan(0.0), "noise 0.2": _scan(0.2)},
    "welds": {
        f"{n} tubes": lambda chance, mesh, n=n: weld(mesh, n, random_state=_seed(chance))
        for n in (1, 4, 16)
    },
    "noise": {
        f"{noise}": lambda chance, mesh, noise=noise: add_noise(
            mesh, noise, random_state=_seed(chance)
        )
        for noise in (0.2, 0.5)
    }
    | {"components": lambda chance, mesh: add_components(mesh, random_state=_seed(chance))},
}


def cut_limb(chance: Chance, pair: Pair) -> Case:
    """Take one limb off the target."""
    assert pair.limbs is not None
    limb = chance.choice(np.unique(pair.limbs[1][pair.limbs[1] >= 0]))
    return Case(pair, unchanged(pair.source), keep(pair.target, pair.limbs[1] != limb))


def cut_apart(chance: Chance, pair: Pair) -> Case:
    """Cut a quarter off either end: what both still have is half of the body."""
    height = pair.source.vertices @ chance.standard_normal(3)
    return Case(pair, cut(pair.source, height, 0.25), cut(pair.target, -height[pair.back], 0.25))


BOTH: dict[str, Callable[[Chance, Pair], Case]] = {"limb": cut_limb, "overlap 50%": cut_apart}


def list_cases(name: str, options: Options) -> list[tuple[str, str]]:
    """Rows of the table of a set: the shapes and what is done to them."""
    if name == "proportions":
        return [(kind, "") for kind in KINDS]
    if name == "species":
        if options.becos is None:
            raise SystemExit("the set species needs --species FOLDER; see benchmarks/becos.py")
        return [("whole", ""), ("in part", "")]
    strengths = [*HARM[name], *(BOTH if name == "cuts" else ())]
    shapes = ["own", *(["tosca"] if options.tosca else [])]
    # The limbs of TOSCA are not marked.
    return [(s, done) for s in shapes for done in strengths if (s, done) != ("tosca", "limb")]


def draw(name: str, shapes: str, done: str, number: int, options: Options) -> Case:
    """Make a pair of a set; the same for the same numbers and seed."""
    chance = np.random.default_rng([options.seed, number, *f"{name} {shapes} {done}".encode()])
    if name == "proportions":
        pair = own_pair(chance, options, shapes, same_body=False)
    elif name == "species":
        pair = species_pair(chance, options, all_of_it=shapes == "whole")
    elif shapes == "tosca":
        pair = tosca_pair(chance, options)
    else:
        pair = own_pair(chance, options, KINDS[number % len(KINDS)], same_body=True)
    source, target = unchanged(pair.source), unchanged(pair.target)
    if not done:
        return Case(pair, source, target)
    if done in BOTH:
        return BOTH[done](chance, pair)
    harm = HARM[name][done]
    if number % 2:
        return Case(pair, harm(chance, pair.source), target)
    return Case(pair, source, harm(chance, pair.target))


SETS = ("proportions", "species", *HARM)
