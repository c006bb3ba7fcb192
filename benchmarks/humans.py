"""Match people of eleven data sets as SHREC'19's contest does, each mesh as it came.

    python benchmarks/humans.py FOLDER [--pairs N] [--seed S] [--jobs N]

FOLDER is the contest's repository, github.com/riccardomarin/SHREC19_matching_humans (Melzi et al.
2019, "Matching humans with different connectivity"): 44 meshes in ``mat``, the pairs to match, the
true partners in ``matches/FARMgt_txt``. Pairs of meshes that are not there are left out. Every map
is measured at the contest's 6,890 points. Prints right maps (mean error below 0.08 of the square
root of the area), errors as straight distances, and how far confidence holds; and the same of the
contest's baseline, functional maps, where ``matches/FMAP_scaled`` has it.
"""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from hard import WRONG, calibration
from processes import run_all
from scipy.io import loadmat

from unbend import Mesh, match
from unbend.mesh import vertex_areas

PAIRS = "PAIRS_list_SHREC19_connectivity.txt"


def read_body(folder: Path, number: str) -> tuple[Mesh, Any]:
    """Read a mesh and the 6,890 of its vertices that correspond."""
    stored = loadmat(folder / "mat" / f"{number}.mat")
    body = stored["Shape_df"][0, 0]
    mesh = Mesh(body["VERT"].astype(float), body["TRIV"].astype(np.int64) - 1, name=number)
    return mesh, stored["smpl_matches"].ravel().astype(np.int64) - 1


def read_partners(folder: Path, name: str) -> Any:
    """Read a map of the contest's: for each vertex its partner, counted from 1."""
    return np.loadtxt(folder / "matches" / name, dtype=float).ravel().astype(np.int64) - 1


def run(folder: Path, source: str, target: str) -> dict[str, Any]:
    """Match one pair and measure it, and the baseline's map of it."""
    warnings.simplefilter("ignore")
    (one, points), (other, _) = (read_body(folder, number) for number in (source, target))
    truth = read_partners(folder, f"FARMgt_txt/{source}_{target}.txt")[points]
    unit = np.sqrt(vertex_areas(other).sum())

    def errors(point_map: Any) -> Any:
        images = point_map[points]
        off = np.linalg.norm(other.vertices[images] - other.vertices[truth], axis=1) / unit
        return off[images >= 0]

    start = time.perf_counter()
    found = match(one, other, cache=False)
    seconds = time.perf_counter() - start
    row = {"pair": f"{source} to {target}", "confidence": found.confidence, "seconds": seconds}
    row["unbend"] = errors(found.source_to_target)
    row["error"] = float(row["unbend"].mean())
    row["without"] = float((found.source_to_target[points] < 0).mean())
    try:
        row["baseline"] = errors(read_partners(folder, f"FMAP_scaled/{source}_{target}.txt"))
    except OSError:
        row["baseline"] = None
    print(
        f"{row['pair']}: {row['error']:.4f}, confidence {found.confidence:.2f}, {seconds:.1f} s",
        flush=True,
    )
    return row


def report(method: str, maps: list[Any]) -> None:
    """Print how many maps of a method are right, and all errors."""
    means, errors = np.array([one.mean() for one in maps]), np.concatenate(maps)
    shares = ", ".join(f"{(errors <= most).mean():.1%}" for most in (0.025, 0.05, 0.1))
    print(
        f"{method}: {(means < WRONG).sum()} of {len(means)} right, mean {means.mean():.4f}, median "
        f"{np.median(errors):.4f}, worst map {means.max():.4f}, within 0.025, 0.05, 0.1: {shares}"
    )


def main() -> None:
    """Match and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pairs", type=int, help="so many, drawn at random; all by default")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    pairs = [line.split(",") for line in (given.folder / PAIRS).read_text().split()]
    there = {path.stem for path in (given.folder / "mat").glob("*.mat")}
    pairs = [pair for pair in pairs if there.issuperset(pair)]
    chosen = np.random.default_rng(given.seed).permutation(len(pairs))[: given.pairs]
    rows = run_all([(run, given.folder, *pairs[i]) for i in chosen], given.jobs)
    print()
    report("unbend", [row["unbend"] for row in rows])
    if baseline := [row["baseline"] for row in rows if row["baseline"] is not None]:
        report("functional maps, the contest's baseline", baseline)
    left_out, seconds = (np.mean([row[what] for row in rows]) for what in ("without", "seconds"))
    print(f"points without partner: {left_out:.2%}; seconds: {seconds:.1f}")
    print(", ".join(f"{key}: {value:.4g}" for key, value in calibration(rows).items()))


if __name__ == "__main__":
    main()
