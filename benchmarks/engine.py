"""Time unbend against the libraries people use for the same step, and check both answers.

Ours and the peer run in turn in one process, so that a busy machine slows both; medians are
compared. Run with ``make bench``; ``--large`` adds a million vertices, ``--quick`` is a smoke test.
"""

import argparse
import os
import statistics
import sys
import tempfile
import time
import warnings
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from measure import alternate, file_to_file, seconds
from shapes import quadruped, subdivide

from report import write_report
from unbend import Mesh, canonical_form, distance, read_mesh, spectrum
from unbend.canonical import distance_coefficients, sampled_scaling, shape_end, spread_samples
from unbend.datasets import make_quadruped
from unbend.distances import make_metric
from unbend.linalg.lanczos import smallest_eigenpairs
from unbend.linalg.pseudoinverse import green_operator
from unbend.spectral import Spectrum, Surface, make_surface, use_cache

COLUMNS = 496


@dataclass(frozen=True)
class Row:
    """One comparison: seconds of ours and of the peer, and how far the answers agree."""

    what: str
    n: int
    ours: float
    peer: str = ""
    theirs: float = float("nan")
    agreement: str = ""
    mark: float = float("nan")  # how many times faster ours must be
    right: bool = True  # whether the answers agree as they must

    @property
    def ratio(self) -> float:
        """How many times faster ours is."""
        return self.theirs / self.ours


