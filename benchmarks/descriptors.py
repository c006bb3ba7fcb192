"""Descriptors compared by how well they find shapes of a kind.

    python benchmarks/descriptors.py [--tosca FOLDER] [--each N] [--jobs N] [--json FILE]
                                     [NAME ...]

Sets, each a collection of its own:

``known``   remeshed TOSCA, where UNBEND_DATA names its folder, and our own ten species in N
            (6) random poses, two of a meshing: 5 and 10 classes.
``meshed``, ``coarse``, ``holed``, ``noisy``   the same asked for by copies: meshed anew, with a
            third of the vertices, with 4 holes of 6 % of the area together, with noise of 0.15 mean
            edges. A copy's own original is left out of its list.
``tosca``   with --tosca: all of TOSCA, a folder of .off files, reduced to 4,000 vertices; poses of
            9 classes.
``things``  22 kinds of creatures and wares in N proportions, a quarter in pieces, some open,
            and N bodies of random proportions of each of our 3 kinds: 25 classes.
``even``, ``odd``   two halves of the kinds of ``things``: what is best on one must be on the other.

Columns are nearest neighbour, first tier, and mean average precision. ``cpu`` is the median time
of one thread for a shape of 5,000 vertices, eigenpairs included where a descriptor needs them.
Names choose rows.
"""

import argparse
import json
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import fast_simplification
import numpy as np
from scipy.spatial.distance import cdist
from things import BODIES, make_thing
from wares import WARES

from testshapes.bodies import make_body
from testshapes.damage import cut_discs
from testshapes.scanning import add_noise
from unbend import Mesh, distance, read_mesh
from unbend._types import FloatArray
from unbend.collection import Retrieval, retrieval_measures
from unbend.collection._descriptor import (
    Basis,
    heat_kernel,
    log_covariance,
    quantiles,
    wave_kernel,
)
from unbend.collection._whole import whole_surface
from unbend.datasets import make_biped, make_octopus, make_quadruped
from unbend.linalg.lanczos import smallest_eigenpairs
from unbend.mesh import vertex_areas
from unbend.preparation import prepare

SPECIES = {
    make_quadruped: ("dog", "cat", "horse", "bear", "giraffe"),
    make_biped: ("human", "child", "ape"),
    make_octopus: ("octopus", "squid"),
}
LEVELS = (np.arange(16) + 0.5) / 16
SAMPLES, N_EIGENPAIRS = 1000, 100
TIMES = np.geomspace(2e-3, 0.3, 8)
ENERGIES = np.log(4 * np.pi) + np.linspace(np.log(0.8), np.log(80), 12)


class Shape(NamedTuple):
    """A mesh in a set. ``origin`` names what it is a damaged copy of."""

    name: str
    kind: str
    mesh: Mesh
    origin: str = ""


class Known(NamedTuple):
    """What descriptors are taken of: a mesh, and all of it as one surface."""

    mesh: Mesh
    points: FloatArray
    basis: Basis


def logs(values: FloatArray) -> FloatArray:
    return np.log(np.maximum(values, 1e-3))


def sampled(weights: FloatArray) -> np.ndarray[Any, Any]:
    """Rows spread evenly over the area."""
    edges = np.cumsum(weights) / weights.sum()
    return np.searchsorted(edges, (np.arange(SAMPLES) + 0.5) / SAMPLES)


def spread(points: FloatArray) -> FloatArray:
    """Quantiles of the logarithms of all distances between points."""
    return logs(np.quantile(cdist(points, points)[np.triu_indices(len(points), 1)], LEVELS))


def shape_dna(shape: Known) -> FloatArray:
    return shape.basis.values[2:31] / shape.basis.values[1]


def weyl(shape: Known) -> FloatArray:
    values = shape.basis.values[1:41]
    return np.log(values / (4 * np.pi * np.arange(1, len(values) + 1)))


