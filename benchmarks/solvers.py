"""Time our sparse factorisation beside the libraries that could take its place.

Each library works in a process of its own, in turn, as often as asked; the least times are printed
as a table, in docs/engine.md, with the median of a repeat over the least. What is not installed is
left out. On one thread times are of the processor, which other work on the machine hardly changes;
on more (``--threads 2``) they are of the clock, and the machine must be quiet.
"""

import argparse
import importlib
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

COLUMNS = (1, 8, 64)
SUPERLU_MOST = 500_000  # vertices: beyond, its minimum degree order does not end
_Solve = Callable[[np.ndarray], np.ndarray]


def multifrontal(matrix: sp.csc_matrix) -> tuple[_Solve, np.ndarray]:
    from unbend.linalg.factorization import _multifrontal

    _, pivots, solve = _multifrontal(matrix)
    return solve, pivots


def qdldl_and_numba(matrix: sp.csc_matrix) -> tuple[_Solve, np.ndarray]:
    from unbend.linalg.factorization import _qdldl

    _, pivots, solve = _qdldl(matrix, compiled=True)
    return solve, pivots


def superlu(matrix: sp.csc_matrix) -> tuple[_Solve, np.ndarray]:
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    pivots = factor.U.diagonal()
    if not np.array_equal(factor.perm_r, factor.perm_c):  # a pivot off the diagonal: no inertia
        pivots = np.full_like(pivots, np.nan)
    return lambda rhs: factor.solve(np.asfortranarray(rhs)), pivots


def cholespy(matrix: sp.csc_matrix) -> tuple[_Solve, None]:
    from cholespy import CholeskySolverD, MatrixType

    indices = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)
    solver = CholeskySolverD(matrix.shape[0], *indices, matrix.data, MatrixType.CSC)

    def solve(rhs: np.ndarray) -> np.ndarray:
        solution = np.empty_like(rhs)
        solver.solve(rhs, solution)
        return solution

    return solve, None


def python_mumps(matrix: sp.csc_matrix) -> tuple[_Solve, Any]:
    import mumps

    context = mumps.Context()
    context.set_matrix(matrix, symmetric=True)
    context.factor(ordering="metis", pivot_tol=0.0)
    # INFOG(12) counts negative pivots: an array with as many stands for D.
    return context.solve, -np.ones(context.mumps_instance.infog[12])


SOLVERS = {
    "multifrontal": (multifrontal, "numba"),
    "qdldl+numba": (qdldl_and_numba, "qdldl"),
    "superlu": (superlu, "scipy"),
    "cholespy": (cholespy, "cholespy"),
    "python-mumps": (python_mumps, "mumps"),
}


def memory(peak: bool) -> float:
    """GiB that this process has, or had at most, in memory (Linux)."""
    status = Path("/proc/self/status").read_text()
    kib = re.search(rf"{'VmHWM' if peak else 'VmRSS'}:\s*(\d+)", status)
    return int(kib[1]) / 2**20 if kib else float("nan")


def measure(name: str, folder: Path, clock: Callable[[], float]) -> dict[str, Any]:
    """Factorise, solve and count with one library; give times, memory and errors."""
    decompose = SOLVERS[name][0]
    small = sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(200, 200))
    for columns in COLUMNS:  # what is compiled is compiled, or loaded, before
        decompose(sp.csc_matrix(small))[0](np.ones((200, columns)))
    matrix = sp.csc_matrix(sp.load_npz(folder / "definite.npz"))
    before = memory(peak=False)
    start = clock()
    solve, _ = decompose(matrix)
    found: dict[str, Any] = {"factor": clock() - start, "memory": memory(peak=True) - before}
    for columns in COLUMNS:
        rhs = np.random.default_rng(0).standard_normal((matrix.shape[0], columns))
        times = []
        for _ in range(3):
            start = clock()
            solution = solve(rhs)
            times.append(clock() - start)
        found[str(columns)] = min(times) / columns
        found["residual"] = float(np.abs(matrix @ solution - rhs).max() / np.abs(rhs).max())
    del solve
    if (folder / "indefinite.npz").exists():
        indefinite = sp.csc_matrix(sp.load_npz(folder / "indefinite.npz"))
        try:
            solve, pivots = decompose(indefinite)
            unknown = (
                "none" if np.isfinite(solve(np.ones((matrix.shape[0], 1)))).all() else "not finite"
            )
            found["inertia"] = unknown if pivots is None else int((pivots < 0).sum())
        except Exception as error:
            found["inertia"] = type(error).__name__
    return found


