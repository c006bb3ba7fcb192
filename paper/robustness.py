"""The claim "insensitive to noise and topology": how far forms and maps move."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np

from paper.collection import Collection
from paper.correspondences import EXACT, FORMS, N_EIGENPAIRS, SMDS
from paper.forms import Method, difference, form, make_form
from paper.perturbations import perturb
from paper.result import Result
from paper.robustness_page import draw, text
from paper.run import Arrays, Run, everywhere, piece
from testshapes.damage import Damaged
from unbend.choices import DistanceKind
from unbend.correspondence import evaluate
from unbend.datasets import make_biped, make_octopus, make_quadruped, rest_map
from unbend.errors import InputError, MeshError
from unbend.matching import match
from unbend.mesh import Mesh

KINDS: dict[str, tuple[DistanceKind, Method]] = {"biharmonic": FORMS[EXACT], "S-MDS": FORMS[SMDS]}
RIGHT = 0.08  # a map with a smaller mean error is right as a whole
STRENGTHS: dict[str, tuple[float, ...]] = {
    "noise": (0.1, 0.25, 0.5, 1.0),
    "decimation": (0.5, 0.25, 0.1),
    "remeshing": (1.0, 0.5, 0.25),
    "holes": (0.02, 0.05, 0.1),
    "part missing": (0.05, 0.1, 0.2),
    "shortcut": (1, 4, 16),
}
_BODIES = {
    "dog": lambda **options: make_quadruped("walking", **options),
    "human": lambda **options: make_biped("running", **options),
    "octopus": lambda **options: make_octopus("crawling", **options),
}
_N_VERTICES = {True: 2000, False: 8000}  # quick, full
_N_ROWS = 500


def robustness(run: Run) -> Result:
    """Perturb the first pose of each class in every way, and measure what moves.

    Parameters
    ----------
    run : Run

    Returns
    -------
    Result

    Raises
    ------
    InputError
        If there are no shapes.
    """
    names = [names[0] for names in run.shapes.classes.values()]
    if not names:
        raise InputError("robustness needs the shapes of TOSCA, or --data synthetic")
    names = names[: 1 if run.quick else None]
    can_decimate = find_spec("fast_simplification") is not None
    strengths = {
        kind: several for kind, several in STRENGTHS.items() if can_decimate or kind != "decimation"
    }
    everywhere(
        run, form, [(run.shapes, n, *kind, N_EIGENPAIRS) for n in names for kind in KINDS.values()]
    )
    jobs = [
        (run.shapes, run.store, name, kind, strength)
        for kind, several in strengths.items()
        for strength in several
        for name in names
        if kind != "remeshing"
    ]
    bodies = list(_BODIES)[: 1 if run.quick else None]
    meshed = [
        (body, _N_VERTICES[run.quick], share) for share in strengths["remeshing"] for body in bodies
    ]
    found = everywhere(run, disturb, jobs) + everywhere(run, remesh, meshed)
    labels = [(name, kind, strength) for _, _, name, kind, strength in jobs]
    labels += [(body, "remeshing", share) for body, _, share in meshed]
    every: list[dict[str, object]] = [
        {"perturbation": kind, "strength": strength, "shape": name}
        | {label: value.item() for label, value in one.items()}
        for (name, kind, strength), one in zip(labels, found, strict=True)
    ]
    summary = [
        _summary(kind, strength, every)
        for kind, several in strengths.items()
        for strength in several
    ]
    poses = _between_poses(run, names)
    return Result(
        title="Insensitive to noise and topology? How far forms and maps move",
        tables={"summary": summary, "poses": [dict(poses)], "all_shapes": every},
        figures={"robustness": draw(every, summary, poses)},
        text=text(summary, poses, names, bodies, decimated="decimation" in strengths),
    )


def disturb(shapes: Collection, store: Path, name: str, kind: str, strength: float) -> Arrays:
    """Perturb a shape and compare it with itself; see :func:`compare`."""
    clean = shapes.mesh(name)
    forms = {
        label: piece(store, form, shapes, name, *method, N_EIGENPAIRS)["points"]
        for label, method in KINDS.items()
    }
    return compare(clean, forms, perturb(clean, kind, strength))


def remesh(body: str, n_vertices: int, share: float) -> Arrays:
    """Mesh a body of our own anew, with this share of the vertices; see :func:`compare`."""
    clean = _BODIES[body](n_vertices=n_vertices)
    other = _BODIES[body](n_vertices=round(share * n_vertices), meshing=1)
    forms = {label: _form(clean.mesh, *method) for label, method in KINDS.items()}
    return compare(
        clean.mesh, forms, Damaged(other.mesh, rest_map(other, clean), rest_map(clean, other))
    )


def compare(clean: Mesh, forms: Arrays, perturbed: Damaged) -> Arrays:
    """Measure how far the forms of a perturbed shape are from the clean one's, and a map's error.

    Returns
    -------
    dict of str to ndarray
        ``vertices``; by each distance ``DISTANCE``, the root mean square distance of the same
        points over the form's size, and ``DISTANCE, but for scale``; ``map error``, mean, of the
        progressive map from the perturbed shape to the clean one, NaN where the matcher refuses
        the perturbed mesh; ``confidence``.
    """
    result: Arrays = {"vertices": np.array(perturbed.mesh.n_vertices)}
    for label, method in KINDS.items():
        moved = difference(_form(perturbed.mesh, *method), forms[label][perturbed.origin])
        result[label], result[f"{label}, but for scale"] = np.array(moved)
    # On the clean shape distances are the same for all perturbations.
    try:
        found = match(perturbed.mesh, clean)
    except MeshError:  # decimation may leave a surface with only one side
        return result | {"map error": np.array(np.nan), "confidence": np.array(0.0)}
    rows = np.random.default_rng(0).permutation(perturbed.mesh.n_vertices)[:_N_ROWS]
    judged = evaluate(found.source_to_target, clean, rows, perturbed.origin[rows])
    result["map error"] = np.array(judged.mean())
    result["confidence"] = np.array(found.confidence)
    return result


def _form(mesh: Mesh, distance: DistanceKind, method: Method) -> np.ndarray:
    return make_form(mesh, distance, method, N_EIGENPAIRS).points


def _between_poses(run: Run, names: list[str]) -> dict[str, float]:
    """How far the forms of two poses are apart, but for scale: the mean over the classes."""
    pairs = [
        run.shapes.classes[run.shapes.class_of[name]][:2]
        for name in names
        if len(run.shapes.classes[run.shapes.class_of[name]]) > 1
    ]
    found = everywhere(run, poses_apart, [(run.shapes, run.store, *pair) for pair in pairs])
    return {
        label: float(np.mean([one[label] for one in found])) if found else float("nan")
        for label in KINDS
    }


def poses_apart(shapes: Collection, store: Path, first: str, second: str) -> Arrays:
    """How far the forms of two poses are apart, but for scale."""
    truth = shapes.truth(first, second)
    result = {}
    for label, method in KINDS.items():
        one, other = (
            piece(store, form, shapes, name, *method, N_EIGENPAIRS)["points"]
            for name in (first, second)
        )
        apart = difference(other[truth.target_points], one[truth.source_points])
        result[label] = np.array(apart[1])
    return result


def _summary(kind: str, strength: float, every: list[dict[str, object]]) -> dict[str, object]:
    mine = [row for row in every if (row["perturbation"], row["strength"]) == (kind, strength)]
    row: dict[str, object] = {"perturbation": kind, "strength": strength}
    for label in KINDS:
        for column in (label, f"{label}, but for scale"):
            row[column] = float(np.mean([float(str(one[column])) for one in mine]))
    less = sum(
        float(str(one["biharmonic, but for scale"])) < float(str(one["S-MDS, but for scale"]))
        for one in mine
    )
    row["biharmonic moves less"] = f"{less} of {len(mine)}"
    errors = [float(str(one["map error"])) for one in mine]
    made = [error for error in errors if error == error]
    row["map error"] = float(np.mean(made)) if made else float("nan")
    row["right maps"] = f"{sum(error < RIGHT for error in errors)} of {len(errors)}"
    return row
