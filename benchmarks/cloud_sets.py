"""Sets of point clouds that are sampled from public shapes with ground truth."""

import functools
from pathlib import Path

import numpy as np
from match_cases import Case, Draw, Set, chosen
from public_sets import rows_case
from scipy.spatial import cKDTree

from testshapes.damage import Damaged, unchanged
from testshapes.scanning import sample_points, seen_from
from unbend import Mesh

KINDS = ("cloud to mesh", "cloud to cloud", "mesh to cloud")
SGA18 = "SGA18_orientation_BCICP_dataset/Dataset/{}/vtx_5k"


def clouds(noise: float, n_points: int = 5000, view: bool = False) -> Set:
    """Make a set of clouds, by turns onto meshes, onto clouds, and of meshes onto clouds.

    The pairs are by turns of FAUST, TOSCA and SMAL. ``noise`` is a standard deviation in diagonals
    of the bounding box. With ``view``, one of the shapes is what a camera sees.
    """

    def draws(data: Path, seed: int, count: int | None) -> list[Draw]:
        tosca, faust = (data / SGA18.format(name) for name in ("TOSCA_Isometric", "FAUST"))
        smal = data / "DUO-FM/data/SMAL_r/shapes_train"
        animals = sorted(path.stem for path in smal.glob("*.off"))
        pairs = [
            [(faust, faust / "corres", pair) for pair in _pairs(faust)],
            [(tosca, tosca / "corres", pair) for pair in _pairs(tosca)],
            [(smal, smal.parent / "corres", (a, b)) for a in animals for b in animals if a < b],
        ]
        number = 20 if count is None else count
        drawn = [chosen(some, seed, -(-number // 3)) for some in pairs]
        return [
            functools.partial(cloud_case, *drawn[i % 3][i // 3], noise, n_points, view, [seed, i])
            for i in range(number)
        ]

    return draws


def _pairs(folder: Path) -> list[tuple[str, ...]]:
    lines = (folder / "../test_pairs.txt").read_text().splitlines()
    return [tuple(line.split()) for line in lines if line.strip()]


def cloud_case(
    folder: Path,
    truth: Path,
    names: tuple[str, str],
    noise: float,
    n_points: int,
    view: bool,
    seed: list[int],
) -> Case:
    """Read two shapes and sample one of them, or both."""
    case = rows_case(folder, truth, *names)
    kind = KINDS[seed[1] // 3 % 3]
    source, target = (
        sampled(mesh, n_points, noise, view and (side == 0 or kind == KINDS[2]), [*seed, side])
        if kind != KINDS[2 - 2 * side]
        else unchanged(mesh)
        for side, mesh in enumerate((case.source, case.target))
    )
    # A point corresponds to the known vertex nearest to where it was drawn.
    rows, images, mirrored = case.rows, case.images, case.mirrored
    if kind != KINDS[2]:
        known = cKDTree(case.source.vertices[rows])
        nearest = known.query(case.source.vertices[source.origin])[1]
        rows, images = np.arange(len(nearest)), images[nearest]
        mirrored = None if mirrored is None else mirrored[nearest]
    return case._replace(
        name=f"{kind}: {case.name}",
        source=source.mesh,
        target=target.mesh,
        rows=rows,
        images=images,
        mirrored=mirrored,
        origin=target.origin,
    )


def sampled(mesh: Mesh, n_points: int, noise: float, view: bool, seed: list[int]) -> Damaged:
    """Sample a mesh, or what a camera in a random direction sees of it."""
    chance = np.random.default_rng(seed)
    seen = seen_from(mesh, chance.standard_normal(3)) if view else unchanged(mesh)
    draw = int(chance.integers(2**31))
    return seen.then(sample_points(seen.mesh, n_points, noise=noise, random_state=draw))
