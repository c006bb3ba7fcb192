"""Matching benchmark: unbend beside pyFM on a folder of shapes with ground truth.

    python benchmarks/matching.py FOLDER [--out DIR] [--peer] [--one-way] [--jobs N] [--only CLASS]

FOLDER holds NAME.off shapes, ``pairs.txt`` with two names a line, and ``corres/NAME.vts`` (and
``NAME.sym.vts``): lists of 1-based vertices, row i being the same point on every shape of a class
(the layout of the remeshed TOSCA of Ren et al. 2018). Every pair is matched in both directions,
spectra included: nothing but compiled code is cached. Maps and seconds are kept in DIR:
a run that was interrupted goes on where it stopped, and a second run only prints the table.

The peer is pyFM (package ``pyfmaps``) as its documentation shows: wave kernel signatures, a
functional map with the orientation term, ZoomOut.
"""

from __future__ import annotations

import argparse
import json
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from processes import run_all

WRONG = 0.08  # a map whose mean error is larger has a limb, a side or an end mistaken
SHARES = (0.025, 0.05, 0.1)


def match_with_unbend(source: Path, target: Path) -> tuple[Any, dict[str, float]]:
    """Match two files with everything at its default and nothing cached."""
    from unbend import match, read_mesh

    found = match(read_mesh(source), read_mesh(target), cache=False)
    return found.source_to_target, {"confidence": found.confidence}


def match_with_pyfm(source: Path, target: Path) -> tuple[Any, dict[str, float]]:
    """Match two files as pyFM's documentation shows, whose maps go from the second mesh."""
    from pyFM.functional import FunctionalMapping
    from pyFM.mesh import TriMesh

    first = TriMesh.load(str(target), area_normalize=True, center=True)
    second = TriMesh.load(str(source), area_normalize=True, center=True)
    model = FunctionalMapping(first, second)
    model.preprocess(descr_type="WKS", subsample_step=2)
    model.fit(K=30, w_descr=1e0, w_lap=1e-1, w_dcomm=1e0, w_orient=1e0)
    refined = model.zoomout_refine(nit=16, step=5)
    return model.get_p2p(refined), {}


METHODS: dict[str, Callable[[Path, Path], tuple[Any, dict[str, float]]]] = {
    "unbend": match_with_unbend,
    "pyFM": match_with_pyfm,
}


def run_one(method: str, folder: Path, source: str, target: str, out: Path) -> None:
    """Match one pair by one method, unless its map is there already."""
    path = out / method / f"{source}-{target}.npy"
    if path.with_suffix(".json").exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    point_map, facts = METHODS[method](folder / f"{source}.off", folder / f"{target}.off")
    facts["seconds"] = time.perf_counter() - start
    np.save(path, point_map)
    path.with_suffix(".json").write_text(json.dumps(facts))


def judge(method: str, folder: Path, target: str, sources: list[str], out: Path) -> list[Any]:
    """Errors of all maps onto one target by the direct ground truth, in sqrt(area)."""
    from unbend import evaluate, read_mesh

    def truth(name: str) -> Any:
        return np.loadtxt(folder / "corres" / f"{name}.vts", dtype=np.int64) - 1

    shape = read_mesh(folder / f"{target}.off")
    rows = []
    for source in sources:
        path = out / method / f"{source}-{target}.npy"
        judged = path.with_suffix(".errors.npy")
        if not judged.exists():
            found = evaluate(np.load(path), shape, truth(source), truth(target))
            np.save(judged, found.errors("direct"))
        facts = json.loads(path.with_suffix(".json").read_text())
        rows.append((source, target, np.load(judged), facts))
    return rows


def class_of(name: str) -> str:
    """Name without its number."""
    return re.sub(r"\d+$", "", name)


def print_table(method: str, rows: list[Any]) -> None:
    """Print accuracy and time per class and in all, and every map that went wrong."""
    print(f"\n{method}: errors by the direct ground truth, in sqrt(target area)\n")
    head = "class          maps   right     mean   median    worst"
    print(head + "".join(f"{f'<= {share}':>10}" for share in SHARES) + "   s/map")
    for name in [*sorted({class_of(row[0]) for row in rows}), "all"]:
        chosen = [row for row in rows if name in ("all", class_of(row[0]))]
        errors = np.concatenate([row[2] for row in chosen])
        means = np.array([row[2].mean() for row in chosen])
        seconds = np.mean([row[3]["seconds"] for row in chosen])
        shares = "".join(f"{np.mean(errors <= share):10.1%}" for share in SHARES)
        print(
            f"{name:12}{len(chosen):7}{np.mean(means < WRONG):8.1%}{means.mean():9.4f}"
            f"{np.median(errors):9.4f}{means.max():9.4f}{shares}{seconds:8.1f}"
        )
    for source, target, errors, _ in rows:
        if errors.mean() >= WRONG:
            print(f"wrong: {source} to {target}, mean {errors.mean():.3f}")


def main() -> None:
    """Match what is missing, judge it, print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=Path("matching-results"))
    parser.add_argument("--peer", action="store_true", help="run pyFM too")
    parser.add_argument("--one-way", action="store_true", help="only as pairs.txt has them")
    parser.add_argument("--jobs", type=int, default=1, help="maps at a time")
    parser.add_argument("--only", metavar="CLASS", help="only this class")
    options = parser.parse_args()

    lines = (options.folder / "pairs.txt").read_text().split("\n")
    pairs = [tuple(line.split()) for line in lines if line.strip()]
    pairs = [pair for pair in pairs if options.only in (None, class_of(pair[0]))]
    if not options.one_way:
        pairs += [(target, source) for source, target in pairs]
    methods = ["unbend", "pyFM"] if options.peer else ["unbend"]

    tasks = [
        (run_one, method, options.folder, source, target, options.out)
        for source, target in pairs
        for method in methods  # alternating, so that both meet the same machine
    ]
    run_all(tasks, options.jobs)
    onto = {target: [a for a, b in pairs if b == target] for _, target in pairs}
    for method in methods:
        tasks = [
            (judge, method, options.folder, target, sources, options.out)
            for target, sources in onto.items()
        ]
        judged = run_all(tasks, options.jobs)
        print_table(method, [row for rows in judged for row in rows])


if __name__ == "__main__":
    main()
