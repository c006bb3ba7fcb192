"""Figure 1: shapes in several poses, and their canonical forms by both distances."""

from pathlib import Path

import numpy as np

from paper.collection import Collection
from paper.correspondences import EXACT, FORMS, N_EIGENPAIRS, SMDS
from paper.drawing import colors_of, upright
from paper.forms import N_SAMPLES, Method, difference, form
from paper.result import Figure, Result
from paper.run import Arrays, Run, everywhere, piece
from unbend._types import FloatArray
from unbend.alignment import procrustes
from unbend.choices import DistanceKind
from unbend.errors import InputError
from unbend.mesh import Mesh
from unbend.report import draw_mesh, new_figure, same_scale
from unbend.report.raster import view_rotation

# The classes that the paper shows come first.
_PAPERS = ("wolf", "gorilla")
_QUICK_CLASSES = 2
_MOST_DRAWN = {True: 3, False: 5}  # quick, full
_VIEW = (50.0, 12.0)
_COLUMN, _MARGIN = 2.3, 0.35  # inches
KINDS: dict[str, tuple[DistanceKind, Method]] = {name: FORMS[name] for name in (SMDS, EXACT)}
_ROWS = ("shapes", SMDS, "biharmonic")


def figure1(run: Run) -> Result:
    """Draw every class in several poses above its forms, and measure how far these differ.

    Parameters
    ----------
    run : Run

    Returns
    -------
    Result

    Raises
    ------
    InputError
        If no class has two poses.
    """
    classes = some_classes(run)
    if run.quick:
        classes = {kind: names[: _MOST_DRAWN[True]] for kind, names in classes.items()}
    every = [name for names in classes.values() for name in names]
    everywhere(
        run,
        form,
        [(run.shapes, name, *kind, N_EIGENPAIRS) for name in every for kind in KINDS.values()],
    )
    pairs = [(names[0], name) for names in classes.values() for name in names[1:]]
    found = everywhere(run, compare, [(run.shapes, run.store, *pair) for pair in pairs])
    rows: list[dict[str, object]] = [
        {"class": run.shapes.class_of[pair[0]], "first": pair[0], "second": pair[1]}
        | {name: float(value) for name, value in one.items()}
        for pair, one in zip(pairs, found, strict=True)
    ]
    summary = [_summary(kind, rows) for kind in classes]
    return Result(
        title="Figure 1: shapes in several poses and their canonical forms",
        tables={"differences": summary, "all_pairs": rows},
        figures={kind: draw(run, names) for kind, names in classes.items()},
        text=_text(summary),
    )


def some_classes(run: Run) -> dict[str, tuple[str, ...]]:
    """Classes of two poses and more, the paper's first; in a quick run only two of them.

    Raises
    ------
    InputError
        If there is none.
    """
    several = {kind: names for kind, names in run.shapes.classes.items() if len(names) > 1}
    if not several:
        raise InputError("this experiment needs two poses of a class or more")
    order = sorted(several, key=lambda kind: _PAPERS.index(kind) if kind in _PAPERS else 9)
    return {kind: several[kind] for kind in order[: _QUICK_CLASSES if run.quick else None]}


def compare(shapes: Collection, store: Path, first: str, second: str) -> Arrays:
    """How far two poses are apart: in space, and their forms by either distance."""
    truth = shapes.truth(first, second)
    result: Arrays = {}
    pair = [shapes.mesh(name).vertices for name in (first, second)]
    result["in space"] = np.array(
        difference(pair[1][truth.target_points], pair[0][truth.source_points])[0]
    )
    for label, kind in KINDS.items():
        pair = [_points(shapes, store, name, kind) for name in (first, second)]
        result[label] = np.array(
            difference(pair[1][truth.target_points], pair[0][truth.source_points])[0]
        )
    return result


