"""What each constant of the matcher does: maps when it is halved, and doubled.

    python benchmarks/constants.py [NAME ...] [--pairs N] [--vertices N] [--seed S] [--jobs N]
                                   [--parts]

Matches the same pairs of our own bodies with every constant as it is and, one at a time, halved and
doubled: two poses of one body, two bodies of random proportions, and a body of which a tenth was
cut off. With --parts these are half bodies, views of a camera and parts that overlap in half, and
the constants are those that matter to parts alone. Prints how many maps are right (mean error below
0.08 of the square root of the area), the mean error of those, and the processor time over that with
all constants as they are.
"""

from __future__ import annotations

import argparse
import importlib
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
from hard import WRONG, measure
from hard_sets import Case, Options, draw

from unbend import match

CASES = (
    ("welds", "own", ""),
    ("proportions", "biped", ""),
    ("cuts", "own", "10%"),
    ("proportions", "quadruped", ""),
)
PARTS = (("cuts", "own", "half"), ("scans", "own", "clean"), ("cuts", "own", "overlap 50%"))
# Where each constant is; all modules that hold it are changed.
CONSTANTS = {
    "_SIGNED": ("_search",),
    "_LAST": ("_search",),
    "_SAMPLES": ("_search",),
    "_BEAM": ("_search",),
    "_DESCRIPTOR_WEIGHT": ("_search",),
    "_SAME": ("_search",),
    "_APART": ("_tips",),
    "_MOST_TIPS": ("_tips",),
    "_LEFT_OUT": ("_tips",),
    "_ENOUGH": ("_tips",),
    "_WIDTH": ("_tips",),
    "_SHORTEST": ("_tips",),
    "_TRUNK": ("_tips",),
    "_LEAVING_OUT": ("_tips",),
    "_ANY_LENGTH": ("_tips",),
    "_LONGER": ("_tips",),
    "_ROUGH_VERTICES": ("_solve",),
    "_PROXY_VERTICES": ("_solve",),
    "STEPS": ("_polish", "_solve"),
    "_MANY": ("_solve",),
    "_FEW": ("_solve",),
    "_TIGHTENED": ("_solve",),
    "_FOLLOWED": ("_solve",),
    "_SPECTRAL": ("_solve",),
    "_CLEAR": ("_solve",),
    "_AHEAD": ("_solve",),
    "_CLEARLY_FOLLOWED": ("_solve",),
    "_RELOCATED": ("_solve",),
    "_BESIDE": ("_relocation",),
    "TRUNK": ("_relocation", "_solve"),
    "_TIMES": ("_relocation",),
    "_REGROWN": ("_solve",),
    "_SMOOTH": ("_solve",),
    "_GROWN_FROM": ("_polish",),
    "_GROWTH": ("_polish",),
    "_GROWN_OVER": ("_polish",),
    "LOOSE": ("_registration", "_solve"),
    "PULLS": ("_polish", "_registration", "_solve"),
    "_MOMENTUM": ("_registration",),
    "NORMAL_WEIGHT": ("_continuation", "_registration"),
    "_SLACK": ("_registration",),
    "_WAY_BACK": ("_partners",),
    "_TURNING": ("_shape",),
    "_PATCH": ("_shape",),
    "_DETAIL": ("_shape",),
    "_DETAIL_EDGES": ("_shape",),
    "_SHARE": ("_judge",),
    "_WITHOUT": ("_judge",),
}
OF_PARTS = {
    "_POINTS": ("_solve",),
    "_GUESSED": ("_solve",),
    "_POINTED": ("_solve",),
    "_CONTINUED": ("_solve",),
    "_AGAIN": ("_solve",),
    "_HELD": ("_continuation",),
    "_PIECES": ("_continuation",),
    "_LEAST_PIECE": ("_continuation",),
    "_HOLD": ("_continuation",),
    "_CARRYING": ("_continuation",),
    "_SETTLED": ("_polish",),
    "_NEARLY": ("_polish",),
    "_SMOOTHED": ("_polish",),
    "_OUTLINE": ("_partners",),
    "_NEAR": ("_registration",),
    "_SHORTEST_RIM": ("_shape",),
    "_FAR": ("_points",),
    "_POLISHED_OVER": ("_polish",),
    "LOOSEST": ("_registration", "_solve"),
    "_RADIUS": ("_points",),
    "_FACTOR": ("_points",),
    "_N_RADII": ("_points",),
    "_SIZES": ("_points",),
    "_FACING": ("_points",),
    "_PARTNERS": ("_points",),
    "_DEVIATION": ("_points",),
    "_DECAY": ("_points",),
    "_ROUNDS": ("_points",),
    "_GATHERED": ("_points",),
    "_SHARED": ("_points",),
}


