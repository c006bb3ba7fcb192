"""The claim "practically efficient": time and memory of the forms against vertices and samples."""

import multiprocessing
import re
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from paper.correspondences import EXACT, FORMS, N_EIGENPAIRS, PAPERS, SMDS
from paper.forms import N_SAMPLES, Method, make_form
from paper.result import Figure, Result
from paper.run import Arrays, Run, everywhere, single_thread
from unbend._types import FloatArray, IntArray
from unbend.choices import DistanceKind
from unbend.datasets import make_quadruped, make_sphere
from unbend.mesh import Mesh
from unbend.report import new_figure

METHODS: dict[str, tuple[DistanceKind, Method]] = {
    name: FORMS[name] for name in (EXACT, PAPERS, SMDS)
}
_COLORS = {EXACT: "C0", PAPERS: "C2", SMDS: "C3"}
_SIZES = {True: (2000, 5000, 10_000), False: (2000, 5000, 10_000, 20_000, 50_000)}
_SAMPLES = {True: (50, 200, 800), False: (50, 100, 200, 400, 800)}
_AT = {True: 5000, False: 10_000}  # vertices, where the samples vary
_REPEATS = 3
_STATUS = Path("/proc/self/status")


def efficiency(run: Run) -> Result:
    """Time the forms of our own animal, one thread each, and measure the memory they take.

    Parameters
    ----------
    run : Run
        Its shapes are not used: meshes of one surface at every size are needed.

    Returns
    -------
    Result
    """
    settings = [(n, N_SAMPLES) for n in _SIZES[run.quick]]
    settings += [(_AT[run.quick], p) for p in _SAMPLES[run.quick] if p != N_SAMPLES]
    alone = replace(run, jobs=1)  # nothing else shall run beside what is timed
    times = everywhere(alone, take_times, settings)
    peaks = everywhere(alone, take_memory, settings) if _STATUS.exists() else [{}] * len(settings)
    rows: list[dict[str, object]] = []
    for (n, p), time, peak in zip(settings, times, peaks, strict=True):
        row: dict[str, object] = {"vertices": n, "samples": p}
        row |= {f"{name}, s": float(time[name]) for name in METHODS}
        row |= {f"{name}, MiB": float(peak[name]) for name in METHODS if peak}
        rows.append(row)
    fits = [_fit(name, rows) for name in METHODS]
    return Result(
        title="Practically efficient? Time and memory of canonical forms",
        tables={"costs": rows, "exponents": fits},
        figures={"efficiency": _draw(rows, run.quick)},
        text=_text(rows, fits, run.quick),
    )


def take_times(n_vertices: int, n_samples: int) -> Arrays:
    """Median seconds of every method, in turn, in a process of their own."""
    mesh = make_quadruped("walking", n_vertices=n_vertices).mesh
    return {
        name: np.array(value)
        for name, value in _alone(times_of, mesh.vertices, mesh.faces, n_samples).items()
    }


def take_memory(n_vertices: int, n_samples: int) -> Arrays:
    """MiB by which each method raises the peak of a process of its own."""
    mesh = make_quadruped("walking", n_vertices=n_vertices).mesh
    return {
        name: np.array(_alone(peak_of, name, mesh.vertices, mesh.faces, n_samples))
        for name in METHODS
    }


def _alone(function: Callable[..., Any], *arguments: Any) -> Any:
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context, initializer=single_thread) as pool:
        return pool.submit(function, *arguments).result()


def times_of(vertices: FloatArray, faces: IntArray, n_samples: int) -> dict[str, float]:
    """Median seconds of every method, in turn."""
    seconds: dict[str, list[float]] = {name: [] for name in METHODS}
    for name in METHODS:
        _warm_up(name)
    for _ in range(_REPEATS):
        for name in METHODS:
            start = perf_counter()
            _form(Mesh(vertices, faces), name, n_samples)
            seconds[name].append(perf_counter() - start)
    return {name: float(np.median(several)) for name, several in seconds.items()}


def peak_of(name: str, vertices: FloatArray, faces: IntArray, n_samples: int) -> float:
    """MiB by which one method raises this process's peak."""
    _warm_up(name)
    before = _resident("VmRSS")
    _form(Mesh(vertices, faces), name, n_samples)
    return _resident("VmHWM") - before


def _warm_up(name: str) -> None:
    """Compile what is compiled, and load what is loaded, before anything is measured."""
    _form(make_sphere(3), name, 50)


def _resident(field: str) -> float:
    found = re.search(rf"{field}:\s*(\d+)", _STATUS.read_text("utf-8"))
    return int(found[1]) / 1024 if found else float("nan")


def _form(mesh: Mesh, name: str, n_samples: int) -> None:
    make_form(mesh, *METHODS[name], N_EIGENPAIRS, n_samples)


