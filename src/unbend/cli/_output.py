"""What commands say: messages and progress on stderr, results as text or JSON on stdout."""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path
from typing import Any

import typer

import unbend
from unbend._display import MIRROR_FITS, confidence_told, is_doubtful, where_landmarks_help
from unbend._text import printable, quoted
from unbend.errors import UnbendWarning

EXIT_SOME_FAILED = 1
EXIT_REFUSED = 2
EXIT_UNSURE = 3
SHORT_ID = 12  # digits of an id in a collection that are shown
_SECONDS_BETWEEN_LINES = 30.0


@dataclass
class _Run:
    """What the running command was asked for, and what it has said."""

    as_json: bool = False
    quiet: bool = False
    warnings: list[str] = field(default_factory=list)
    start: float = field(default_factory=time.perf_counter)
    last_line: float = 0.0  # of progress: the time, or that of the first step
    bar: Any = None


_run = _Run()


def begin(as_json: bool, quiet: bool) -> None:
    """Begin a command: nothing has been said yet, and the clock starts."""
    global _run
    _run = _Run(as_json, quiet)


def elapsed() -> float:
    return time.perf_counter() - _run.start


def say(kind: str, sentence: str) -> None:
    """Print one line such as ``error: ...`` to stderr, where it cannot spoil piped output."""
    if kind.startswith(("note", "warning")):
        _run.warnings.append(sentence)
    if not (_run.quiet and kind in ("note", "progress")):
        end_progress()
        typer.echo(f"{kind}: {printable(sentence)}", err=True)


def what_to_keep(out: str, original: str, *, whole: bool = True, moved: bool = True) -> str | None:
    """Give the file of which an OBJ or GLB file keeps all but positions, if any; say what is lost.

    `whole` says that `out` gets all faces of the original, and `moved` that they are elsewhere.
    """
    held = unbend.io.file_extras(original)
    keeps = whole and unbend.io.keeps_all(out, original)
    if keeps and out.lower().endswith(".obj"):
        kept = ", with new positions" if moved else ""
        if moved and "normals" in held:
            kept += "; its normals are recomputed, or left out where unlike faces share one"
        folders = {os.path.realpath(os.path.dirname(path)) for path in (out, original)}
        if "materials" in held and len(folders) == 2:
            kept += f"; its materials stay in the folder of {original}"
        say("note", f"{out} has all lines of {original}{kept}")
        return original
    if keeps and moved:
        kept = "with new positions and normals, but without tangents"
        say("note", f"{out} has all that {original} has, {kept}")
        return original
    if held:
        say("note", f"{out} does not keep {', '.join(held)} of {original}")
    if out.lower().endswith(".stl") and not original.lower().endswith(".stl"):
        say("note", f"{out} holds bare triangles: it does not number vertices like {original}")
    return None


def numbered(path: str, number: object) -> str:
    """Name one of several files of a result."""
    return str(Path(path).with_stem(f"{Path(path).stem}-{number}"))


