"""Pairs of shapes with ground truth: public sets in a folder, and bodies of our own.

FOLDER holds copies of public repositories under their own names:

    SGA18_orientation_BCICP_dataset       remeshed FAUST and TOSCA (Ren et al. 2018)
    DUO-FM                                SMAL, uneven FAUST and SCAPE (Donati et al. 2022)
    SHREC19_matching_humans               people of eleven sources (Melzi et al. 2019)
    becos-code                            animals and people of TOSCA (Ehm et al. 2025)
    Hyperspectral-Inverse-Skinning        animations and poses that share their vertices
    Intrinsic-Symmetry-Curve-Generation-  SHREC'07, with points marked by hand (Kim et al. 2011)

A set is a function of the folder, a seed and a number of pairs, which lists what draws its cases.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import becos
import numpy as np
from scipy.io import loadmat
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from unbend import Mesh, read_mesh
from unbend._types import BoolArray, IntArray
from unbend.datasets import (
    Damaged,
    add_components,
    add_noise,
    cut,
    cut_discs,
    damaged_truth,
    fuse,
    keep,
    make_body,
    rest_map,
    seen_from,
    weld,
)
from unbend.datasets.bodies import KINDS
from unbend.datasets.damage import unchanged

Chance = np.random.Generator


class Case(NamedTuple):
    """Two shapes to match, and what is known of them.

    ``rows`` are source vertices whose partner is known, and ``images`` that partner, a vertex of
    ``whole``: the target before anything was cut off it, on which errors are measured. ``origin``
    is the vertex of ``whole`` of each target vertex. ``overlap`` says which vertices of source and
    target have a partner on the other. ``mirrored`` is the mirror image of ``images``.
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


class Pair(NamedTuple):
    """Two whole shapes: the target vertex of each source vertex, and back; -1 for none."""

    name: str
    source: Mesh
    target: Mesh
    truth: IntArray
    back: IntArray
    mirrored: IntArray | None = None
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
        return of_rows(pair.name, pair.source, pair.target, every, pair.truth, *mirrored)
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
    """Draw so many of some pairs; all of them, in their order, if no number is given."""
    found = list(pairs)
    if count is None or count >= len(found):
        return found
    return [found[i] for i in np.random.default_rng(seed).permutation(len(found))[:count]]


# Sets with lists of corresponding vertices: row i of NAME.vts is one point on every shape.


def rows_case(folder: Path, truth: Path, source: str, target: str) -> Case:
    """Read two shapes and their rows of corresponding vertices, counted from 1."""
    one, other = (read_mesh(folder / f"{name}.off") for name in (source, target))
    names = [source, target, f"{target}.sym"]
    rows = [
        np.loadtxt(path, dtype=np.int64) - 1
        for path in (truth / f"{name}.vts" for name in names)
        if path.exists()
    ]
    return of_rows(f"{source} {target}", one, other, *rows)


def listed(folder: str, pairs: str, both: bool = False) -> Set:
    """Make a set of a folder of meshes, with ``corres`` in it, and a file that lists pairs."""

    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        place = data / folder
        lines = [line.split() for line in (place / pairs).read_text().splitlines()]
        names = [line for line in lines if line]
        if both:
            names += [line[::-1] for line in names]
        case = functools.partial(rows_case, place, place / "corres")
        return [functools.partial(case, *two) for two in chosen(names, seed, count)]

    return draws


def all_pairs(folder: str) -> Set:
    """Make a set of all pairs of a folder of meshes, with truth beside it, in one direction."""

    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        place = data / folder
        names = sorted(path.stem for path in place.glob("*.off"))
        pairs = [(a, b) for i, a in enumerate(names) for b in names[i + 1 :]]
        case = functools.partial(rows_case, place, place.parent / "corres")
        return [functools.partial(case, *two) for two in chosen(pairs, seed, count)]

    return draws


def shrec19(data: Path, seed: int, count: int | None) -> list[Draw]:
    """List the contest's pairs whose meshes are there."""
    folder = data / "SHREC19_matching_humans"
    lines = (folder / "PAIRS_list_SHREC19_connectivity.txt").read_text().split()
    there = {path.stem for path in (folder / "mat").glob("*.mat")}
    pairs = [pair for pair in (line.split(",") for line in lines) if there.issuperset(pair)]
    return [functools.partial(shrec19_case, folder, *two) for two in chosen(pairs, seed, count)]


def shrec19_case(folder: Path, source: str, target: str) -> Case:
    """Read two bodies, and their truth at the 6,890 points of the contest."""
    (one, rows), (other, _) = (_shrec19_body(folder, name) for name in (source, target))
    path = folder / "matches" / "FARMgt_txt" / f"{source}_{target}.txt"
    images = np.loadtxt(path, dtype=float).ravel().astype(np.int64) - 1
    return of_rows(f"{source} {target}", one, other, rows, images[rows])


