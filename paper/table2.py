"""Table 2: how alike the canonical forms of one person in many poses are."""

import itertools
from pathlib import Path

import numpy as np

from paper.collection import Collection
from paper.forms import form, some_points
from paper.result import Figure, Result
from paper.run import Arrays, Run, everywhere, piece
from paper.table2_text import (
    CLOSEST,
    DISTANCES,
    KNOWN,
    N_EIGENPAIRS,
    N_POINTS,
    PAPER,
    TURNED,
    WAYS,
    Compared,
    table2_text,
)
from unbend._types import FloatArray
from unbend.alignment import align
from unbend.choices import DistanceKind
from unbend.correspondence import aligned_cosine
from unbend.errors import InputError
from unbend.report import new_figure

N_PROBES = 10


def table2(run: Run) -> Result:
    """Compare the forms of all pairs of poses by cosine, for both distances.

    Parameters
    ----------
    run : Run
        Its `scape` is used.

    Returns
    -------
    Result

    Raises
    ------
    InputError
        If there are too few shapes to compare.
    """
    scape = run.scape
    names = scape.names if scape is not None else ()
    if scape is None or len(names) < 3:
        raise InputError("table2 needs one person in three poses or more, numbered alike")
    if run.quick:
        names = names[: N_PROBES + 1]
    everywhere(
        run,
        form,
        [(scape, name, kind, "sampled", N_EIGENPAIRS) for name in names for kind in DISTANCES],
    )
    rows = everywhere(
        run,
        compare,
        [
            (scape, run.store, names[i], tuple(names[i + 1 :]), kind)
            for kind in DISTANCES
            for i in range(len(names) - 1)
        ],
    )
    found: dict[tuple[str, str], FloatArray] = {}
    for way in WAYS:
        for kind, part in zip(
            DISTANCES, (rows[: len(names) - 1], rows[len(names) - 1 :]), strict=True
        ):
            found[way, kind] = np.concatenate([row[way] for row in part])
    pairs = list(itertools.combinations(names, 2))
    n_probes = min(N_PROBES, len(names) - 1)
    compared = _compared(found, n_probes)
    return Result(
        title="Table 2: cosine similarity of one person's canonical forms",
        tables={
            "summary": [one.row() for one in compared],
            "probes": _pair_rows(found, pairs[:n_probes]),
            "all_pairs": _pair_rows(found, pairs),
        },
        figures={
            "probes": _draw_probes(found, names[1 : n_probes + 1]),
            "similarities": _draw_all(found, names),
        },
        text=table2_text(compared, names, n_probes),
    )


def compare(
    shapes: Collection, store: Path, model: str, probes: tuple[str, ...], kind: DistanceKind
) -> Arrays:
    """Cosines of a model with probes: by known correspondence, and after ICP."""
    ours = piece(store, form, shapes, model, kind, "sampled", N_EIGENPAIRS)["points"]
    found: dict[str, list[float]] = {way: [] for way in WAYS}
    for probe in probes:
        theirs = piece(store, form, shapes, probe, kind, "sampled", N_EIGENPAIRS)["points"]
        there = np.isfinite(ours).all(axis=1) & np.isfinite(theirs).all(axis=1)
        left, right = ours[there], theirs[there]
        found[KNOWN].append(aligned_cosine(left, right, np.ones(len(left))))
        # Other vertices of the one than of the other: ICP shall not meet the same points.
        few = some_points(left, N_POINTS, 0), some_points(right, N_POINTS, 1)
        found_by_icp = align(*few)
        turned = found_by_icp.apply(left)
        found[TURNED].append(cosine(turned, right))
        moved = found_by_icp.apply(few[0])
        found[CLOSEST].append(
            cosine(
                np.concatenate([moved, moved[found_by_icp.target_to_source]]),
                np.concatenate([few[1][found_by_icp.source_to_target], few[1]]),
            )
        )
    return {way: np.array(values) for way, values in found.items()}


def cosine(left: FloatArray, right: FloatArray) -> float:
    """Cosine of two sets of corresponding points, each about its centre, as they stand."""
    left, right = left - left.mean(axis=0), right - right.mean(axis=0)
    return float((left * right).sum() / (np.linalg.norm(left) * np.linalg.norm(right)))


def _compared(found: dict[tuple[str, str], FloatArray], n_probes: int) -> list[Compared]:
    return [
        Compared(way, over, *(found[way, kind][rows] for kind in DISTANCES))
        for way in WAYS
        for over, rows in (("probes", slice(n_probes)), ("all pairs", slice(None)))
    ]


def _pair_rows(
    found: dict[tuple[str, str], FloatArray], pairs: list[tuple[str, str]]
) -> list[dict[str, object]]:
    return [
        {"model": model, "probe": probe}
        | {f"{kind}, {way}": float(found[way, kind][i]) for way in WAYS for kind in DISTANCES}
        for i, (model, probe) in enumerate(pairs)
    ]


def _draw_probes(found: dict[tuple[str, str], FloatArray], probes: tuple[str, ...]) -> Figure:
    figure = new_figure(7.2, 3.6)
    figure.set_layout_engine("constrained")
    for i, (way, ax) in enumerate(
        zip(WAYS, figure.subplots(1, len(WAYS), sharey=True), strict=True)
    ):
        for color, kind in zip(("C3", "C0"), DISTANCES, strict=True):
            ax.plot(probes, found[way, kind][: len(probes)], "o", color=color, ms=4, label=kind)
            for value in PAPER[kind]:
                ax.axhline(value, color=color, lw=0.8, ls=":", zorder=0)
        ax.set_title(way, fontsize=9)
        ax.tick_params(axis="x", rotation=75, labelsize=7)
        ax.grid(axis="y", color="0.92")
        ax.spines[["top", "right"]].set_visible(False)
        if i == 0:
            ax.set_ylabel("cosine similarity (dotted: the paper's)", fontsize=8)
            ax.legend(frameon=False, fontsize=8)
    return figure


def _draw_all(found: dict[tuple[str, str], FloatArray], names: tuple[str, ...]) -> Figure:
    n = len(names)
    figure = new_figure(9.6, 4.6)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(1, 2)
    low = min(float(found[KNOWN, kind].min()) for kind in DISTANCES)
    step = max(1, n // 12)
    for ax, kind in zip(axes, DISTANCES, strict=True):
        table = np.eye(n)
        upper = np.triu_indices(n, 1)
        table[upper] = found[KNOWN, kind]
        table.T[upper] = found[KNOWN, kind]
        picture = ax.imshow(table, cmap="viridis", vmin=low, vmax=1, interpolation="nearest")
        ax.set_title(f"{kind}, mean {found[KNOWN, kind].mean():.4f}", fontsize=9)
        ax.set_xticks(range(0, n, step), names[::step], rotation=75, fontsize=7)
        ax.set_yticks(range(0, n, step), names[::step], fontsize=7)
    bar = figure.colorbar(picture, ax=axes, fraction=0.03)
    bar.set_label("cosine similarity, known correspondence", fontsize=8)
    return figure