def draw(run: Run, names: tuple[str, ...]) -> Figure:
    """Poses of a class above their forms, all forms turned to stand as the first pose does."""
    names = names[: _MOST_DRAWN[run.quick]]
    first = upright(run.shapes, names[0])
    columns = []
    for name in names:
        mesh = upright(run.shapes, name)
        forms = [turned(run, first.vertices, (names[0], name), kind) for kind in KINDS.values()]
        columns.append((mesh, [mesh.vertices, *forms]))
    # A row is as high as its highest picture, all pictures being as wide as the widest.
    turn = view_rotation(_VIEW)
    spans = np.array([[np.nanmax(p @ turn.T, 0) - np.nanmin(p @ turn.T, 0) for p in row]
                      for _, row in columns]).max(axis=0)  # fmt: skip
    heights = _COLUMN * np.clip(spans[:, 1] / spans[:, 0], 0.3, 1.4) + 0.1
    figure = new_figure(_MARGIN + _COLUMN * len(names), heights.sum() + 0.3)
    wide, high = figure.get_size_inches()
    bottoms = heights.sum() + 0.3 - np.cumsum(heights)
    rows: list[list[object]] = [[] for _ in _ROWS]
    for i, (name, (mesh, seen)) in enumerate(zip(names, columns, strict=True)):
        colors = colors_of(run.shapes, names[0], name)
        left = _MARGIN + _COLUMN * i
        for row, points in enumerate(seen):
            box = (left + 0.05, bottoms[row] + 0.05, _COLUMN - 0.1, heights[row] - 0.1)
            ax = figure.add_axes(tuple(np.array(box) / (wide, high, wide, high)))
            draw_mesh(ax, Mesh(points, mesh.faces), colors=colors, view=_VIEW)
            rows[row].append(ax)
        figure.text((left + _COLUMN / 2) / wide, 0.1 / high, name, ha="center", fontsize=9)
    for row, label in enumerate(_ROWS):
        same_scale(rows[row])
        middle = bottoms[row] + heights[row] / 2
        figure.text(
            _MARGIN / 2 / wide, middle / high, label,
            rotation=90, ha="center", va="center", fontsize=9,
        )  # fmt: skip
    return figure


def turned(
    run: Run, standing: FloatArray, names: tuple[str, str], kind: tuple[DistanceKind, Method]
) -> FloatArray:
    """Form of the second shape fitted to that of the first, which is fitted to how this stands."""
    first = _points(run.shapes, run.store, names[0], kind)
    reference = _fitted(first, standing, first)
    if names[1] == names[0]:
        return reference
    points = _points(run.shapes, run.store, names[1], kind)
    truth = run.shapes.truth(*names)
    return _fitted(points[truth.target_points], reference[truth.source_points], points)


def _fitted(left: FloatArray, right: FloatArray, points: FloatArray) -> FloatArray:
    there = np.isfinite(left).all(axis=1) & np.isfinite(right).all(axis=1)
    rotation, translation = procrustes(left[there], right[there])
    return np.asarray(points @ rotation.T + translation)


def _points(
    shapes: Collection, store: Path, name: str, kind: tuple[DistanceKind, Method]
) -> FloatArray:
    return np.asarray(piece(store, form, shapes, name, *kind, N_EIGENPAIRS)["points"])


def _summary(kind: str, rows: list[dict[str, object]]) -> dict[str, object]:
    mine = [row for row in rows if row["class"] == kind]
    result: dict[str, object] = {"class": kind, "pairs": len(mine)}
    for label in ("in space", *KINDS):
        values = [float(str(row[label])) for row in mine]
        result[f"{label}, mean"] = float(np.mean(values))
        result[f"{label}, most"] = float(np.max(values))
    return result


def _text(summary: list[dict[str, object]]) -> str:
    lower = [
        str(row["class"])
        for row in summary
        if float(str(row[f"{EXACT}, mean"])) < float(str(row[f"{SMDS}, mean"]))
    ]
    higher = [str(row["class"]) for row in summary if row["class"] not in lower]
    means = {
        label: float(np.mean([float(str(row[f"{label}, mean"])) for row in summary]))
        for label in ("in space", *KINDS)
    }
    which = f"lower for {', '.join(lower)}" if lower else "lower for no class"
    return f"""
The paper's Figure 1 shows shapes in several poses, the S-MDS forms of geodesic distances, and the
forms of the biharmonic distance: to the eye, forms of one class look alike.

Ours: above, the shapes; in the middle, S-MDS forms (geodesics by the heat method, {N_SAMPLES}
samples, {N_EIGENPAIRS} eigenpairs); below, exact biharmonic forms. The same point has the same
colour throughout, a row has one scale, and forms are turned, by the
known correspondence, to fit that of the first pose, and that to fit the shape itself. Where the
two sides of a body fall together in three dimensions, which colour is in front is chance.

How far they differ is in the table: the root mean square distance of the same points on two poses
after the best rotation or reflection, as a share of the form's own size (root mean square from
its centre); the first pose of a class with each other one. Mean over the classes: the shapes in
space {means["in space"]:.3f}, S-MDS forms {means[SMDS]:.3f}, biharmonic forms {means[EXACT]:.3f}.
Biharmonic forms differ {"less" if means[EXACT] < means[SMDS] else "more"} between poses than S-MDS
forms in the mean; they are {which}{f", higher for {', '.join(higher)}" if higher else ""}.
Nearer forms are not yet better correspondences: see Table 1.
"""