def biharmonic(shape: Known) -> FloatArray:
    return spread(shape.basis.functions[sampled(shape.basis.areas), 1:] / shape.basis.values[1:])


def diffusion(when: float, shape: Known) -> FloatArray:
    return spread(
        shape.basis.functions[sampled(shape.basis.areas)] * np.exp(-shape.basis.values * when)
    )


def geodesic(shape: Known) -> FloatArray:
    """Of the largest component: there is no way to another."""
    part = prepare(shape.mesh, component="largest").mesh
    areas = vertex_areas(part)
    sources = np.unique(sampled(areas)[:: SAMPLES // 50])
    lengths = distance(part, sources, distance="geodesic") / np.sqrt(areas.sum())
    rows = np.tile(areas / areas.sum() / len(sources), len(sources))
    return logs(quantiles(lengths.reshape(-1, 1), rows, LEVELS))


def form_moments(shape: Known) -> FloatArray:
    """Deviations of the first 12 coordinates, whose shape is that of the eigenfunctions.

    And the skewness and kurtosis of the first 3.
    """
    third, fourth = (shape.basis.areas @ shape.basis.functions[:, 1:4] ** power for power in (3, 4))
    return np.concatenate([-np.log(shape.basis.values[1:13]), np.abs(third), np.log(fourth)])


def heat_quantiles(shape: Known) -> FloatArray:
    heat = np.log(np.maximum(heat_kernel(shape.basis, TIMES), 1e-6))
    return quantiles(heat, shape.basis.areas, LEVELS)


def heat_covariance(shape: Known) -> FloatArray:
    return log_covariance(
        np.log(np.maximum(heat_kernel(shape.basis, TIMES), 1e-6)), shape.basis.areas
    )


def wave_quantiles(shape: Known) -> FloatArray:
    return quantiles(
        np.log(wave_kernel(shape.basis, ENERGIES, 0.7) + 1e-6), shape.basis.areas, LEVELS
    )


def wave_covariance(width: float, shape: Known) -> FloatArray:
    waves = np.log(wave_kernel(shape.basis, ENERGIES, width) + 1e-6)
    return log_covariance(waves, shape.basis.areas)


def straight(shape: Known) -> FloatArray:
    """Straight distances, which know the pose (D2 of Osada et al. 2002)."""
    return spread(shape.points[sampled(shape.basis.areas)])


def bulk(shape: Known) -> FloatArray:
    """Tell how flat, round or long the surface lies in space around its points, at four sizes."""
    basis, areas = shape.basis, shape.basis.areas
    points = shape.points - areas @ shape.points
    i, j = np.triu_indices(3)
    moments = np.column_stack([points, points[:, i] * points[:, j]])
    shares = basis.functions.T @ (areas[:, None] * moments)
    columns = []
    for when in (0.001, 0.002, 0.004, 0.008):
        means = basis.functions @ (np.exp(-basis.values * when)[:, None] * shares)
        spread_ = np.empty((len(areas), 3, 3))
        spread_[:, i, j] = spread_[:, j, i] = means[:, 3:]
        spread_ -= means[:, :3, None] * means[:, None, :3]
        columns.append(np.log(np.maximum(np.linalg.eigvalsh(spread_) / (4 * when), 0) + 0.05))
    return log_covariance(np.concatenate(columns, axis=1), areas)


WAVES = partial(wave_covariance, 0.7)
Part = Callable[[Known], FloatArray]
CANDIDATES: dict[str, list[tuple[float, Part]]] = {
    "ShapeDNA, 30 eigenvalues / first": [(1, shape_dna)],
    "40 eigenvalues / Weyl, logs": [(1, weyl)],
    "biharmonic distances": [(1, biharmonic)],
    "diffusion distances, t 0.003": [(1, partial(diffusion, 0.003))],
    "diffusion distances, t 0.1": [(1, partial(diffusion, 0.1))],
    "geodesic distances": [(1, geodesic)],
    "moments of the form": [(1, form_moments)],
    "straight distances (pose)": [(1, straight)],
    "bulk in space (pose)": [(1, bulk)],
    "heat kernel, quantiles": [(1, heat_quantiles)],
    "heat kernel, covariance": [(1, heat_covariance)],
    "wave kernel, quantiles": [(1, wave_quantiles)],
    "wave kernel 0.35, covariance": [(1, partial(wave_covariance, 0.35))],
    "wave kernel 0.7, covariance": [(1, WAVES)],
    "heat quantiles + eigenvalues": [(1, heat_quantiles), (1, weyl)],
    "waves + heat quantiles (chosen)": [(1, WAVES), (1, heat_quantiles)],
    "chosen + 0.4 bulk": [
        (1, WAVES),
        (1, heat_quantiles),
        (0.4, bulk),
    ],
    "chosen + 0.4 straight": [
        (1, WAVES),
        (1, heat_quantiles),
        (0.4, straight),
    ],
}


def reduce_to(mesh: Mesh, n_vertices: int) -> Mesh:
    few = mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)
    vertices, faces = fast_simplification.simplify(*few, target_count=2 * n_vertices)
    return Mesh(vertices.astype(float), faces.astype(np.int64), name=mesh.name)


def meshed_anew(mesh: Mesh, seed: int) -> Mesh:
    """Other vertices and triangles: every face split about a random point, then reduced."""
    shares = np.random.default_rng(seed).dirichlet([4, 4, 4], mesh.n_faces)
    middles = np.einsum("fk,fkd->fd", shares, mesh.vertices[mesh.faces])
    new = mesh.n_vertices + np.arange(mesh.n_faces)
    a, b, c = mesh.faces.T
    faces = np.concatenate(
        [np.column_stack(one) for one in ((a, b, new), (b, c, new), (c, a, new))]
    )
    return reduce_to(Mesh(np.concatenate([mesh.vertices, middles]), faces), mesh.n_vertices)


def damages(shape: Shape, seed: int) -> list[tuple[str, Shape]]:
    mesh = shape.mesh
    copies = {
        "meshed": meshed_anew(mesh, seed),
        "coarse": reduce_to(mesh, max(800, mesh.n_vertices // 3)),
        "holed": cut_discs(mesh, 0.06, 4, random_state=seed).mesh,
        "noisy": add_noise(mesh, 0.15, random_state=seed).mesh,
    }
    return [
        (done, Shape(f"{shape.name} {done}", shape.kind, copy, shape.name))
        for done, copy in copies.items()
    ]


def read_tosca(folder: Path) -> Iterator[tuple[str, str, Mesh]]:
    """Name, class and mesh of each ``cat0.off`` and so on."""
    for path in sorted(folder.glob("*[0-9].off")):
        yield path.stem, path.stem.rstrip("0123456789"), read_mesh(path)


def list_sets(tosca: Path | None, each: int) -> dict[str, list[Shape]]:
    """Shapes of each set."""
    known = []
    if "UNBEND_DATA" in os.environ:
        for name, kind, mesh in read_tosca(Path(os.environ["UNBEND_DATA"]) / "tosca_remeshed"):
            known.append(Shape(f"TOSCA {name}", f"TOSCA {kind}", mesh))
    for make, species in SPECIES.items():
        for kind in species:
            for i in range(each):
                n = (1500, 2000, 3000, 5000)[i % 4]
                one = make(None, n_vertices=n, species=kind, meshing=i // 2, random_state=i)
                known.append(Shape(f"{kind}{i}", kind, one.mesh))
    sets: dict[str, list[Shape]] = {"known": known}
    for i, shape in enumerate(known):
        for done, copy in damages(shape, i):
            sets.setdefault(done, []).append(copy)
    if tosca is not None:
        sets["tosca"] = [
            Shape(f"whole {name}", kind, reduce_to(mesh, 4000))
            for name, kind, mesh in read_tosca(tosca)
        ]
    sets["things"] = [
        Shape(f"thing {kind}{i}", kind, make_thing(kind, i))
        for kind in [*BODIES, *WARES]
        for i in range(each)
    ] + [
        Shape(f"body {kind}{i}", kind, make_body(kind, i, n_vertices=1500, random_state=i).mesh)
        for kind in ("quadruped", "biped", "octopus")
        for i in range(each)
    ]
    return sets


def measure(names: list[str], shape: Shape) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """Describe a shape by each candidate; and seconds of processor time."""
    warnings.simplefilter("ignore")
    start = time.process_time()
    points, stiffness, areas = whole_surface(shape.mesh)
    k = min(N_EIGENPAIRS, len(areas) // 2)
    pairs = smallest_eigenpairs(stiffness, areas, k, tol=1e-5)
    known = Known(shape.mesh, points, Basis(*pairs, areas))
    shared = time.process_time() - start
    blocks: dict[Part, FloatArray] = {}
    seconds: dict[Part, float] = {}
    for part in {part for name in names for _, part in CANDIDATES[name]}:
        start = time.process_time()
        block = part(known).ravel()
        blocks[part] = block / np.sqrt(block.size)
        seconds[part] = time.process_time() - start
    found = {
        name: np.concatenate([weight * blocks[part] for weight, part in CANDIDATES[name]])
        for name in names
    }
    return found, {
        name: shared + sum(seconds[part] for _, part in CANDIDATES[name]) for name in names
    }


def find(shapes: list[Shape], asking: list[Shape], vectors: dict[str, FloatArray]) -> Retrieval:
    """Measure how well shapes are found by themselves or by copies of them."""
    there = np.array([vectors[shape.name] for shape in shapes])
    apart = cdist(np.array([vectors[shape.name] for shape in asking]), there)
    own = [[shape.name in (one.name, one.origin) for shape in shapes] for one in asking]
    apart[np.array(own)] = np.nan
    return retrieval_measures(apart, [one.kind for one in shapes], [one.kind for one in asking])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("names", nargs="*")
    parser.add_argument("--tosca", type=Path)
    parser.add_argument("--each", type=int, default=6)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    names = [one for one in CANDIDATES if not options.names or one in options.names]
    sets = list_sets(options.tosca, options.each)
    every = [shape for shapes in sets.values() for shape in shapes]
    assert len({shape.name for shape in every}) == len(every)
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        rows = []
        for row in pool.map(partial(measure, names), every, chunksize=4):
            rows.append(row)
            print(f"{len(rows)} of {len(every)}", end="\r", file=sys.stderr, flush=True)
    kinds = list(dict.fromkeys(shape.kind for shape in sets["things"]))
    for half, start in (("even", 0), ("odd", 1)):
        sets[half] = [one for one in sets["things"] if one.kind in kinds[start::2]]
    table: dict[str, Any] = {}
    print(f"{'':34}{'cpu':>6}" + "".join(f"{name:>18}" for name in sets))
    for name in names:
        vectors = {one.name: row[0][name] for one, row in zip(every, rows, strict=True)}
        times = [
            row[1][name]
            for one, row in zip(every, rows, strict=True)
            if one.mesh.n_vertices == 5000
        ]
        table[name] = {"cpu": float(np.median(times)) if times else float("nan")}
        line = f"{name:34}{table[name]['cpu']:6.2f}"
        for key, shapes in sets.items():
            copies = key in ("meshed", "coarse", "holed", "noisy")
            found = find(sets["known"] if copies else shapes, shapes, vectors)
            table[name][key] = found.to_dict()
            line += f"{found.nearest_neighbor:7.1%}{found.first_tier:6.1%}{found.map:5.2f}"
        print(line, flush=True)
    if options.json:
        options.json.write_text(json.dumps(table, indent=1))


if __name__ == "__main__":
    main()
