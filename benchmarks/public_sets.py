"""Sets of public shapes, read from a folder that benchmarks/match_sets.py describes."""

import functools
import itertools
from pathlib import Path

import numpy as np
from match_cases import Case, Chance, Draw, Pair, Set, chosen, coarser, of_rows
from scipy.io import loadmat
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from testshapes.damage import Damaged, cut
from unbend import Mesh, read_mesh
from unbend._types import IntArray
from unbend.io import read_markup_pairs

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


def rows_pair(folder: Path, truth: Path, source: str, target: str) -> Pair:
    """Read two shapes; vertices without a row of the truth take that of the nearest with one."""
    one, other = (read_mesh(folder / f"{name}.off") for name in (source, target))
    names = [source, target, f"{target}.sym"]
    rows, images, *mirrored = (
        np.loadtxt(path, dtype=np.int64) - 1
        for path in (truth / f"{name}.vts" for name in names)
        if path.exists()
    )
    nearest = cKDTree(one.vertices[rows]).query(one.vertices)[1]
    back = cKDTree(other.vertices[images]).query(other.vertices)[1]
    return Pair(
        f"{source} {target}", one, other, images[nearest], rows[back],
        *(some[nearest] for some in mirrored),
    )  # fmt: skip


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


_SHREC07 = "Intrinsic-Symmetry-Curve-Generation-/Trilateral/Mesh/SCB/Data/watertight_shrec07"


def shrec07(*kinds: str, half: bool = False) -> Set:
    """Make a set of pairs of SHREC'07, of which points are marked; of halves onto wholes."""

    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        numbers = [SHREC07[kind] + np.arange(20) for kind in kinds]
        pairs = [(kind, a, b) for kind, some in zip(kinds, numbers, strict=True)
                 for a in some for b in some if a < b]  # fmt: skip
        case = functools.partial(shrec07_case, data / _SHREC07, half, seed)
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


def marked_pair(data: Path, kind: str, one: int, other: int, n_vertices: int) -> Pair:
    """Read and simplify two shapes of SHREC'07, of which the marked points alone are known."""
    folder = data / _SHREC07
    left = [coarser(read_mesh(folder / "Meshes" / f"{i}.off"), n_vertices) for i in (one, other)]
    rows, images = (
        part.image[_marked(folder / "Corrs" / f"{i}.vts")]
        for part, i in zip(left, (one, other), strict=True)
    )
    truth, back = (np.full(part.mesh.n_vertices, -1) for part in left)
    truth[rows], back[images] = images, rows
    return Pair(f"{kind} {one} {other}", left[0].mesh, left[1].mesh, truth, back)


# Mouse skulls some vertices of which have no place.
_NOWHERE = {"B6FVBF1", "CAF1_J", "FVB_NJ", "MRL_MPJ", "NOD_SHILTJ", "TALLYHO_JNGJ", "WSB"}


def specimens(meshes: str, landmarks: str) -> Set:
    """Make a set of pairs of specimens, on which landmarks were placed in 3D Slicer.

    Both are paths of files, with an asterisk for the name of a specimen.
    """

    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        before, _, after = meshes.partition("*")
        paths = [path.relative_to(data).as_posix() for path in data.glob(meshes)]
        names = {path.removeprefix(before).removesuffix(after) for path in paths} - _NOWHERE
        pairs = itertools.combinations(sorted(names), 2)
        case = functools.partial(specimen_case, str(data / meshes), str(data / landmarks))
        return [functools.partial(case, *two) for two in chosen(pairs, seed, count)]

    return draws


def specimen_case(meshes: str, landmarks: str, *names: str) -> Case:
    """Read two specimens, and the vertices at the landmarks that both have."""
    one, other = (read_mesh(meshes.replace("*", name)) for name in names)
    paths = [landmarks.replace("*", name) for name in names]
    return of_rows(" ".join(names), one, other, *read_markup_pairs(paths, one, other)[1].T)


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
