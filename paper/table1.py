"""Table 1 and Figure 2: how many correspondences are right, by threshold, class and method."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from paper.correspondences import (
    ALTERNATIVES,
    EXACT,
    FORMS,
    METHODS,
    PAPERS,
    PROGRESSIVE,
    SMDS,
    judge_all,
    label_of,
)
from paper.result import Figure, Result
from paper.run import Arrays, Run
from paper.table1_text import table1_text
from unbend._types import FloatArray
from unbend.correspondence import THRESHOLDS
from unbend.errors import InputError
from unbend.report import new_figure

# Percentages in the paper's Table 1, by method and column.
PAPER_THRESHOLDS = (0.025, 0.05, 0.1, 0.15, 0.2)
PAPER: dict[str, dict[str, tuple[float, ...]]] = {
    PAPERS: {
        "animals": (19.18, 63.34, 98.87, 99.97, 100.0),
        "humans": (20.99, 66.35, 99.23, 100.0, 100.0),
        "all": (19.92, 65.28, 99.08, 100.0, 100.0),
    },
    SMDS: {
        "animals": (12.16, 39.30, 67.38, 81.15, 89.07),
        "humans": (14.71, 51.12, 94.63, 99.76, 99.99),
        "all": (14.60, 48.84, 86.44, 95.67, 98.86),
    },
}
COLUMNS = ("animals", "humans", "all")
# Everything else is an animal: the paper has two columns, and gorillas and centaurs go there.
HUMANS = ("david", "michael", "victoria", "human", "child")
_COLORS = {SMDS: "C3", PAPERS: "C0", EXACT: "C9", PROGRESSIVE: "C2"}
_QUICK_TARGETS = 2
_N_ROWS = {True: 200, False: 500}  # quick, full


def table1(run: Run) -> Result:
    """Match each class's first pose with every other by all methods, and judge them.

    Parameters
    ----------
    run : Run
        Its `shapes` are used.

    Returns
    -------
    Result

    Raises
    ------
    InputError
        If no class has two shapes.
    """
    most = _QUICK_TARGETS if run.quick else None
    pairs = [
        (names[0], target) for names in run.shapes.classes.values() for target in names[1:][:most]
    ]
    if not pairs:
        raise InputError("table1 needs two shapes of a class or more")
    found = judge_all(run, pairs, _N_ROWS[run.quick])
    kinds = [run.shapes.class_of[source] for source, _ in pairs]
    groups = _groups(kinds)
    columns = [group for group in COLUMNS if group in groups]
    classes = [group for group in groups if group not in COLUMNS]
    rows = _pair_rows(pairs, kinds, found)
    summary = [row for group in columns for row in _rows_of(found, groups, group)]
    alternatives = [
        _percentages(found, groups["all"], label_of(method, way))
        for method in FORMS
        for way in ("", *ALTERNATIVES)
    ]
    return Result(
        title="Table 1 and Figure 2: correspondences within a geodesic error",
        tables={
            "summary": summary,
            "alternatives": alternatives,
            "classes": [row for group in classes for row in _rows_of(found, groups, group)],
            "pairs": rows,
            "curves": _curves(found, groups),
        },
        figures={
            "figure2": _draw(found, groups, columns),
            "figure2_classes": _draw(found, groups, classes),
            "alternatives": _draw_alternatives(found, groups["all"]),
        },
        text=table1_text(summary, alternatives, rows, columns, _N_ROWS[run.quick], len(pairs)),
    )


def _groups(kinds: Sequence[str]) -> dict[str, list[int]]:
    """Numbers of the pairs of each column of the paper's table and of each class."""
    human = [kind in HUMANS for kind in kinds]
    groups = {
        "animals": [i for i, person in enumerate(human) if not person],
        "humans": [i for i, person in enumerate(human) if person],
        "all": list(range(len(kinds))),
    }
    groups |= {kind: [i for i, one in enumerate(kinds) if one == kind] for kind in kinds}
    return {name: numbers for name, numbers in groups.items() if numbers}


def _errors(found: list[Arrays], numbers: Sequence[int], label: str) -> FloatArray:
    return np.concatenate([found[i][label] for i in numbers])


def _curve(errors: FloatArray) -> FloatArray:
    return np.asarray(100 * (errors[:, None] <= THRESHOLDS).mean(axis=0))


def _percentages(found: list[Arrays], numbers: Sequence[int], label: str) -> dict[str, object]:
    errors = _errors(found, numbers, label)
    row: dict[str, object] = {"method": label}
    for limit in PAPER_THRESHOLDS:
        row[f"<= {limit:g}, %"] = float(100 * (errors <= limit).mean())
    return row | {"mean error": float(errors.mean()), "median error": float(np.median(errors))}