def eigenpairs_by_scipy(surface: Surface, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Call what functional-map libraries do: shift-invert ARPACK with its defaults."""
    mass = sp.diags_array(surface.operator.areas).tocsc()
    return spla.eigsh(sp.csc_array(surface.operator.stiffness), k, M=mass, sigma=-0.01)


def eigenvalue_gap(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Largest relative difference; a missed pair shows as a large one."""
    ours, theirs = np.sort(ours)[1:], np.sort(theirs)[1:]
    return float(np.abs(ours / theirs - 1).max())


def bench_eigenpairs(mesh: Mesh, k: int, repeats: int, mark: float) -> Row:
    surface = make_surface(mesh)
    stiffness, areas = surface.operator.stiffness, surface.operator.areas
    ours, mine, theirs, other = alternate(
        lambda: smallest_eigenpairs(stiffness, areas, k),
        lambda: eigenpairs_by_scipy(surface, k),
        repeats,
    )
    gap = eigenvalue_gap(mine[0], other[0])
    what = f"{k} eigenpairs, {mesh.name}"
    note = f"eigenvalues to {gap:.0e}"
    return Row(what, mesh.n_vertices, ours, "SciPy eigsh", theirs, note, mark, gap < 1e-6)


@use_cache(gib=0)
def bench_pyfm(mesh: Mesh, k: int, repeats: int) -> Row:
    from pyFM.mesh import TriMesh

    ours, mine, theirs, other = alternate(
        lambda: spectrum(mesh, k, area_kind="barycentric"),
        lambda: TriMesh(np.array(mesh.vertices), np.array(mesh.faces)).process(k),
        repeats,
    )
    gap = eigenvalue_gap(mine.eigenvalues, other.eigenvalues)
    note = f"eigenvalues to {gap:.0e}"
    what = f"Laplacian and {k} eigenpairs, {mesh.name}"
    return Row(what, mesh.n_vertices, ours, "pyFM process", theirs, note, 1.0, gap < 1e-6)


def bench_classical(mesh: Mesh, mark: float) -> Row:
    from sklearn.manifold import ClassicalMDS

    every = distance(mesh, np.arange(mesh.n_vertices), distance="biharmonic")
    every = (every + every.T) / 2 / np.sqrt(canonical_form(mesh).area)
    peer = ClassicalMDS(n_components=3, metric="precomputed")
    ours, form, theirs, points = alternate(
        lambda: canonical_form(mesh), lambda: peer.fit_transform(every), 1
    )
    signs = np.sign((form.points * points).sum(axis=0))
    gap = float(np.abs(form.points - signs * points).max() / np.abs(points).max())
    note, name = f"embedding to {gap:.0e}", "scikit-learn ClassicalMDS, matrix given"
    what = f"exact form, {mesh.name}"
    return Row(what, mesh.n_vertices, ours, name, theirs, note, mark, gap < 1e-8)


def spectral_mds(mesh: Mesh, n_samples: int, k: int) -> np.ndarray:
    """S-MDS as people compose it: heat geodesics, eigenpairs by SciPy, the rest by unbend."""
    import potpourri3d

    surface = make_surface(mesh)
    values, functions = eigenpairs_by_scipy(surface, k)
    pairs = Spectrum(values, functions, surface.operator.areas, surface.operator.kind)
    unit = mesh.vertices / np.sqrt(surface.area)
    heat = potpourri3d.MeshHeatMethodDistanceSolver(unit, np.array(mesh.faces), use_robust=True)
    samples, distances = spread_samples(
        lambda sources: heat.compute_distance(int(sources[0]))[None],
        mesh.n_vertices,
        n_samples,
        shape_end(pairs),
    )
    coefficients = distance_coefficients(
        distances**2, samples, pairs, mu=1e4, interpolation="projection"
    )
    return sampled_scaling(coefficients, pairs, 3, "uniform")[0]


def bench_spectral_mds(mesh: Mesh, n_samples: int, k: int, repeats: int, mark: float) -> Row:
    ours, form, theirs, _ = alternate(
        lambda: canonical_form(mesh), lambda: spectral_mds(mesh, n_samples, k), repeats
    )
    # Not the same distance, so not the same form: ours is checked against its own operator.
    operator = make_surface(mesh).operator
    green = green_operator(operator.stiffness, operator.areas)
    image = green(green(form.points) * operator.areas[:, None])
    image -= image.mean(axis=0)
    residual = np.linalg.norm(image - form.points * form.eigenvalues, axis=0)
    worst = float((residual / (form.eigenvalues[0] * np.sqrt(form.eigenvalues))).max())
    note, what = f"residual {worst:.0e}", f"exact form, {mesh.name}"
    peer = f"S-MDS, {n_samples} heat geodesics, {k} pairs"
    return Row(what, mesh.n_vertices, ours, peer, theirs, note, mark, worst < 1e-8)


def bench_columns(mesh: Mesh, count: int, share: int, mark: float) -> list[Row]:
    """Columns of the biharmonic kernel K A K, factorisation included."""
    surface, n = make_surface(mesh), mesh.n_vertices
    stiffness, areas = surface.operator.stiffness, surface.operator.areas
    sources = np.random.default_rng(0).permutation(n)[:count]

    def ours() -> np.ndarray:
        gram = make_metric("biharmonic", surface).gram
        columns = np.empty((n, count))
        for start in range(0, count, 64):
            part = sources[start : start + 64]
            unit = np.zeros((n, len(part)))
            unit[part, np.arange(len(part))] = 1
            columns[:, start : start + 64] = gram(unit)
        return columns

    def by_scipy() -> tuple[np.ndarray, float]:
        symmetric = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
        matrix = sp.csc_matrix(stiffness[1:, 1:])
        took, factor = seconds(lambda: spla.splu(matrix, diag_pivot_thresh=0.0, **symmetric))
        columns = np.zeros((n, share))
        columns[sources[:share], np.arange(share)] = 1
        start = time.perf_counter()
        for weight in (areas[:, None], 1.0):
            columns -= areas[:, None] * columns.sum(axis=0)
            columns[1:], columns[0] = factor.solve(columns[1:]), 0
            columns = (columns - areas @ columns) * weight
        return columns, took + (time.perf_counter() - start) * count / share

    mine_s, mine, _, (theirs, theirs_s) = alternate(ours, by_scipy, 1)
    gap = float(np.abs(mine[:, :share] - theirs).max() / np.abs(theirs).max())
    what = f"{count} biharmonic columns, {mesh.name}"
    scaled = f" ({share} timed, scaled)" if share < count else ""
    note = f"columns to {gap:.0e}"
    rows = [Row(what, n, mine_s, "SciPy splu" + scaled, theirs_s, note, mark, gap < 1e-8)]

    import potpourri3d

    def heat() -> float:
        make = lambda: potpourri3d.MeshHeatMethodDistanceSolver(  # noqa: E731
            np.array(mesh.vertices), np.array(mesh.faces), use_robust=True
        )
        first, solver = seconds(make)
        rest, _ = seconds(lambda: [solver.compute_distance(int(s)) for s in sources[:share]])
        return first + rest * count / share

    note = "another distance"
    rows.append(Row(what, n, mine_s, "potpourri3d robust heat" + scaled, heat(), note))
    return rows


def bench_growth(shapes: list[Mesh], repeats: int) -> list[Row]:
    """Exact forms of all sizes: in the library, and file to file."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for mesh in shapes:
            canonical_form(mesh)
            times = [seconds(lambda mesh=mesh: canonical_form(mesh))[0] for _ in range(repeats)]
            rows.append(Row(f"exact form, {mesh.name}", mesh.n_vertices, statistics.median(times)))
            took, peak = file_to_file("canonical", [mesh], Path(folder), "form.ply")
            what = f"file to file, {mesh.name}"
            rows.append(Row(what, mesh.n_vertices, took, agreement=f"{peak:.2f} GiB"))
    return rows


def bench_first_match(quick: bool) -> list[Row]:
    """`unbend match` of two files on a new machine, where everything is compiled, and again.

    A quick one takes what is compiled already, and is no first one.
    """
    n = 500 if quick else 1500
    meshes = [make_quadruped(pose, n_vertices=n).mesh for pose in ("standing", "walking")]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        compiled = {} if quick else {"NUMBA_CACHE_DIR": f"{folder}/compiled"}
        for what in ("next match",) if quick else ("first match, all compiled", "next match"):
            took, peak = file_to_file("match", meshes, Path(folder), "map.npz", **compiled)
            rows.append(Row(what, meshes[0].n_vertices, took, agreement=f"{peak:.2f} GiB"))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--large", action="store_true", help="add a million vertices")
    parser.add_argument("--quick", action="store_true", help="tiny sizes: does everything run?")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    quick = options.quick
    small, medium, large = (
        quadruped(n) for n in ((500, 500, 500) if quick else (5_000, 25_000, 50_000))
    )
    huge = subdivide(large, "quadruped subdivided")
    k, count, share, repeats = (10, 20, 5, 1) if quick else (100, COLUMNS, 24, 3)
    shapes = [large]
    koala = Path(os.environ.get("UNBEND_DATA", "")) / "large" / "koala.obj"
    if koala.is_file() and not quick:
        shapes.append(read_mesh(koala))
    rows: list[Row] = []

    def add(more: list[Row]) -> None:
        rows.extend(more)
        print(*(f"{row.what}: {row.ours:.2f} s" for row in more), sep="\n", file=sys.stderr)

    add(bench_first_match(quick))
    add([bench_classical(small, 100)])
    for mesh in (small, medium):
        add([bench_eigenpairs(mesh, k, repeats, float("nan"))])
    for mesh in shapes:
        add([bench_eigenpairs(mesh, k, repeats, 4)])
        add([bench_spectral_mds(mesh, 20 if quick else 200, k, min(2, repeats), 20)])
        add(bench_columns(mesh, count, share, 2.5))
    if find_spec("pyFM"):
        add([bench_pyfm(large, k, min(2, repeats))])
    add([bench_eigenpairs(huge, k, 1, float("nan"))])
    growing = [small, huge] if quick else [small, medium, *shapes, huge]
    if options.large:
        million = subdivide(subdivide(quadruped(65_000), ""), "quadruped subdivided twice")
        growing.append(million)
    growth = bench_growth(growing, repeats)
    add(growth)
    if quick:  # marks are for the real sizes
        rows = [replace(row, mark=float("nan")) for row in rows]
    write_report(rows, growth, options.out)


if __name__ == "__main__":
    main()
