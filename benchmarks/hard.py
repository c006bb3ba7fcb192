"""Benchmark of hard matches: different bodies, parts, scans, welds, with exact truth.

    python benchmarks/hard.py [SET ...] [--pairs N] [--seed S] [--vertices N] [--jobs N]
                              [--species FOLDER] [--tosca FOLDER] [--json FILE]

Sets are proportions, species, cuts, holes, scans, welds and noise; without any, all that there is
data for. Own bodies are drawn with the seed; ``--tosca`` (or UNBEND_DATA) adds remeshed TOSCA and
``--species`` animals and people of BeCoS (see benchmarks/becos.py).

Errors are geodesic on the whole target, whatever was cut off or grown together, in units of the
square root of its area, at source vertices whose true partner is left. A map is right if their
mean is below 0.08; one that is refused is wrong. ``mirrored``: maps that are right only up to the
target's left-right symmetry. ``iou``: intersection over union, by area, of the vertices that were
matched and those that have a true partner left, on the worse of the two shapes.
"""

from __future__ import annotations

import argparse
import json
import os
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from hard_sets import SETS, Case, Options, draw, list_cases
from processes import run_all

from unbend import Mesh, evaluate, match
from unbend._types import BoolArray, IntArray
from unbend.datasets import damaged_truth
from unbend.errors import UnbendError
from unbend.mesh import vertex_areas

WRONG = 0.08  # as in benchmarks/matching.py
SURE = 0.9
NOTHING = {"error": float("inf"), "mirrored_error": float("inf"), "iou": 0.0}
N_POINTS = 400  # points of a map that are measured: its mean is known to a thousandth


def run_one(name: str, shapes: str, done: str, number: int, options: Options) -> dict[str, Any]:
    """Match a pair and measure the map."""
    warnings.simplefilter("ignore")
    case = draw(name, shapes, done, number, options)
    row: dict[str, Any] = {"set": name, "shapes": shapes, "done": done, "pair": case.pair.name}
    start, cpu = time.perf_counter(), time.process_time()
    try:
        found = match(case.source.mesh, case.target.mesh, cache=False)
    except UnbendError as error:
        row |= {"refused": str(error), "confidence": 0.0} | NOTHING
    else:
        row["confidence"] = float(found.confidence)
        row |= measure(case, found.source_to_target, found.target_to_source)
    return row | {"seconds": time.perf_counter() - start, "cpu_seconds": time.process_time() - cpu}


def measure(case: Case, there: IntArray, back: IntArray) -> dict[str, float]:
    """Errors over the true overlap, and how well the overlap itself was found."""
    pair, source, target = case.pair, case.source, case.target
    truth = damaged_truth(pair.truth, source, target)
    truth_back = damaged_truth(pair.back, target, source)
    # Seen on the whole shapes, of which the true overlap is a part.
    rows = np.flatnonzero((truth >= 0) & (there >= 0))
    if len(rows) == 0:
        return NOTHING
    rows = np.random.default_rng(0).permutation(rows)[:N_POINTS]
    images = np.where(there >= 0, target.origin[there], -1)
    truths = [
        one[source.origin[rows]]
        for one in (pair.truth, pair.truth if pair.mirrored is None else pair.mirrored)
    ]
    found = evaluate(images, pair.target, rows, *truths)
    return {
        "error": found.mean(),
        "mirrored_error": found.mean("map-min"),
        "iou": min(
            _overlap(source.mesh, there >= 0, truth >= 0),
            _overlap(target.mesh, back >= 0, truth_back >= 0),
        ),
    }


def _overlap(mesh: Mesh, found: BoolArray, true: BoolArray) -> float:
    areas = vertex_areas(mesh)
    return float(areas[found & true].sum() / areas[found | true].sum())