def viewer_of(*paths: str) -> str:
    """Name programs that open mesh files."""
    of_vtk = any(path.lower().endswith((".vtk", ".vtp", ".vtu")) for path in paths)
    return "ParaView" if of_vtk else "MeshLab or Blender"


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Print a warning once, without the line of code: users did not write it."""
    if str(message) not in _run.warnings:
        ours = issubclass(category, UnbendWarning)
        say("warning" if ours else f"warning ({category.__name__})", str(message))


def warn_if_doubtful(match: unbend.Match, *, seen: bool = False) -> None:
    """Warn of a match that may well be wrong; `seen` tells that a page of it was written."""
    if not is_doubtful(match.confidence):
        return
    if match.mirror_fits:
        show_warning(MIRROR_FITS, UnbendWarning)
        return
    reason = "the shapes may differ too much, or be symmetric"
    if match.landmark_hints:
        reason = "another map is nearly as good, as for symmetric shapes or small parts"
    elif is_doubtful(match.confidence_bound):
        reason = "the final map is in disorder"
    look = "on the page" if seen else "with unbend match --report"
    where = where_landmarks_help(match.landmark_hints)
    whole = ""
    if min(match.overlap_source, match.overlap_target) < 1:
        whole = ", or with --partial none if neither shape lacks a part"
    trust = f"the match is doubtful (confidence {match.confidence:.2f}): {reason}"
    say(
        "warning",
        f"{trust}; look at it {look}, and if it is wrong place landmarks with unbend view{where}, "
        f"and match again with --landmarks{whole}",
    )


def confidence_of(result: object) -> str:
    """Say how far the match behind a result is to be trusted."""
    confidence = getattr(result, "confidence", math.nan)
    return confidence_told(confidence) + ("" if math.isnan(confidence) else ", of the match")


def progress(stage: str, share: float) -> None:
    """Show the step under way and its share: a bar, or a line now and then in a log."""
    if _run.quiet or sys.stderr is None:
        return
    now = time.perf_counter()
    _run.last_line = _run.last_line or now
    if sys.stderr.isatty():
        if _run.bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

            words = TextColumn("{task.percentage:>3.0f}%  {task.description}", markup=False)
            console = Console(stderr=True)
            _run.bar = Progress(
                SpinnerColumn("line"), BarColumn(), words, console=console, transient=True
            )
            _run.bar.add_task(stage, total=1.0)
            _run.bar.start()
        _run.bar.update(_run.bar.task_ids[0], description=stage, completed=share)
    elif now - _run.last_line > _SECONDS_BETWEEN_LINES:
        _run.last_line = now
        say("progress", stage if not share else f"{stage}, {share:.0%}")


def end_progress() -> None:
    """Remove the bar."""
    if _run.bar is not None:
        _run.bar.stop()
        _run.bar = None


def shown(path: str) -> str:
    """Shorten a path that is below the folder we are in."""
    return path.removeprefix(os.path.join(os.getcwd(), ""))


def shown_shape(
    shape: unbend.collection.Entry | unbend.collection.Hit | unbend.collection.RegisteredShape,
) -> str:
    """Show the first path of a shape, and that it has others."""
    more = f" and {len(shape.also) - 1:,} more" if len(shape.also) > 1 else ""
    return shown(shape.path) + (f" (also {shown(shape.also[0])}{more})" if shape.also else "")


def list_failures(failures: Iterable[unbend.collection.Failure]) -> None:
    """Name on stderr what could not be done, each with its reason."""
    for failure in failures:
        paths = [shown(path) for path in failure.path.split(" -> ")]
        repeated = f"{os.path.basename(paths[0])}: " if len(paths) == 1 else ""
        say("failed", f"{' -> '.join(paths)}: {failure.reason.removeprefix(repeated)}")


def tell(
    result: Mapping[str, Any],
    lines: Iterable[str],
    *,
    shapes: Iterable[unbend.Mesh] = (),
    written: Iterable[str | None] = (),
    report: str | None = None,
    next_step: str | None = None,
    failures: Sequence[unbend.collection.Failure] | None = None,
    unsure: bool = False,
) -> None:
    """Tell what a command found: as JSON if that was asked for, else in lines.

    Notes of the readers of `shapes` go to stderr. `written` and `report` are the files of options,
    None for those not given. `failures` end with exit code 1; a match that is `unsure` with 3.
    """
    end_progress()
    if failures is not None:
        list_failures(failures)
        result = {**result, "failed": failures}
    for shape in shapes:
        for note in shape.notes:
            say("note", f"{shape.name}: {note}")
    paths = [path for path in (*written, report) if path is not None]
    if report is not None:
        next_step = f"open {report} in a browser"
    if _run.as_json:
        common = {"written": paths, "warnings": _run.warnings, "seconds": elapsed()}
        typer.echo(json.dumps(_plain({**result, **common}), indent=2, allow_nan=False))
    else:
        for line in lines:
            typer.echo(printable(line))
        if paths:
            typer.echo(f"written: {', '.join(map(printable, paths))}")
        if next_step is not None and not (unsure or _run.quiet):
            typer.echo(f"next: {printable(next_step)}")
    if failures or unsure:
        raise typer.Exit(EXIT_UNSURE if unsure else EXIT_SOME_FAILED)


def fields_of(result: object, *names: str) -> dict[str, Any]:
    return {name: getattr(result, name) for name in names}


def _plain(value: Any) -> Any:
    """Turn a value into what JSON has; NaN and infinity, which it lacks, become None."""
    if is_dataclass(value):
        value = vars(value)
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | Iterator):
        return [_plain(entry) for entry in value]
    if hasattr(value, "tolist"):  # NumPy arrays and scalars, without importing NumPy
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def rows(values: Mapping[str, str]) -> list[str]:
    """Put names and values into two aligned columns."""
    return table("<<", *values.items())


def table(align: str, *cells: Sequence[str]) -> list[str]:
    """Align rows of cells, the first being the heads; ``<`` and ``>`` say how, column by column."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    forms = [f"{side}{width}" for side, width in zip(align, widths, strict=True)]
    return ["  ".join(map(format, row, forms)).rstrip() for row in cells]


def matrix(names: Sequence[str], values: Iterable[Sequence[float]]) -> list[str]:
    """Lay out a square table of numbers; columns are numbered, and rows named and numbered."""
    cells = [["", *map(str, range(len(names))), ""]]
    for i, (name, row) in enumerate(zip(names, values, strict=True)):
        cells.append([name, *(f"{value:.4f}" for value in row), str(i)])
    return table("<" + ">" * len(names) + "<", *cells)


def command_line() -> str:
    """Give the command that is running, as it could be typed again."""
    return quoted("unbend", *sys.argv[1:])
