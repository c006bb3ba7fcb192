"""Match pairs of shapes whose correspondence is known, and print one table of how right it is.

    python benchmarks/match.py SET ... [--data FOLDER] [--pairs N] [--seed S] [--jobs N]
                               [--out FILE] [--groups]

SETS are those of benchmarks/match_sets.py, which says where the data comes from; ``list`` names
them all. Everything is at its default, and nothing but compiled code is cached. A set with a list
of pairs is matched whole unless ``--pairs`` draws some. FILE (JSON lines) keeps what was measured:
a run that was interrupted goes on where it stopped.

Errors are geodesic distances on the whole target, in square roots of its area, at source vertices
whose partner is known and was found. A map is right if their mean is below 0.08; one that is
refused is wrong. ``IoU`` is the intersection over union, by area, of the vertices that were matched
and those that have a partner, on the worse of the two shapes. ``calibration`` is how far right maps
are from as many as their confidences say, over ten classes of it (expected calibration error).
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
from match_sets import SETS, Case, Draw
from processes import run_all

from unbend import Mesh, evaluate, match
from unbend._types import BoolArray, IntArray
from unbend.errors import UnbendError
from unbend.mesh import vertex_areas

WRONG = 0.08  # a map whose mean error is larger has a limb, a side or an end mistaken
SURE = 0.9
N_POINTS = 200  # points of a map that are measured: its mean is known to one or two thousandths


def run(name: str, draw: Draw) -> dict[str, Any]:
    """Match a pair and measure the map."""
    warnings.simplefilter("ignore")
    case = draw()
    row: dict[str, Any] = {"set": name, "pair": case.name}
    start = time.process_time()
    try:
        found = match(case.source, case.target, cache=False)
    except UnbendError as error:
        return row | {"refused": str(error), "confidence": 0.0, "error": np.inf, "cpu": 0.0}
    row["cpu"] = time.process_time() - start
    row["confidence"] = float(found.confidence)
    row["orientation"] = float(found.orientation)
    row["overlap"] = min(found.overlap_source, found.overlap_target)
    row["energies"] = [one.energy for one in found.hypotheses]
    return row | measure(case, found.source_to_target, found.target_to_source)


def measure(case: Case, there: IntArray, back: IntArray) -> dict[str, Any]:
    """Errors over the true overlap, and how well the overlap itself was found."""
    known = np.flatnonzero(there[case.rows] >= 0)
    if not len(known):
        return {"error": np.inf, "mirrored": False, "iou": 0.0}
    known = np.random.default_rng(0).permutation(known)[:N_POINTS]
    images = np.where(there >= 0, case.origin[there], -1)
    rows, *truths = (
        one[known] for one in (case.rows, case.images, case.mirrored) if one is not None
    )
    found = evaluate(images, case.whole, rows, *truths)
    # What is known may lie on another component than the one that was matched.
    errors = found.errors("direct")
    errors = errors[np.isfinite(errors)]
    row: dict[str, Any] = {
        "error": float(errors.mean()),
        "shares": [float((errors <= most).mean()) for most in (0.025, 0.05, 0.1)],
        "mirrored": len(truths) > 1 and bool(found.mean("map-min") < WRONG <= errors.mean()),
    }
    if case.overlap is not None:
        row["iou"] = min(
            _iou(mesh, found >= 0, true)
            for mesh, found, true in (
                (case.source, there, case.overlap[0]),
                (case.target, back, case.overlap[1]),
            )
        )
    return row


def _iou(mesh: Mesh, found: BoolArray, true: BoolArray) -> float:
    areas = vertex_areas(mesh)
    return float(areas[found & true].sum() / areas[found | true].sum())


def calibration_error(confidence: Any, right: Any) -> float:
    """Mean gap between confidence and share of right maps, over ten classes of confidence."""
    classes = np.minimum((10 * confidence).astype(int), 9)
    gaps = [abs((confidence - right)[classes == i].sum()) for i in range(10)]
    return float(sum(gaps) / len(right))


def line(label: str, rows: list[dict[str, Any]]) -> str:
    """One line of the table."""
    errors = np.array([row["error"] for row in rows])
    confidence = np.array([row["confidence"] for row in rows])
    right, sure = errors < WRONG, confidence > SURE
    overlaps = [row["iou"] for row in rows if "iou" in row]
    mean = f"{errors[right].mean():9.4f}" if right.any() else f"{'-':>9}"
    shares = np.array([row["shares"] for row in rows if "shares" in row]).reshape(-1, 3)
    within = "".join(f"{one:7.1%}" for one in shares.mean(axis=0)) if len(shares) else " " * 21
    return (
        f"{label:24}{len(rows):6}{right.sum():7}{mean}{errors.max():8.3f}{within}"
        f"{np.mean(overlaps) if overlaps else np.nan:7.3f}"
        f"{calibration_error(confidence, right):9.3f}"
        f"{f'{(sure & ~right).sum()} of {sure.sum()}':>13}"
        f"{np.mean([row['cpu'] for row in rows]):8.2f}"
    )


def print_table(rows: list[dict[str, Any]], groups: bool = False) -> None:
    """Print a line for each set, or for each kind of pair in it, and every map that is wrong."""
    print(
        f"{'':24}{'pairs':>6}{'right':>7}{'mean':>9}{'worst':>8}{'<.025':>7}{'<.05':>7}{'<.1':>7}"
        f"{'IoU':>7}{'calibr.':>9}{'wrong > .9':>13}{'CPU s':>8}"
    )

    def label(row: dict[str, Any]) -> str:
        return f"{row['set']} {row['pair'].split()[0]}" if groups else row["set"]

    for name in [*dict.fromkeys(label(row) for row in rows)]:
        print(line(name, [row for row in rows if label(row) == name]))
    print(line("all", rows))
    for row in rows:
        if row["error"] >= WRONG and row["set"] != "different":
            why = row.get("refused") or (
                f"error {row['error']:.3f}{', mirrored' if row['mirrored'] else ''}, "
                f"confidence {row['confidence']:.2f}"
            )
            print(f"wrong: {row['set']} {row['pair']}: {why}")


def read(path: Path) -> list[dict[str, Any]]:
    """Read what a run measured; a line that was cut off is left out."""
    if not path.exists():
        return []
    return [json.loads(one) for one in path.read_text().splitlines() if one.endswith("}")]


def main() -> None:
    """Match what is missing, print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("sets", nargs="+", metavar="SET")
    data = Path(os.environ.get("UNBEND_PUBLIC", "."))
    parser.add_argument("--data", type=Path, metavar="FOLDER", default=data)
    parser.add_argument("--pairs", type=int, help="of each set")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="pairs at a time")
    parser.add_argument("--out", type=Path, metavar="FILE")
    parser.add_argument("--groups", action="store_true", help="a line for each kind of pair")
    given = parser.parse_args()
    if given.sets == ["list"]:
        print("\n".join(SETS))
        return
    if unknown := set(given.sets) - set(SETS):
        parser.error(f"there is no set {unknown.pop()}; the sets are {', '.join(SETS)}")
    rows = read(given.out) if given.out else []
    known = {(row["set"], row["number"], row["seed"]) for row in rows}
    tasks = [
        (_run, name, draw, number, given.seed)
        for name in given.sets
        for number, draw in enumerate(SETS[name](given.data, given.seed, given.pairs))
        if (name, number, given.seed) not in known
    ]

    def keep(row: dict[str, Any]) -> None:
        rows.append(row)
        if given.out:
            with given.out.open("a") as file:
                print(json.dumps(row), file=file)

    run_all(tasks, given.jobs, keep)
    print_table(sorted(rows, key=lambda row: given.sets.index(row["set"])
                       if row["set"] in given.sets else -1), given.groups)  # fmt: skip


def _run(name: str, draw: Draw, number: int, seed: int) -> dict[str, Any]:
    return run(name, draw) | {"number": number, "seed": seed}


if __name__ == "__main__":
    main()