def calibration(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Whether maps are right as often as their confidence says, over ten classes of it."""
    confidence = np.array([row["confidence"] for row in rows])
    right = np.array([row["error"] < WRONG for row in rows])
    bins = np.minimum((10 * confidence).astype(int), 9)
    gaps = [abs((confidence - right)[bins == i].sum()) for i in range(10)]
    sure = confidence > SURE
    return {
        "calibration_error": float(sum(gaps) / len(rows)),
        "brier": float(((confidence - right) ** 2).mean()),
        "sure": int(sure.sum()),
        "sure_and_wrong": int((sure & ~right).sum()),
    }


def summarise(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """One line of the table."""
    errors = np.array([row["error"] for row in rows])
    up_to_symmetry = np.array([row["mirrored_error"] for row in rows])
    finite = errors[np.isfinite(errors)]
    return {
        "pairs": len(rows),
        "right": float((errors < WRONG).mean()),
        "mirrored": int(((errors >= WRONG) & (up_to_symmetry < WRONG)).sum()),
        "mean": float(finite.mean()) if len(finite) else float("nan"),
        "mean_of_right": float(errors[errors < WRONG].mean()) if (errors < WRONG).any() else None,
        "worst": float(errors.max()),
        "iou": float(np.mean([row["iou"] for row in rows])),
        **calibration(rows),
        "seconds": float(np.mean([row["seconds"] for row in rows])),
        "cpu_seconds": float(np.mean([row["cpu_seconds"] for row in rows])),
    }


def print_table(groups: dict[str, list[dict[str, Any]]]) -> None:
    """Print a line for each set and strength, and for each set and for all together."""
    print(
        f"{'':32}pairs  right mirrored   mean  (right)  worst   iou    ece  brier"
        f"  wrong of > {SURE}    s   cpu s"
    )
    for label, rows in groups.items():
        one = summarise(rows)
        of_right = "      -" if one["mean_of_right"] is None else f"{one['mean_of_right']:7.4f}"
        wrong = f"{one['sure_and_wrong']} of {one['sure']}"
        print(
            f"{label:32}{one['pairs']:5}{one['right']:7.1%}{one['mirrored']:9}{one['mean']:7.3f}"
            f"  {of_right}{one['worst']:7.3f}{one['iou']:6.2f}{one['calibration_error']:7.3f}"
            f"{one['brier']:7.3f}{wrong:>15}{one['seconds']:7.1f}{one['cpu_seconds']:7.1f}"
        )


def grouped(rows: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Rows by set, shapes and strength; by set; and all."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for name in dict.fromkeys(row["set"] for row in rows):
        of_set = [row for row in rows if row["set"] == name]
        for row in of_set:
            groups.setdefault(f"{name} {row['shapes']} {row['done']}", []).append(row)
        groups[f"{name}: all"] = of_set
    return groups | {"all": rows}


def main() -> None:
    """Draw pairs, match them, print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("sets", nargs="*", metavar="SET")
    parser.add_argument("--pairs", type=int, default=12, help="of each line (default 12)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--vertices", type=int, default=2000, help="of own shapes and species")
    parser.add_argument("--jobs", type=int, default=1, help="pairs at a time")
    parser.add_argument("--species", type=Path, metavar="FOLDER", help="BeCoS")
    data = os.environ.get("UNBEND_DATA")
    there = Path(data) / "tosca_remeshed" if data else None
    parser.add_argument("--tosca", type=Path, metavar="FOLDER", default=there)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every pair and the table")
    given = parser.parse_args()
    if unknown := set(given.sets) - set(SETS):
        parser.error(f"there is no set {unknown.pop()}; the sets are {', '.join(SETS)}")
    options = Options(given.seed, given.vertices, given.tosca, given.species)
    sets = given.sets or [name for name in SETS if name != "species" or given.species]
    tasks = [
        (run_one, name, *line, number, options)
        for name in sets
        for line in list_cases(name, options)
        for number in range(given.pairs)
    ]
    rows = run_all(tasks, given.jobs)
    groups = grouped(rows)
    print_table(groups)
    if given.json:
        table = {label: summarise(some) for label, some in groups.items()}
        given.json.write_text(json.dumps({"table": table, "pairs": rows}, indent=1))


if __name__ == "__main__":
    main()
