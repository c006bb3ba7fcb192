"""Match pairs of shapes whose correspondence is known, and print one table of how right it is.

    python benchmarks/match.py SET ... [--data FOLDER] [--pairs N] [--seed S] [--jobs N]
                               [--out FILE] [--groups] [--without NAME ...]
                               [--barycentric | --landmarks | --peer]

SETS are those of benchmarks/match_sets.py, which says where the data comes from; ``--help`` names
them. Everything is at its default, and nothing but compiled code is cached. A set with a list
of pairs is matched whole unless ``--pairs`` draws some. FILE (JSON lines) keeps what was measured:
a run that was interrupted goes on where it stopped, with the same version of unbend. ``--without``
leaves lines of the matcher's plan out. ``--peer`` matches with pyFM (package ``pyfmaps``) instead,
as its documentation shows: wave kernel signatures, a functional map with the orientation term,
ZoomOut.

Errors are geodesic distances on the whole target, in square roots of its area, at source vertices
whose partner is known and was found; those on another component than the partner are left out. A
map is right if their mean is below 0.08; one that is refused is wrong. Means are those of right
maps, then of all that are not refused. ``IoU`` is the intersection over union, by area, of the
vertices that were matched and those that have a partner, on the worse of the two shapes, of right
maps, then of all. ``calibr.`` is how far right maps are from as many as their confidences say, over
ten classes of it (expected calibration error).
``--barycentric`` adds a table of straight distances to the exact places of vertices, which the sets
``poses...`` know: from the vertices and from the points on faces that they are mapped to, and from
the nearest vertices, which is the least error of a map between vertices. ``--landmarks`` matches
wrong pairs again with two true landmarks, the first where ``Match.landmark_hints`` says.
"""

import argparse
import contextlib
import functools
import hashlib
import json
import os
import time
import warnings
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from match_cases import Case, Draw
from match_sets import SETS
from processes import run_all
from scipy.spatial import cKDTree

import unbend
from unbend import Match, Mesh, evaluate, match
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.errors import UnbendError
from unbend.mesh import vertex_areas
from unbend.preparation import surface_of_points
from unbend.spectral import use_cache

Row = dict[str, Any]

WRONG = 0.08  # a map whose mean error is larger has a limb, a side or an end mistaken
SURE = 0.9
N_POINTS = 200  # points of a map that are measured: its mean is known to one or two thousandths


@use_cache(gib=0)
def run(name: str, draw: Draw, how: str = "") -> Row:
    """Match a pair and measure the map; how is "", "barycentric" or "peer"."""
    warnings.simplefilter("ignore")
    case = draw()
    row: Row = {"set": name, "pair": case.name}
    start = time.process_time()
    if how == "peer":
        found = match_with_pyfm(case.source, case.target)
        row |= {"cpu": time.process_time() - start, "confidence": np.nan}
        return row | measure(case, found, np.zeros(case.target.n_vertices, dtype=np.int64))
    try:
        with lines_that_run() as row["lines"]:
            found = match(case.source, case.target, barycentric=how == "barycentric")
    except UnbendError as error:
        cpu = time.process_time() - start
        nothing = {"refused": str(error), "confidence": 0.0, "error": np.inf, "cpu": cpu}
        return row | nothing | _nothing(case)
    row["cpu"] = time.process_time() - start
    row["confidence"] = float(found.confidence)
    row["confidence_bound"] = float(found.confidence_bound)
    row["disorder"] = float(found.disorder)
    row["energies"] = [one.energy for one in found.hypotheses]
    row["differences"] = [one.difference for one in found.hypotheses]
    if how == "barycentric" and case.places is not None:
        row["straight"] = straight_errors(case, found)
    maps = found.source_to_target, found.target_to_source
    row |= measure(case, *maps, found.expected_error)
    if how == "landmarks" and row["error"] >= WRONG:
        pairs = true_landmarks(case, found.landmark_hints)
        led = match(case.source, case.target, landmarks=pairs)
        row["led"] = measure(case, led.source_to_target, led.target_to_source)["error"]
    return row