def scaled(value: Any, factor: float) -> Any:
    """Scale a number, or each of several; whole numbers stay whole."""
    if isinstance(value, tuple):
        return tuple(scaled(one, factor) for one in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def set_constant(name: str, factor: float) -> None:
    """Change a constant in this process, from here on."""
    for place in (CONSTANTS | OF_PARTS)[name]:
        module: Any = importlib.import_module(f"unbend.matching.{place}")
        if name in ("_GROWTH", "_FACTOR", "_NEARLY"):  # what counts is how far it is from 1
            setattr(module, name, 1 + factor * (getattr(module, name) - 1))
        else:
            setattr(module, name, scaled(getattr(module, name), factor))
        if name == "_BEAM":
            module.search.__kwdefaults__["beam"] = module._BEAM


def run(name: str | None, factor: float, cases: list[Case]) -> tuple[int, float, float]:
    """Right maps, their mean error, and seconds of processor time."""
    warnings.simplefilter("ignore")
    match(cases[0].source.mesh, cases[0].target.mesh, cache=False)  # compiles
    if name is not None:
        set_constant(name, factor)
    errors, start = [], time.process_time()
    for case in cases:
        errors.append(_error(case))
    seconds = time.process_time() - start
    right = [error for error in errors if error < WRONG]
    return len(right), float(np.mean(right)) if right else float("nan"), seconds


def _error(case: Case) -> float:
    found = match(case.source.mesh, case.target.mesh, cache=False)
    return measure(case, found.source_to_target, found.target_to_source)["error"]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--parts", action="store_true")
    parser.add_argument("--pairs", type=int, default=12)
    parser.add_argument("--vertices", type=int, default=800)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    options = Options(given.seed, given.vertices, None, None)
    kinds, constants = (PARTS, OF_PARTS) if given.parts else (CASES, CONSTANTS)
    names = given.names or list(constants)
    cases = [draw(*kinds[i % len(kinds)], i, options) for i in range(given.pairs)]
    tasks: list[tuple[str | None, float]] = [(None, 1.0)]
    tasks += [(name, factor) for name in names for factor in (0.5, 2.0)]
    # A process for each: constants that were changed do not stay.
    with ProcessPoolExecutor(
        given.jobs, mp_context=get_context("spawn"), max_tasks_per_child=1
    ) as pool:
        running = [pool.submit(run, *task, cases) for task in tasks]
        right, error, seconds = running[0].result()
        print(f"| all as they are | | {right} of {given.pairs}, {error:.4f} | | |", flush=True)
        print("| constant | value | halved | doubled | time |\n|---|---|---|---|---|", flush=True)
        for i, name in enumerate(names):
            half, double = (running[1 + 2 * i + k].result() for k in range(2))
            module = importlib.import_module(f"unbend.matching.{(CONSTANTS | OF_PARTS)[name][0]}")
            print(
                f"| `{name}` | {getattr(module, name)} | {half[0]}, {half[1]:.4f} "
                f"| {double[0]}, {double[1]:.4f} | {half[2] / seconds:.2f}, "
                f"{double[2] / seconds:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
