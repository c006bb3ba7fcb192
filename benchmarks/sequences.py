"""Matching benchmark on any meshes that share their vertices: poses, animations, expressions.

    python benchmarks/sequences.py FOLDER [NAME ...] [--pairs N] [--seed S] [--jobs N] [--json FILE]

Every folder NAME in FOLDER (all, if none is named) holds one shape in several poses, vertex i the
same point in each. Pairs are drawn with the seed. Both meshes are turned at random, and those of
more than 6,000 vertices are simplified to some 3,500 to 5,500, each on its own, so that nothing
tells but the shape. The truth of a vertex is the vertex of the target nearest to where it was on
the full mesh; errors are geodesic, in square roots of the target's area, on the component that is
matched. Overlap is the lesser share that found a partner: both have all, so it should be 1.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from pathlib import Path
from typing import Any

import fast_simplification
import numpy as np
from hard import N_POINTS, SURE, WRONG
from processes import run_all
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from unbend import Mesh, evaluate, match, read_mesh
from unbend._types import IntArray
from unbend.errors import UnbendError

SUFFIXES = (".obj", ".off", ".ply", ".stl")
_MOST = 6000  # vertices that are left as they are
_LEFT = (3500, 5500)


def draw_pose(path: Path, chance: np.random.Generator) -> tuple[Mesh, IntArray, IntArray]:
    """Read, turn and simplify a pose: the mesh, its vertices on the full one, and that one's."""
    mesh = read_mesh(path)
    points, faces = mesh.vertices @ Rotation.random(random_state=chance).as_matrix().T, mesh.faces
    count = int(chance.integers(*_LEFT))
    vertices = points
    if len(points) > _MOST:
        vertices, faces = fast_simplification.simplify(
            points.astype(np.float32), faces.astype(np.int32), 1 - count / len(points)
        )
        used, corners = np.unique(faces, return_inverse=True)
        vertices, faces = vertices[used].astype(np.float64), corners.reshape(-1, 3)
    origin, image = cKDTree(points).query(vertices)[1], cKDTree(vertices).query(points)[1]
    return Mesh(vertices, faces, name=path.name), origin, image


def run_one(folder: Path, number: int, seed: int) -> dict[str, Any]:
    """Match a pair of a folder's poses and measure the map."""
    warnings.simplefilter("ignore")
    chance = np.random.default_rng([seed, number, *folder.name.encode()])
    poses = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    one, other = (poses[i] for i in chance.choice(len(poses), 2, replace=False))
    row: dict[str, Any] = {"shape": folder.name, "source": one.name, "target": other.name}
    source, origin, _ = draw_pose(one, chance)
    target, _, image = draw_pose(other, chance)
    start = time.perf_counter()
    try:
        found = match(source, target, cache=False)
    except UnbendError as error:
        return row | {"refused": str(error), "error": float("inf"), "confidence": 0.0}
    row["seconds"] = time.perf_counter() - start
    row["confidence"] = float(found.confidence)
    row["overlap"] = min(found.overlap_source, found.overlap_target)
    rows = chance.permutation(np.flatnonzero(found.source_to_target >= 0))[:N_POINTS]
    errors = evaluate(found.source_to_target, target, rows, image[origin[rows]]).errors()
    # A vertex may be nearest to another component than the one that is matched.
    return row | {"error": float(errors[np.isfinite(errors)].mean())}


def print_table(rows: list[dict[str, Any]]) -> None:
    """Print a line for each shape and one for all, and every map that went wrong."""
    print("shape                  pairs  right    mean   worst  overlap  wrong of > .9   s/map")
    for name in [*dict.fromkeys(row["shape"] for row in rows), "all"]:
        chosen = [row for row in rows if name in ("all", row["shape"])]
        errors = np.array([row["error"] for row in chosen])
        sure = np.array([row["confidence"] > SURE for row in chosen])
        overlap, seconds = (
            np.mean([row[key] for row in chosen if key in row] or [np.nan])
            for key in ("overlap", "seconds")
        )
        wrong = errors >= WRONG
        mean = errors[~wrong].mean() if not wrong.all() else np.nan
        print(
            f"{name:20}{len(chosen):8}{(~wrong).sum():7}{mean:8.4f}{errors.max():8.3f}"
            f"{overlap:9.3f}{f'{(wrong & sure).sum()} of {sure.sum()}':>15}{seconds:8.1f}"
        )
    for row in rows:
        if row["error"] >= WRONG:
            print(
                f"wrong: {row['shape']} {row['source']} to {row['target']}, error "
                f"{row['error']:.3f}, confidence {row['confidence']:.2f}"
            )


def main() -> None:
    """Draw pairs, match them, print the table; means are of the right maps."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--pairs", type=int, default=6, help="of each shape (default 6)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="pairs at a time")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every pair")
    given = parser.parse_args()
    folders = [given.folder / name for name in given.names] or sorted(
        path for path in given.folder.iterdir() if path.is_dir()
    )
    tasks = [
        (run_one, folder, number, given.seed) for folder in folders for number in range(given.pairs)
    ]
    rows = run_all(tasks, given.jobs)
    print_table(rows)
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