def _shrec19_body(folder: Path, name: str) -> tuple[Mesh, IntArray]:
    stored = loadmat(folder / "mat" / f"{name}.mat")
    body = stored["Shape_df"][0, 0]
    mesh = Mesh(body["VERT"].astype(float), body["TRIV"].astype(np.int64) - 1, name=name)
    return mesh, stored["smpl_matches"].ravel().astype(np.int64) - 1


# Bodies with eyes, fingers or feet that are marked; cups, chairs and bearings are left out.
SHREC07 = {
    "human": 1, "ant": 81, "octopus": 121, "teddy": 161, "hand": 181, "fish": 221, "bird": 241,
    "armadillo": 281, "fourleg": 381,
}  # fmt: skip


def shrec07(*kinds: str, half: bool = False) -> Set:
    """Make a set of pairs of SHREC'07, of which points are marked; of halves onto wholes."""

    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        folder = data / "Intrinsic-Symmetry-Curve-Generation-/Trilateral/Mesh/SCB/Data"
        numbers = [SHREC07[kind] + np.arange(20) for kind in kinds]
        pairs = [(kind, a, b) for kind, some in zip(kinds, numbers, strict=True)
                 for a in some for b in some if a < b]  # fmt: skip
        case = functools.partial(shrec07_case, folder / "watertight_shrec07", half, seed)
        return [functools.partial(case, *one) for one in chosen(pairs, seed, count)]

    return draws


def shrec07_case(folder: Path, half: bool, seed: int, kind: str, one: int, other: int) -> Case:
    """Read two meshes and the vertices that are marked on both."""
    source, target = (read_mesh(folder / "Meshes" / f"{i}.off") for i in (one, other))
    rows, images = (_marked(folder / "Corrs" / f"{i}.vts") for i in (one, other))
    name = f"{kind} {one} {other}"
    if not half:
        return of_rows(name, source, target, rows, images)
    # What of the target has a partner is not known but at the marked points.
    chance = np.random.default_rng([seed, one, other])
    part = cut(source, source.vertices @ chance.standard_normal(3), 0.5)
    left = part.image[rows]
    every = np.arange(target.n_vertices)
    known = left >= 0
    return Case(name, part.mesh, target, left[known], images[known], target, every)


def _marked(path: Path) -> IntArray:
    return np.loadtxt(path, usecols=0, dtype=np.int64).ravel()


SUFFIXES = (".obj", ".off", ".ply", ".stl")
_MOST = 6000  # vertices that are left as they are
_LEFT = (3500, 5500)
SEQUENCES = (
    "cat-poses", "cheburashka", "chickenCrossing", "cow", "crane", "elephant-gallop",
    "elephant-poses", "face-poses", "horse-gallop", "horse-poses", "lion-poses", "pcow", "pdance",
    "pjump", "samba", "wolf",
)  # fmt: skip


def sequences(data: Path, seed: int, count: int | None) -> list[Draw]:
    """List pairs of poses of meshes that share their vertices, by turns of every shape."""
    folder = data / "Hyperspectral-Inverse-Skinning" / "models"
    return [
        functools.partial(sequence_case, folder / SEQUENCES[i % len(SEQUENCES)], i, seed)
        for i in range(64 if count is None else count)
    ]


def sequence_case(folder: Path, number: int, seed: int) -> Case:
    """Turn two poses at random, and simplify each on its own."""
    chance = np.random.default_rng([seed, number, *folder.name.encode()])
    poses = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    one, other = (poses[i] for i in chance.choice(len(poses), 2, replace=False))
    source, target = draw_pose(one, chance), draw_pose(other, chance)
    every = np.arange(source.mesh.n_vertices)
    name = f"{folder.name} {one.stem} {other.stem}"
    return of_rows(name, source.mesh, target.mesh, every, target.image[source.origin])


def draw_pose(path: Path, chance: Chance) -> Damaged:
    """Read, turn and simplify a pose."""
    mesh = read_mesh(path)
    turn = Rotation.random(random_state=chance).as_matrix()
    turned = Mesh(mesh.vertices @ turn.T, mesh.faces, name=path.name)
    count = int(chance.integers(*_LEFT))
    return coarser(turned, count if mesh.n_vertices > _MOST else mesh.n_vertices)


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
        pair
        for pair in becos.class_pairs(folder)
        if bool((becos.truth(folder, *pair) >= 0).all()) == all_of_it
    ]
    one, other = kinds[int(chance.integers(len(kinds)))]
    names = [str(chance.choice(becos.poses(folder)[kind])) for kind in (one, other)]
    coarse = [coarser(read_mesh(becos.mesh_file(folder, name)), 3000) for name in names]
    truth = damaged_truth(becos.truth(folder, one, other), *coarse)
    back = damaged_truth(becos.truth(folder, other, one), *coarse[::-1])
    return of_pair(Pair(" ".join(names), coarse[0].mesh, coarse[1].mesh, truth, back))