def _by_vertices(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    return [row for row in rows if row["samples"] == N_SAMPLES]


def _by_samples(rows: list[dict[str, object]], quick: bool) -> list[dict[str, object]]:
    mine = [row for row in rows if row["vertices"] == _AT[quick]]
    return sorted(mine, key=lambda row: int(str(row["samples"])))


def _column(rows: list[dict[str, object]], name: str) -> np.ndarray:
    return np.array([float(str(row[name])) for row in rows])


def _fit(name: str, rows: list[dict[str, object]]) -> dict[str, object]:
    """Power of the number of vertices that time grows with: the slope of the log-log line."""
    mine = _by_vertices(rows)
    sizes = np.log(_column(mine, "vertices"))
    seconds = np.log(_column(mine, f"{name}, s"))
    return {"method": name, "power": float(np.polyfit(sizes, seconds, 1)[0])}


def _draw(rows: list[dict[str, object]], quick: bool) -> Figure:
    units = [("s", "seconds, one thread")]
    if any(key.endswith("MiB") for key in rows[0]):
        units.append(("MiB", "peak memory, MiB"))
    figure = new_figure(8.4, 3.1 * len(units))
    figure.set_layout_engine("constrained")
    axes = figure.subplots(len(units), 2, sharey="row", squeeze=False)
    across = (
        ("vertices", _by_vertices(rows), f"vertices ({N_SAMPLES} samples)"),
        ("samples", _by_samples(rows, quick), f"samples ({_AT[quick]:,} vertices)"),
    )
    for (unit, cost), two in zip(units, axes, strict=True):
        for ax, (key, mine, label) in zip(two, across, strict=True):
            for name, color in _COLORS.items():
                ax.plot(
                    _column(mine, key), _column(mine, f"{name}, {unit}"), "o-",
                    color=color, ms=4, lw=1.3, label=name,
                )  # fmt: skip
            ax.set_xscale("log")
            if unit == "s":
                ax.set_yscale("log")
                ax.yaxis.set_major_formatter("{x:g}")
            else:
                ax.set_ylim(bottom=0)
            ticks = _column(mine, key).astype(int)
            ax.set_xticks(ticks, [f"{tick:,}" for tick in ticks], fontsize=8)
            ax.set_xticks([], minor=True)
            ax.set_xlabel(label, fontsize=9)
            ax.grid(color="0.92")
            ax.spines[["top", "right"]].set_visible(False)
        two[0].set_ylabel(cost, fontsize=9)
    axes[0, 0].legend(frameon=False, fontsize=8)
    return figure


def _text(rows: list[dict[str, object]], fits: list[dict[str, object]], quick: bool) -> str:
    largest = _by_vertices(rows)[-1]
    times = {name: float(str(largest[f"{name}, s"])) for name in METHODS}
    powers = {str(fit["method"]): float(str(fit["power"])) for fit in fits}
    few, many = _by_samples(rows, quick)[0], _by_samples(rows, quick)[-1]
    growth = {
        name: float(str(many[f"{name}, s"])) / float(str(few[f"{name}, s"]))
        for name in (PAPERS, SMDS)
    }
    memory = (
        "Memory is by how much the peak of a process of its own rises above what it held before; "
        "about 40 MiB of each are taken once, whatever the size."
        if f"{EXACT}, MiB" in rows[0]
        else "Memory was not measured: this system does not tell a process its peak."
    )
    faster = times[PAPERS] < times[SMDS]
    holds = "holds" if faster and max(powers.values()) < 1.5 else "holds in part"
    listed = ", ".join(f"{name} {times[name]:.2f} s" for name in METHODS)
    return f"""
The paper calls its method practically efficient. Times of another year's machine and programs
compare with nothing; what can be looked at is how costs grow, and which front end costs less.

Ours: a walking dog, our own, at every size; the whole of a three-dimensional form from a mesh in
memory, stress included, {N_EIGENPAIRS} eigenpairs and {N_SAMPLES} samples where they are used, one
thread, nothing kept from run to run, medians of {_REPEATS} in turn. {memory}

- At {largest["vertices"]:,} vertices: {listed}. Of the two sampled front ends the biharmonic one
  is {"" if faster else "not "}the faster: S-MDS takes {times[SMDS] / times[PAPERS]:.1f} times as
  long. The exact form, which needs neither samples nor eigenpairs, takes
  {times[EXACT] / times[PAPERS]:.2f} of the time of the sampled one.
- Time grows with the number of vertices to the power of
  {", ".join(f"{powers[name]:.2f} ({name})" for name in METHODS)}.
- From {few["samples"]} to {many["samples"]} samples it grows by a factor of
  {growth[PAPERS]:.1f} ({PAPERS}) and {growth[SMDS]:.1f} ({SMDS}).

The claim {holds}, up to the sizes measured.
"""
