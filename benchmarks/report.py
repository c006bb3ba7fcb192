"""The table, the plot and the README of the benchmarks."""

import datetime
import math
import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

STEEPEST = 1.3  # exponent that the exact form's time may grow with from 5k to 200k vertices
MOST_SECONDS, MOST_GIB = 45, 4  # of a million vertices, file to file


def write_report(rows: Sequence[Any], growth: Sequence[Any], folder: Path) -> None:
    """Print the table and the marks; write README.md and engine.png."""
    text = "\n".join([*table(rows), "", *marks(rows, growth)])
    print(text)
    folder.mkdir(parents=True, exist_ok=True)
    plot(rows, growth, folder / "engine.png")
    (folder / "README.md").write_text(_README.format(machine=machine(), table=text))


def table(rows: Sequence[Any]) -> list[str]:
    """Rows in aligned columns."""
    cells = [["what", "vertices", "ours s", "peer", "peer s", "faster", "accuracy"]]
    for row in rows:
        theirs = not math.isnan(row.theirs)
        cells.append(
            [
                row.what,
                f"{row.n:,}",
                f"{row.ours:.3f}",
                row.peer,
                f"{row.theirs:.3f}" if theirs else "",
                f"{row.ratio:.1f}x" if theirs else "",
                row.agreement,
            ]
        )
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    numeric = {1, 2, 4, 5}
    lines = [
        "  ".join(
            cell.rjust(width) if i in numeric else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]
    return [lines[0], "-" * max(map(len, lines)), *lines[1:]]


def marks(rows: Sequence[Any], growth: Sequence[Any]) -> list[str]:
    """Which marks are met and which are missed."""
    found = [
        (row.ratio >= row.mark and row.right, f"{row.what}: {row.mark:g}x {row.peer}")
        for row in rows
        if not math.isnan(row.mark)
    ]
    found += [(False, f"{row.what}: wrong against {row.peer}") for row in rows if not row.right]
    exponent = fitted(growth, "exact form")
    found.append(
        (exponent <= STEEPEST, f"exact form grows as n^{exponent:.2f}, at most {STEEPEST}")
    )
    for row in growth:
        if row.n >= 1_000_000 and row.what.startswith("file"):
            fits = row.ours < MOST_SECONDS and float(row.agreement.split()[0]) < MOST_GIB
            found.append((fits, f"{row.what}: under {MOST_SECONDS} s and {MOST_GIB} GiB"))
    return [f"{'met   ' if met else 'MISSED'}  {what}" for met, what in found]


def fitted(growth: Sequence[Any], kind: str) -> float:
    """Exponent of time against vertices, fitted to the sizes below a million."""
    points = [(row.n, row.ours) for row in growth if row.what.startswith(kind) and row.n < 5e5]
    return float(np.polyfit(*np.log(points).T, 1)[0])


def plot(rows: Sequence[Any], growth: Sequence[Any], path: Path) -> None:
    """Time against vertices, with the fitted exponents."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    pairs = [row for row in rows if row.peer == "SciPy eigsh"]
    series = {
        kind: [(row.n, row.ours) for row in growth if row.what.startswith(kind)]
        for kind in ("exact form", "file to file")
    }
    series["eigenpairs, unbend"] = [(row.n, row.ours) for row in pairs]
    series["eigenpairs, SciPy"] = [(row.n, row.theirs) for row in pairs]
    figure, axes = plt.subplots(figsize=(7, 4.5))
    for name, points in series.items():
        n, seconds = np.array(sorted(points)).T
        exponent = np.polyfit(np.log(n), np.log(seconds), 1)[0]
        axes.loglog(n, seconds, "o-", label=f"{name}: n^{exponent:.2f}")
    axes.set(xlabel="vertices", ylabel="seconds")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=130, bbox_inches="tight")
    plt.close(figure)


def machine() -> str:
    """Name the machine, the date and the versions, in one line."""
    packages = ("unbend", "numpy", "scipy", "scikit-learn", "pyfmaps", "potpourri3d")
    versions = []
    for package in packages:
        try:
            versions.append(f"{package} {version(package)}")
        except ModuleNotFoundError:
            continue
    names = [platform.processor() or platform.machine()]
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        names = [line.partition(": ")[2] for line in lines if line.startswith("model name")]
    except OSError:
        pass
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return (
        f"{datetime.date.today()}: {os.cpu_count()} cores of {names[0]}{load}; "
        f"{platform.system()}, Python {platform.python_version()}, {', '.join(versions)}."
    )


_README = """# Benchmarks

`make bench` measures and writes this page; it takes some minutes and installs what it compares
with. `make bench BENCH=--large` adds a million vertices. Real shapes are measured too where
`UNBEND_DATA` names their folder (see CONTRIBUTING.md).

Ours and the peer run in turn in one process; medians. Absolute times move between machines and
with what else they do: compare the ratios.

{machine}

```
{table}
```

![time against vertices](engine.png)
"""
