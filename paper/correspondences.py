"""Correspondences of two shapes by each of the compared methods, and their errors."""

from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np

from paper.collection import Collection, Truth
from paper.forms import Method, form, some_points
from paper.run import Arrays, Run, everywhere, piece
from unbend._arrays import nearest_rows
from unbend._types import FloatArray, IntArray
from unbend.alignment import align, procrustes
from unbend.choices import DistanceKind
from unbend.correspondence import evaluate
from unbend.matching import match

SMDS, PAPERS, EXACT = "S-MDS", "biharmonic, sampled", "biharmonic, exact"
PROGRESSIVE = "progressive"
FORMS: dict[str, tuple[DistanceKind, Method]] = {
    SMDS: ("geodesic", "sampled"),
    PAPERS: ("biharmonic", "sampled"),
    EXACT: ("biharmonic", "exact"),
}
METHODS = (*FORMS, PROGRESSIVE)
# How forms are aligned, besides ICP that may reflect: the figures of Table 1.
ALTERNATIVES = ("ICP, no reflection", "known", "known, no reflection")
N_EIGENPAIRS = 100
ICP_POINTS = 3000

_MAP_MIN = " map-min"


def judge_all(run: Run, pairs: list[tuple[str, str]], n_rows: int) -> list[Arrays]:
    """Errors of every method on every pair: the steps that pairs share come first.

    Parameters
    ----------
    run : Run
    pairs : list of (source, target)
    n_rows : int
        Correspondences of each pair that are judged.

    Returns
    -------
    list of dict
        As :func:`judge` gives them, in the order of the pairs.
    """
    names = dict.fromkeys(name for pair in pairs for name in pair)
    jobs = [(run.shapes, name, *kind, N_EIGENPAIRS) for name in names for kind in FORMS.values()]
    everywhere(run, form, jobs)
    everywhere(run, find_match, [(run.shapes, *pair) for pair in pairs])
    return everywhere(run, judge, [(run.shapes, run.store, *pair, n_rows) for pair in pairs])


def find_match(shapes: Collection, source: str, target: str) -> Arrays:
    """Point map by the progressive matcher, everything at its default, spectra included."""
    start = perf_counter()
    found = match(shapes.mesh(source), shapes.mesh(target))
    return {
        "source_to_target": found.source_to_target.astype(np.int32),
        "confidence": np.array(found.confidence),
        "seconds": np.array(perf_counter() - start),
    }


def judge(shapes: Collection, store: Path, source: str, target: str, n_rows: int) -> Arrays:
    """Geodesic errors of all methods at the same random rows of the ground truth.

    Returns
    -------
    dict of str to ndarray
        ``METHOD`` and ``METHOD, ALTERNATIVE``: (n_rows,) errors against the direct ground truth
        in sqrt(target area), infinite where there is no image. The same with ``map-min`` where a
        mirrored ground truth is known. ``METHOD seconds``, ``confidence``.
    """
    truth = shapes.truth(source, target)
    rows = np.sort(np.random.default_rng(0).permutation(len(truth.source_points))[:n_rows])
    mirrored = truth.mirrored_target_points
    judged = Truth(
        truth.source_points[rows],
        truth.target_points[rows],
        None if mirrored is None else mirrored[rows],
    )
    images: dict[str, IntArray] = {}
    found: Arrays = {}
    for name, kind in FORMS.items():
        made = [piece(store, form, shapes, one, *kind, N_EIGENPAIRS) for one in (source, target)]
        start = perf_counter()
        ours, theirs = (one["points"] for one in made)
        ways = _alignments(ours, theirs, truth)
        for way, move in ways.items():
            images[label_of(name, way)] = _closest(move(ours[judged.source_points]), theirs)
            if not way:
                seconds = perf_counter() - start + made[0]["seconds"] + made[1]["seconds"]
                found[f"{name} seconds"] = np.array(seconds)
    matched = piece(store, find_match, shapes, source, target)
    images[PROGRESSIVE] = matched["source_to_target"][judged.source_points].astype(np.int64)
    found[f"{PROGRESSIVE} seconds"] = matched["seconds"]
    found["confidence"] = matched["confidence"]
    for label, image in images.items():
        found |= _errors(shapes, target, judged, image, label)
    return found


def label_of(method: str, way: str = "", protocol: str = "direct") -> str:
    """Name of a method's errors in what :func:`judge` returns."""
    return (f"{method}, {way}" if way else method) + (_MAP_MIN if protocol == "map-min" else "")


def _alignments(
    left: FloatArray, right: FloatArray, truth: Truth
) -> dict[str, Callable[[FloatArray], FloatArray]]:
    """Rigid motions of a form onto another; the one without a name is that of Table 1."""
    known = left[truth.source_points], right[truth.target_points]
    there = np.isfinite(known[0]).all(axis=1) & np.isfinite(known[1]).all(axis=1)
    # Other vertices of the one than of the other: ICP shall not meet the same points.
    few = some_points(left, ICP_POINTS, 0), some_points(right, ICP_POINTS, 1)
    motions: dict[str, Callable[[FloatArray], FloatArray]] = {}
    for reflect, suffix in ((True, ""), (False, "no reflection")):
        rotation, translation = procrustes(known[0][there], known[1][there], reflect=reflect)
        motions[", ".join(filter(None, ("known", suffix)))] = _motion(rotation, translation)
        motions[f"ICP, {suffix}" if suffix else ""] = align(*few, reflect=reflect).apply
    return motions


def _motion(rotation: FloatArray, translation: FloatArray) -> Callable[[FloatArray], FloatArray]:
    return lambda points: points @ rotation.T + translation


def _closest(points: FloatArray, targets: FloatArray) -> IntArray:
    """Nearest target of each point; -1 for points that are not finite."""
    there = np.flatnonzero(np.isfinite(targets).all(axis=1))
    asked = np.isfinite(points).all(axis=1)
    images = np.full(len(points), -1)
    images[asked] = there[nearest_rows(points[asked], targets[there])]
    return images


def _errors(shapes: Collection, target: str, truth: Truth, images: IntArray, label: str) -> Arrays:
    every = np.arange(len(images))
    found = evaluate(
        images, shapes.mesh(target), every, truth.target_points, truth.mirrored_target_points
    )
    result: Arrays = {}
    for protocol, suffix in (("direct", ""), ("map-min", _MAP_MIN)):
        if protocol == "map-min" and found.map_min is None:
            continue
        result[label + suffix] = np.full(len(images), np.inf)
        result[label + suffix][images >= 0] = found.errors(protocol)
    return result