def _rows_of(
    found: list[Arrays], groups: dict[str, list[int]], group: str
) -> list[dict[str, object]]:
    """Give a column of Table 1: the paper's lines, then ours."""
    rows: list[dict[str, object]] = []
    for method, columns in PAPER.items():
        if group in columns:
            row: dict[str, object] = {"shapes": group, "method": f"the paper's {method}"}
            for limit, share in zip(PAPER_THRESHOLDS, columns[group], strict=True):
                row[f"<= {limit:g}, %"] = share
            rows.append(row | {"mean error": math.nan, "median error": math.nan})
    ours = [{"shapes": group} | _percentages(found, groups[group], one) for one in METHODS]
    return [*rows, *ours]


def _pair_rows(
    pairs: list[tuple[str, str]], kinds: list[str], found: list[Arrays]
) -> list[dict[str, object]]:
    """Mean errors and seconds of each pair, the worst progressive match first."""
    rows: list[dict[str, Any]] = []
    for (source, target), kind, errors in zip(pairs, kinds, found, strict=True):
        row: dict[str, Any] = {"source": source, "target": target, "class": kind}
        row |= {f"{method}, mean error": float(errors[method].mean()) for method in METHODS}
        row |= {f"{method}, s": float(errors[f"{method} seconds"]) for method in METHODS}
        rows.append(row | {"confidence": float(errors["confidence"])})
    return sorted(rows, key=lambda row: -row[f"{PROGRESSIVE}, mean error"])


def _curves(found: list[Arrays], groups: dict[str, list[int]]) -> list[dict[str, object]]:
    """Every curve at all 17 thresholds, by every protocol that the ground truth allows."""
    labels = [*METHODS, *(label_of(method, way) for method in FORMS for way in ALTERNATIVES)]
    rows: list[dict[str, object]] = []
    for group, numbers in groups.items():
        for label in labels:
            for protocol in ("direct", "map-min"):
                name = label_of(label, protocol=protocol)
                if not all(name in found[i] for i in numbers):
                    continue
                row: dict[str, object] = {"shapes": group, "method": label, "protocol": protocol}
                shares = _curve(_errors(found, numbers, name))
                row |= {f"{t:g}": float(s) for t, s in zip(THRESHOLDS, shares, strict=True)}
                rows.append(row)
    return rows


def _draw(found: list[Arrays], groups: dict[str, list[int]], names: list[str]) -> Figure:
    wide = min(3, len(names))
    high = -(-len(names) // wide)
    figure = new_figure(3.4 * wide, 3.1 * high + 0.5)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(high, wide, sharex=True, sharey=True, squeeze=False).ravel()
    for ax, group in zip(axes, names, strict=False):
        for method in METHODS:
            shares = _curve(_errors(found, groups[group], method))
            style = "--" if method == EXACT else "-"  # it lies on the sampled one's line
            ax.plot(THRESHOLDS, shares, style, color=_COLORS[method], lw=1.6, label=method)
        for method, columns in PAPER.items():
            if group in columns:
                ax.plot(
                    PAPER_THRESHOLDS, columns[group], "o:", color=_COLORS[method], mfc="white",
                    ms=4.5, lw=1, label=f"the paper's {method}",
                )  # fmt: skip
        _dress(ax, f"{group}, {len(groups[group])} pairs")
    for ax in axes[len(names) :]:
        ax.set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncol=3, frameon=False, fontsize=8)
    return figure


def _draw_alternatives(found: list[Arrays], numbers: list[int]) -> Figure:
    figure = new_figure(10.2, 3.6)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(1, len(FORMS), sharey=True)
    for ax, method in zip(axes, FORMS, strict=True):
        for way, style in zip(("", *ALTERNATIVES), ("-", "--", "-", "--"), strict=True):
            shares = _curve(_errors(found, numbers, label_of(method, way)))
            color = "C1" if "known" in way else _COLORS[method]
            ax.plot(THRESHOLDS, shares, style, color=color, lw=1.6, label=way or "ICP")
        if method in PAPER:
            ax.plot(
                PAPER_THRESHOLDS, PAPER[method]["all"], "o:", color="0.4", mfc="white", ms=4.5,
                lw=1, label="the paper's",
            )  # fmt: skip
        _dress(ax, method)
        ax.legend(frameon=False, fontsize=7, loc="best")
    return figure


def _dress(ax: Figure, title: str) -> None:
    ax.set(xlim=(0, 0.2), ylim=(0, 102), xticks=(0, 0.05, 0.1, 0.15, 0.2))
    ax.set_title(title, fontsize=9)
    ax.set_xlabel("geodesic error / sqrt(area)", fontsize=8)
    ax.set_ylabel("correspondences, %", fontsize=8)
    ax.tick_params(labelsize=8)
    ax.label_outer()
    ax.grid(color="0.92")
    ax.spines[["top", "right"]].set_visible(False)
