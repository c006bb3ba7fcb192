"""Writing an experiment down: a page, its figures, its numbers, and an index of all pages."""

import csv
import io
import json
import math
import os
import platform
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from paper.data import Described, make_folder
from paper.result import Result
from unbend._parallel import n_threads
from unbend.io import atomic_write
from unbend.report import save_figure

_PACKAGES = ("unbend", "numpy", "scipy", "numba", "potpourri3d", "matplotlib")
# Longer tables are in their CSV file only.
_MOST_ROWS = 40


def write_page(folder: Path, target: str, result: Result, command: str, data: Described) -> Path:
    """Write everything that an experiment found into a folder of its own.

    Parameters
    ----------
    folder : Path
        Where the folder goes; made if it is missing.
    target : str
        Name of the experiment and of its folder.
    result : Result
    command : str
        What runs it again.
    data : Described
        What it ran on.

    Returns
    -------
    Path
        The page, README.md.

    Raises
    ------
    FileError
        If something cannot be written.
    """
    place = make_folder(folder / target)
    for name, figure in result.figures.items():
        for suffix in (".png", ".pdf"):
            save_figure(figure, place / f"{name}{suffix}")
    for name, rows in result.tables.items():
        _write(place / f"{name}.csv", _as_csv(rows))
    facts = {
        "target": target,
        "title": result.title,
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "command": command,
        "data": data.about,
        "caveats": list(data.caveats),
        "left out": list(data.left_out),
        "machine": machine(),
        "versions": versions(),
    }
    everything = facts | {"tables": result.tables}
    _write(place / "results.json", json.dumps(_plain(everything), indent=1, allow_nan=False) + "\n")
    _write(place / "README.md", _page(result, facts))
    return place / "README.md"


def write_index(folder: Path, skipped: dict[str, str]) -> Path:
    """List the pages that a folder holds, newest results or not.

    Parameters
    ----------
    folder : Path
    skipped : dict of str to str
        Experiments that could not run, and why.
    """
    lines = [
        "# The paper, reproduced",
        "",
        "J. Yang, A. J. Obaseki and J. X. Chen, *Spectral Multi-Dimensional Scaling using "
        "Biharmonic Distance*, 2019, run again. Each page gives its numbers, its figures and the "
        "command that makes them in a clone of the repository.",
        "",
        "| page | what | date | data |",
        "|---|---|---|---|",
    ]
    for path in sorted(folder.glob("*/results.json")):
        facts = json.loads(path.read_text(encoding="utf-8"))
        name = path.parent.name
        lines.append(
            f"| [{name}]({name}/) | {facts['title']} | {facts['date']} | {facts['data']} |"
        )
    lines += [f"\nNot run: {name}. {why[0].upper()}{why[1:]}." for name, why in skipped.items()]
    _write(folder / "README.md", "\n".join(lines) + "\n")
    return folder / "README.md"


def machine() -> dict[str, object]:
    """Processor, cores and memory of this machine."""
    processor = platform.processor()
    with_names = Path("/proc/cpuinfo")
    if with_names.exists():
        found = re.search(r"model name\s*: (.*)", with_names.read_text("utf-8"))
        processor = found[1].strip() if found else processor
    facts: dict[str, object] = {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": processor or "unknown",
        "cores": n_threads(),
    }
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        facts["memory, GiB"] = round(memory / 2**30)
    return facts


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that the numbers depend on."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            if name == "unbend":  # run from its source
                from unbend import __version__

                found[name] = __version__
    return found


def markdown_table(rows: Sequence[dict[str, object]]) -> str:
    """Rows of equal keys as a Markdown table; numbers with the digits that they need."""
    if not rows:
        return ""
    heads = list(rows[0])
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    lines += [f"| {' | '.join(_cell(row.get(head)) for head in heads)} |" for row in rows]
    return "\n".join(lines)


def _page(result: Result, facts: dict[str, Any]) -> str:
    said = " ".join([f"Run on {facts['data']}.", *facts["caveats"]])
    parts = [f"# {result.title}", f"> {said}", result.text.strip()]
    parts += [f"![{name}]({name}.png)" for name in result.figures]
    for name, rows in result.tables.items():
        heading = f"## {name.replace('_', ' ').capitalize()}"
        if len(rows) > _MOST_ROWS:
            parts += [heading, f"{len(rows)} rows: [{name}.csv]({name}.csv)"]
        else:
            parts += [heading, markdown_table(rows), f"[{name}.csv]({name}.csv)"]
    machine = ", ".join(f"{name} {value}" for name, value in facts["machine"].items())
    tools = ", ".join(f"{name} {value}" for name, value in facts["versions"].items())
    figures = ", ".join(f"[{name}.pdf]({name}.pdf)" for name in result.figures)
    parts += [
        "## How to run it again",
        f"    {facts['command']}",
        "\n".join(
            [
                f"- Data: {facts['data']}.",
                *(f"- {note}" for note in facts["left out"]),
                f"- Run on {facts['date']}; {machine}.",
                f"- Versions: {tools}.",
                f"- All numbers: [results.json](results.json). As PDF: {figures or 'no figures'}.",
            ]
        ),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _cell(value: object) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.2f}" if abs(value) >= 2 else f"{value:.4f}"
    return str(value)


def _as_csv(rows: Sequence[dict[str, object]]) -> str:
    text = io.StringIO()
    if rows:
        writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return text.getvalue()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _write(path: Path, text: str) -> None:
    with atomic_write(path) as file:
        file.write(text.encode())
