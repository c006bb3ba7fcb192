"""The mean of a collection and how its shapes vary, as files."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from unbend.collection._files import make_folder
from unbend.collection._mean import MeanShape
from unbend.errors import MissingExtraError
from unbend.io import value_colors, write_mesh, write_table

DEVIATIONS = 3
_MOST_DRAWN = 5


def write_mean(folder: str | os.PathLike[str], found: MeanShape) -> tuple[Path, ...]:
    """Write a mean shape, its components and its tables into a folder.

    Parameters
    ----------
    folder : path
        Made if it does not exist.
    found : MeanShape

    Returns
    -------
    tuple of Path
        What was written. The picture only where matplotlib is installed.

    Raises
    ------
    FileError
        If something cannot be written.
    """
    folder = make_folder(folder)
    statistics = found.statistics
    k = len(statistics.variances)
    written = [folder / "mean.ply"]
    spread = statistics.variability
    colors = value_colors(spread, limits=(0, float(np.nanmax(spread))))
    write_mesh(written[0], found.mean, scalars={"variability": spread}, colors=colors)
    for i in range(k):
        for word, deviations in (("minus", -DEVIATIONS), ("plus", DEVIATIONS)):
            written.append(folder / f"component_{i + 1}_{word}.ply")
            write_mesh(written[-1], found.at(i, deviations))
    shares = statistics.variances / max(statistics.total_variance, 1e-300)
    tables: dict[str, tuple[tuple[str, ...], Iterable[tuple[Any, ...]]]] = {
        "variances.csv": (
            ("component", "variance", "share"),
            zip(range(1, k + 1), statistics.variances.tolist(), shares.tolist(), strict=True),
        ),
        "scores.csv": (
            ("path", "size", "confidence", "coverage", *(f"score_{i + 1}" for i in range(k))),
            (
                (name, *numbers, *scores)
                for name, *numbers, scores in zip(
                    found.names,
                    statistics.sizes.tolist(),
                    found.confidences.tolist(),
                    found.coverages.tolist(),
                    statistics.scores.tolist(),
                    strict=True,
                )
            ),
        ),
        "left_out.csv": (("path", "reason"), ((one.path, one.reason) for one in found.left_out)),
    }
    for name, (head, rows) in tables.items():
        written.append(folder / name)
        write_table(written[-1], [head, *rows])
    with suppress(MissingExtraError):
        draw_components(found, folder / "components.png")
        written.append(folder / "components.png")
    for old in folder.glob("component_*_*.ply"):  # of an earlier mean with more components
        if re.fullmatch(r"component_\d+_(minus|plus)\.ply", old.name) and old not in written:
            old.unlink()
    return tuple(written)


def draw_components(found: MeanShape, path: Path) -> None:
    """Draw the mean as it changes along each of the first components."""
    from unbend.report.shape_figures import draw_variation

    steps = np.linspace(-DEVIATIONS, DEVIATIONS, 5)
    statistics = found.statistics
    rows = [
        (
            f"component {i + 1}: {statistics.variances[i] / statistics.total_variance:.0%}",
            [found.at(i, float(step)) for step in steps],
        )
        for i in range(min(_MOST_DRAWN, len(statistics.variances)))
    ]
    if rows:
        draw_variation(rows, [f"{step:+g} SD" if step else "mean" for step in steps], path)