# Bodies of our own, and what befalls one of two shapes.


def own_pair(chance: Chance, kind: str, same_body: bool, n_vertices: int = 2000) -> Pair:
    """Two poses of one body of random proportions, or of two; each meshed on its own."""
    bodies, meshings, poses = (
        [int(seed) for seed in chance.integers(2**31, size=2)] for _ in range(3)
    )
    one, other = (
        make_body(
            kind,
            bodies[0 if same_body else i],
            n_vertices=n_vertices,
            meshing=meshings[i],
            random_state=poses[i],
        )
        for i in range(2)
    )
    truth = rest_map(one, other)
    assert other.mirror is not None
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
        (limbs[0], limbs[1]),
    )


def tosca_pair(chance: Chance, data: Path) -> Pair:
    """Take a pair of remeshed TOSCA; vertices without a row of the truth take the nearest's."""
    folder = data / "SGA18_orientation_BCICP_dataset/Dataset/TOSCA_Isometric/vtx_5k"
    lines = (folder / "../test_pairs.txt").read_text().splitlines()
    pairs = [line.split() for line in lines if line.strip()]
    names = [str(name) for name in chance.permutation(pairs[int(chance.integers(len(pairs)))])]
    one, other = (read_mesh(folder / f"{name}.off") for name in names)
    rows, images, mirrored = (
        np.loadtxt(folder / "corres" / f"{name}.vts", dtype=np.int64) - 1
        for name in (names[0], names[1], f"{names[1]}.sym")
    )
    nearest = cKDTree(one.vertices[rows]).query(one.vertices)[1]
    back = cKDTree(other.vertices[images]).query(other.vertices)[1]
    return Pair(" ".join(names), one, other, images[nearest], rows[back], mirrored[nearest])


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


def cut_limb(chance: Chance, pair: Pair) -> Case:
    """Take one limb off the target."""
    if pair.limbs is None:  # not marked
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
}
BOTH: dict[str, Callable[[Chance, Pair], Case]] = {"limb": cut_limb, "overlap 50%": cut_apart}


def bodies(shapes: str, done: str) -> Set:
    """Make a set of own bodies, by turns of each kind (shapes "own"), or of remeshed TOSCA."""

    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        number = 24 if count is None else count
        return [functools.partial(body_case, data, shapes, done, seed, i) for i in range(number)]

    return draws


def body_case(data: Path, shapes: str, done: str, seed: int, number: int) -> Case:
    """Draw a pair and do something to one of the shapes, by turns of every strength."""
    chance = np.random.default_rng([seed, number, *f"{shapes} {done}".encode()])
    kinds = [kind for kind in KINDS if (kind == "octopus") == (shapes == "octopuses")]
    if shapes == "tosca":
        pair = tosca_pair(chance, data)
    else:
        pair = own_pair(chance, kinds[number % len(kinds)], same_body=done != "proportions")
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


SGA18 = "SGA18_orientation_BCICP_dataset/Dataset/{}/vtx_5k"
SETS: dict[str, Set] = {
    "faust": listed(SGA18.format("FAUST"), "../test_pairs.txt"),
    "tosca": listed(SGA18.format("TOSCA_Isometric"), "../test_pairs.txt"),
    "apes": listed(SGA18.format("TOSCA_nonIsometric"), "../test_pairs.txt"),
    "smal": all_pairs("DUO-FM/data/SMAL_r/shapes_test"),
    "smal-train": all_pairs("DUO-FM/data/SMAL_r/shapes_train"),
    "uneven-faust": all_pairs("DUO-FM/data/FAUST_a/shapes_test"),
    "uneven-scape": all_pairs("DUO-FM/data/SCAPE_a/shapes_test"),
    "shrec19": shrec19,
    "shrec07": shrec07(*SHREC07),
    "shrec07-halves": shrec07("human", "teddy", "armadillo", "fourleg", half=True),
    "sequences": sequences,
    "species": species(True),
    "species-parts": species(False),
    "poses": bodies("own", "poses"),
    "proportions": bodies("own", "proportions"),
    "octopuses": bodies("octopuses", "proportions"),
    "different": different,
} | {
    f"{shapes}{done}": bodies(of, done)
    for shapes, of in (("", "own"), ("octopus-", "octopuses"), ("tosca-", "tosca"))
    for done in HARM
    if (of, done) != ("tosca", "noise")
}