def true_landmarks(case: Case, hints: tuple[int, ...]) -> IntArray:
    """Two known pairs of vertices: nearest to the first hint, and farthest from that one."""
    left = np.full(case.whole.n_vertices, -1)
    left[case.origin] = np.arange(len(case.origin))
    pairs = np.column_stack([case.rows, left[case.images]])
    pairs = pairs[pairs[:, 1] >= 0]
    places = case.source.vertices[pairs[:, 0]]
    start = case.source.vertices[hints[0]] if hints else places.mean(axis=0)
    away = np.linalg.norm(places - start, axis=1)
    first = int(away.argmin() if hints else away.argmax())
    second = int(np.linalg.norm(places - places[first], axis=1).argmax())
    return pairs[[first, second]]


def match_with_pyfm(source: Mesh, target: Mesh) -> IntArray:
    """Match as pyFM's documentation shows, whose maps go from the second mesh to the first."""
    from pyFM.functional import FunctionalMapping
    from pyFM.mesh import TriMesh

    first, second = (
        TriMesh(one.vertices, one.faces, area_normalize=True, center=True)
        for one in (target, source)
    )
    model = FunctionalMapping(first, second)
    model.preprocess(descr_type="WKS", subsample_step=2)
    model.fit(K=30, w_descr=1e0, w_lap=1e-1, w_dcomm=1e0, w_orient=1e0)
    return np.asarray(model.get_p2p(model.zoomout_refine(nit=16, step=5)))