def run_child(name: str, folder: str, threads: str) -> dict[str, Any]:
    """Measure in a process of its own, on so many threads."""
    command = [sys.executable, __file__, "--solvers", name, "--threads", threads, "--child", folder]
    variables = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), threads)
    done = subprocess.run(command, env=os.environ | variables, stdout=subprocess.PIPE, check=True)
    last = done.stdout.splitlines()[-1]  # libraries may say something before
    return dict(json.loads(last))


def prepare(n: int, folder: Path) -> int:
    """Write a subdivided quadruped's Laplacian: definite, and shifted beyond 100 eigenvalues."""
    from shapes import quadruped, subdivide

    from unbend.linalg.pseudoinverse import pinned
    from unbend.spectral import make_surface

    times = 2 if n > 500_000 else 1
    mesh = quadruped(round(n / 4**times))
    for _ in range(times):
        mesh = subdivide(mesh, "quadruped")
    operator = make_surface(mesh).operator
    sp.save_npz(folder / "definite.npz", sp.csc_matrix(pinned(operator.stiffness)))
    shift = 4 * np.pi * 100 * sp.diags_array(operator.areas)
    sp.save_npz(folder / "indefinite.npz", sp.csc_matrix(operator.stiffness - shift))
    return mesh.n_vertices


def installed(module: str) -> bool:
    try:
        importlib.import_module(module)
    except ImportError:
        return False
    return True


def table(n: int, threads: int, runs: dict[str, list[dict[str, Any]]]) -> str:
    """Format the least of each figure, and how far the repeats of the factorisation lie apart."""
    kind = "CPU time, 1 thread" if threads == 1 else f"wall time, {threads} threads"
    lines = [
        f"{n:,} vertices, {kind}:",
        "",
        "| | factor s | ms per right-hand side: alone | of 8 | of 64 | memory GiB | residual "
        "| negative eigenvalues | median / least |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, found in runs.items():
        least = {key: min(run[key] for run in found) for key in ("factor", "1", "8", "64")}
        spread = statistics.median(run["factor"] for run in found) / least["factor"]
        lines.append(
            f"| {name} | {least['factor']:.2f} | "
            + " | ".join(f"{1e3 * least[str(columns)]:.1f}" for columns in COLUMNS)
            + f" | {max(run['memory'] for run in found):.2f} | {found[0]['residual']:.0e} "
            f"| {found[0].get('inertia', '')} | {spread:.2f} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[100_000, 200_000, 1_000_000])
    parser.add_argument("--solvers", nargs="+", choices=SOLVERS, default=list(SOLVERS))
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        clock = time.process_time if options.threads == 1 else time.perf_counter
        print(json.dumps(measure(*options.solvers, options.child, clock)))
        return
    present = [name for name in options.solvers if installed(SOLVERS[name][1])]
    for size in options.sizes:
        with tempfile.TemporaryDirectory() as folder:
            n = prepare(size, Path(folder))
            names = [name for name in present if name != "superlu" or n <= SUPERLU_MOST]
            runs: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
            for _ in range(options.repeats):
                for name in names:
                    runs[name].append(run_child(name, folder, str(options.threads)))
                    print(n, name, runs[name][-1], file=sys.stderr)
            print(table(n, options.threads, runs), end="\n\n")


if __name__ == "__main__":
    main()
