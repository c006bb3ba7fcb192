"""The page of the perturbed shapes: its figure and its words."""

import numpy as np

from paper.result import Figure
from unbend.report import new_figure

_COLORS = {"biharmonic": "C0", "S-MDS": "C3"}
_UNITS = {
    "noise": "standard deviation,\nmean edge lengths",
    "decimation": "share of\nfaces left",
    "remeshing": "share of vertices,\nmeshed anew",
    "holes": "share cut out\nin eight discs",
    "part missing": "share cut off\nin one disc",
    "shortcut": "tubes between\ntouching parts",
}
_DONE = {
    "noise": "Gaussian noise along the normals, its standard deviation in mean edge lengths",
    "decimation": "quadric collapses to a share of the faces",
    "remeshing": "the same surface meshed anew with a share of the vertices ({bodies}, our own)",
    "holes": "eight discs cut out, with what falls off together a share of the area",
    "part missing": "one disc cut off, likewise",
    "shortcut": "the two parts that are nearest in space, among those farther apart on the shape "
    "than half of the longest way, joined by tubes one face wide: the finer the mesh, the narrower",
}
_NO_DECIMATION = "\n\nDecimation was left out: it needs `pip install fast-simplification`."


def draw(
    every: list[dict[str, object]], summary: list[dict[str, object]], poses: dict[str, float]
) -> Figure:
    """Above, how far forms move; below, how wrong maps are; a column for each perturbation."""
    kinds = list(dict.fromkeys(str(row["perturbation"]) for row in summary))
    figure = new_figure(1.0 + 1.75 * len(kinds), 5.2)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(2, len(kinds), sharex="col", sharey="row", squeeze=False)
    for kind, (above, below) in zip(kinds, axes.T, strict=True):
        mine = [row for row in summary if row["perturbation"] == kind]
        places = np.arange(len(mine))
        for label, color in _COLORS.items():
            for suffix, style in (("", "--"), (", but for scale", "-")):
                above.plot(
                    places, [row[label + suffix] for row in mine], "o" + style,
                    color=color, ms=3, lw=1.2, label=label + suffix,
                )  # fmt: skip
            above.axhline(poses[label], color=color, lw=0.9, ls=":", label=f"{label}, two poses")
        for place, row in zip(places, mine, strict=True):
            errors = [
                one["map error"]
                for one in every
                if (one["perturbation"], one["strength"]) == (kind, row["strength"])
            ]
            below.plot([place] * len(errors), errors, "o", color="0.7", ms=3)
        below.plot(places, [row["map error"] for row in mine], "o-", color="C2", ms=4, lw=1.2)
        below.axhline(0.08, color="0.5", lw=0.9, ls=":")
        above.set_title(kind, fontsize=10)
        below.set_xticks(places, [f"{row['strength']:g}" for row in mine])
        below.set_xlabel(_UNITS[kind], fontsize=8)
        below.set_xlim(-0.3, len(mine) - 0.7)
        above.set_yscale("log")
        for ax in (above, below):
            ax.tick_params(labelsize=8)
            ax.grid(axis="y", color="0.92")
            ax.spines[["top", "right"]].set_visible(False)
    axes[1, 0].set_ylim(bottom=0)
    axes[0, 0].set_ylabel("form moved / its size", fontsize=9)
    axes[1, 0].set_ylabel("mean error of the map\n(grey: each shape)", fontsize=9)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(),
        loc="outside upper center", ncols=3, frameon=False, fontsize=8,
    )  # fmt: skip
    return figure


def text(
    summary: list[dict[str, object]],
    poses: dict[str, float],
    names: list[str],
    bodies: list[str],
    *,
    decimated: bool,
) -> str:
    """Say what was done and where the claim holds."""
    kinds = list(dict.fromkeys(str(row["perturbation"]) for row in summary))
    done = "\n".join(
        f"- **{kind}**: {_DONE[kind].format(bodies=', '.join(bodies))};" for kind in kinds
    )
    said = "\n".join(
        _verdict(kind, [row for row in summary if row["perturbation"] == kind], poses)
        for kind in kinds
    )
    return f"""
The paper says that the biharmonic distance, unlike the geodesic one, is insensitive to noise and
topology.

Ours: the first pose of each class ({", ".join(names)}) is perturbed, and its three-dimensional
forms at unit area, exact biharmonic ones and S-MDS ones of geodesics by the heat method, are
compared with those of the clean shape: root mean square distance of the vertices that are left,
after the best rigid motion, as a share of the clean form's size (solid in the figure: with the best
scale, too, because the area changes with every perturbation; dashed: without), the mean over the
shapes. Besides, the
perturbed shape is matched to the clean one by the progressive matcher; errors are geodesic
distances on the clean shape over the square root of its area, and a map is right if its mean error
is below 0.08. A perturbed mesh that the matcher refuses, because it has but one side, has no map
and counts as not right.

{done}{"" if decimated else _NO_DECIMATION}

We call a form insensitive to what moves it less than another pose does: biharmonic forms of two
poses of these shapes are {_percent(poses["biharmonic"])} apart but for scale, S-MDS forms
{_percent(poses["S-MDS"])} (dotted).

{said}
"""


def _verdict(kind: str, rows: list[dict[str, object]], poses: dict[str, float]) -> str:
    strongest = rows[-1]
    withstood = {
        label: [row for row in rows if _number(row[f"{label}, but for scale"]) < poses[label]]
        for label in _COLORS
    }
    held = len(withstood["biharmonic"])
    holds = {0: "does not hold", len(rows): "holds"}.get(held, "holds in part")
    moved = "; ".join(
        f"the {label} form moves by {_percent(strongest[f'{label}, but for scale'])} "
        f"({_percent(strongest[label])} with its scale), and is insensitive "
        f"{_at(withstood[label], rows)}"
        for label in _COLORS
    )
    return (
        f"- **{kind}**: the claim {holds}. At the strongest ({strongest['strength']:g}) {moved}. "
        f"From weak to strong, the biharmonic form moves less than the S-MDS form for "
        f"{_all(rows, 'biharmonic moves less')} shapes; right maps: {_all(rows, 'right maps')}."
    )


def _all(rows: list[dict[str, object]], column: str) -> str:
    return ", ".join(str(row[column]) for row in rows)


def _at(some: list[dict[str, object]], rows: list[dict[str, object]]) -> str:
    if len(some) in (0, len(rows)):
        return "at every strength" if some else "at no strength"
    return "at " + ", ".join(f"{row['strength']:g}" for row in some)


def _number(value: object) -> float:
    return float(str(value))


def _percent(value: object) -> str:
    return f"{100 * _number(value):.1f} %"