def measure(case: Case, there: IntArray, back: IntArray, expected: FloatArray | None = None) -> Row:
    """Errors over the true overlap, those expected, and how well the overlap itself was found."""
    known = np.flatnonzero(there[case.rows] >= 0)
    if not len(known):
        return {"error": np.inf} | _nothing(case)
    known = np.random.default_rng(0).permutation(known)[:N_POINTS]
    images = np.where(there >= 0, case.origin[there], -1)
    rows, *truths = (
        one[known] for one in (case.rows, case.images, case.mirrored) if one is not None
    )
    found = evaluate(images, case.whole, rows, *truths)
    # What is known may lie on another component than the one that was matched.
    errors = found.errors("direct")
    finite = np.isfinite(errors)
    errors = errors[finite]
    row: Row = {
        "error": float(errors.mean()),
        "shares": [float((errors <= most).mean()) for most in (0.025, 0.05, 0.1)],
        "mirrored": len(truths) > 1 and bool(found.mean("map-min") < WRONG <= errors.mean()),
    }
    if expected is not None:
        areas = vertex_areas(case.source)
        surface = case.target
        if surface.is_point_cloud:
            surface = surface_of_points(surface).mesh
        unit = np.sqrt(vertex_areas(surface).sum() / vertex_areas(case.whole).sum())
        row["points"] = {
            "error": errors.tolist(),
            "expected": (unit * expected[rows[finite]]).tolist(),
            "area": (areas / areas.sum())[rows[finite]].tolist(),
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


def _nothing(case: Case) -> Row:
    """Measure a map that maps nothing."""
    overlap = {} if case.overlap is None else {"iou": 0.0}
    return {"mirrored": False, "shares": [0.0, 0.0, 0.0]} | overlap


def _iou(mesh: Mesh, found: BoolArray, true: BoolArray) -> float:
    areas = vertex_areas(mesh)
    return float(areas[found & true].sum() / areas[found | true].sum())


def straight_errors(case: Case, found: Match) -> list[float]:
    """Mean straight errors of vertices, of points on faces, and of vertices nearest the truth."""
    assert case.places is not None
    assert found.faces is not None
    assert found.weights is not None
    mesh, known = case.target, found.source_to_target >= 0
    corners = mesh.vertices[mesh.faces[found.faces[known]]]
    places = case.places[known]
    on_faces = np.einsum("ij,ijk->ik", found.weights[known], corners)
    nearest = cKDTree(mesh.vertices).query(places)[1]
    images = mesh.vertices[found.source_to_target[known]], on_faces, mesh.vertices[nearest]
    unit = np.sqrt(vertex_areas(mesh).sum())
    return [float(np.linalg.norm(one - places, axis=1).mean() / unit) for one in images]


def calibration_error(confidence: Any, right: Any) -> float:
    """Mean gap between confidence and share of right maps, over ten classes of confidence."""
    if np.isnan(confidence).any():  # the peer has none
        return np.nan
    classes = np.minimum((10 * confidence).astype(int), 9)
    gaps = [abs((confidence - right)[classes == i].sum()) for i in range(10)]
    return float(sum(gaps) / len(right))


def line(label: str, rows: list[Row]) -> str:
    """One line of the table."""
    errors = np.array([row["error"] for row in rows])
    confidence = np.array([row["confidence"] for row in rows])
    right, sure = errors < WRONG, confidence > SURE
    overlaps = np.array([row.get("iou", np.nan) for row in rows])
    means = [_mean(some) for some in (errors[right], errors, overlaps[right], overlaps)]
    shares = np.array([row["shares"] for row in rows if "shares" in row]).reshape(-1, 3)
    within = "".join(f"{one:7.1%}" for one in shares.mean(axis=0)) if len(shares) else " " * 21
    return (
        f"{label:24}{len(rows):6}{right.sum():7}{means[0]:9.4f}{means[1]:9.4f}"
        f"{np.median(errors):8.4f}{errors.max():8.3f}{within}{means[2]:8.3f}{means[3]:7.3f}"
        f"{confidence.mean():9.3f}{calibration_error(confidence, right):9.3f}"
        f"{f'{(sure & ~right).sum()} of {sure.sum()}':>13}"
        f"{np.mean([row['cpu'] for row in rows]):8.2f}"
    )


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan


def group(row: Row) -> str:
    """Set and kind of a pair: what befell it, or its shapes without their numbers."""
    kind, colon, _ = row["pair"].partition(":")
    return f"{row['set']} {kind if colon else kind.split()[0].rstrip('0123456789')}"


def grouped(rows: list[Row], groups: bool) -> dict[str, list[Row]]:
    """Rows of each set, or of each kind of pair in it."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(group(row) if groups else row["set"], []).append(row)
    return found


def print_table(rows: list[Row], groups: bool = False) -> None:
    """Print a line for each set, or for each kind of pair in it, and every map that is wrong."""
    print(
        f"{'':24}{'pairs':>6}{'right':>7}{'of these':>9}{'of all':>9}{'median':>8}{'worst':>8}"
        f"{'<.025':>7}{'<.05':>7}{'<.1':>7}{'IoU:':>8}{'of all':>7}{'confid.':>9}{'calibr.':>9}"
        f"{'wrong > .9':>13}{'CPU s':>8}"
    )
    for name, some in grouped(rows, groups).items():
        print(line(name, some))
    print(line("all", rows))
    for row in rows:
        if row["error"] >= WRONG and row["set"] != "different":
            why = row.get("refused") or (
                f"error {row['error']:.3f}{', mirrored' if row['mirrored'] else ''}, "
                f"confidence {row['confidence']:.2f}"
                f"{', with landmarks ' + format(row['led'], '.3f') if 'led' in row else ''}"
            )
            print(f"wrong: {row['set']} {row['pair']}: {why}")
    if led := [row["led"] for row in rows if "led" in row]:
        print(f"right with two landmarks: {sum(one < WRONG for one in led)} of {len(led)} of these")
    right = [row for row in rows if "straight" in row and row["error"] < WRONG]
    if right:
        print(f"\n{'straight errors':24}{'right':>6}{'vertices':>10}{'faces':>10}{'nearest':>10}")
        for name, some in grouped(right, groups).items():
            means = np.mean([row["straight"] for row in some], axis=0)
            print(f"{name:24}{len(some):6}" + "".join(f"{one:10.5f}" for one in means))


def read(path: Path) -> list[Row]:
    """Read what a run measured; a line that was cut off is left out."""
    if not path.exists():
        return []
    rows = [json.loads(one) for one in path.read_text().splitlines() if one.endswith("}")]
    keys = ("set", "number", "seed", "changed")  # of versions of unbend, the last one counts
    pairs = [tuple(row.get(key, i) for key in keys) for i, row in enumerate(rows)]
    return list(dict(zip(pairs, rows, strict=True)).values())


def make_parser(description: str | None) -> argparse.ArgumentParser:
    """Make a parser of the options of every script that matches sets."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("sets", nargs="+", metavar="SET", choices=SETS, help=", ".join(SETS))
    data = Path(os.environ.get("UNBEND_PUBLIC", "."))
    parser.add_argument("--data", type=Path, metavar="FOLDER", default=data)
    parser.add_argument("--pairs", type=int, metavar="N", help="of each set")
    parser.add_argument("--seed", type=int, metavar="S", default=0)
    parser.add_argument("--jobs", type=int, metavar="N", default=1, help="pairs at a time")
    return parser


def measured(
    given: argparse.Namespace,
    out: Path | None,
    changed: str = "",
    set_up: Callable[[], object] | None = None,
    how: str = "",
) -> list[Row]:
    """Match what the file lacks, and return the rows of all pairs that are given, in their order.

    ``set_up`` changes the matcher, in every process that matches. Rows keep what was ``changed``,
    and those of a matcher that was changed otherwise don't count.
    """
    tasks = {
        (name, number, given.seed, changed, _matcher()): (
            _run,
            name,
            draw,
            number,
            given.seed,
            changed,
            how,
        )
        for name in given.sets
        for number, draw in enumerate(SETS[name](given.data, given.seed, given.pairs))
    }
    rows = {_key(row): row for row in (read(out) if out else [])}

    def keep(row: Row) -> None:
        row = row | {"matcher": _matcher()}
        rows[_key(row)] = row
        if out:
            with out.open("a") as file:
                print(json.dumps(row), file=file)

    if out and out.exists() and not out.read_text().endswith("\n"):
        with out.open("a") as file:
            print(file=file)  # the next row must not follow one that was cut off
    missing = [task for key, task in tasks.items() if key not in rows]
    run_all(missing, given.jobs, keep, set_up)
    return [rows[key] for key in tasks]


def _key(row: Row) -> tuple[str, int, int, str, str]:
    return row["set"], row["number"], row["seed"], row["changed"], row.get("matcher", "")


@functools.cache
def _matcher() -> str:
    """Digest of the package, so that rows of another matcher don't count."""
    digest = hashlib.blake2b(digest_size=8)
    for path in sorted(Path(unbend.__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _run(name: str, draw: Draw, number: int, seed: int, changed: str, how: str) -> Row:
    return run(name, draw, how) | {"number": number, "seed": seed, "changed": changed}


def lines_of_plan() -> list[str]:
    """Names of the lines of the matcher's plan."""
    from unbend.matching import _plan

    return list(dict.fromkeys(step.stage.__name__ for step in _plan.PLAN))


@contextlib.contextmanager
def lines_that_run() -> Iterator[list[str]]:
    """List the names of the lines of the plan that a match runs."""
    from unbend.matching import _plan

    ran: list[str] = []

    def noted(step: Any) -> Any:
        def stage(*given: Any) -> Any:
            ran.append(step.stage.__name__)
            return step.stage(*given)

        return step._replace(stage=stage)

    before = list(_plan.PLAN)
    _plan.PLAN[:] = map(noted, before)
    try:
        yield ran
    finally:
        _plan.PLAN[:] = before


def leave_out(names: list[str]) -> None:
    """Leave lines of the matcher's plan out, in this process."""
    from unbend.matching import _plan

    _plan.PLAN[:] = [step for step in _plan.PLAN if step.stage.__name__ not in names]


def main() -> None:
    """Match what is missing, print the table."""
    parser = make_parser(__doc__)
    parser.add_argument("--out", type=Path, metavar="FILE")
    parser.add_argument("--groups", action="store_true", help="a line for each kind of pair")
    parser.add_argument("--without", action="append", metavar="NAME", default=[])
    how = parser.add_mutually_exclusive_group()
    for name in ("barycentric", "landmarks", "peer"):
        how.add_argument(f"--{name}", dest="how", action="store_const", const=name, default="")
    given = parser.parse_args()
    if given.how == "peer" and find_spec("pyFM") is None:
        parser.error("--peer needs the extra bench: pip install -e '.[bench]'")
    left_out = sorted(set(given.without))
    if left_out and (unknown := set(left_out).difference(known := lines_of_plan())):
        parser.error(f"the plan has no {unknown.pop()}; its lines are {', '.join(known)}")
    changed = " ".join([given.how, *(f"without {name}" for name in left_out)]).strip()
    set_up = functools.partial(leave_out, left_out) if left_out else None
    print_table(measured(given, given.out, changed, set_up, given.how), given.groups)


if __name__ == "__main__":
    main()
