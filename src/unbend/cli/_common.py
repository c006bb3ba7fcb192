"""What commands share: options, messages on stderr, rows and JSON on stdout."""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from unbend._text import plural, printable
from unbend.choices import Axis, LaplacianKind
from unbend.errors import InputError, UnbendWarning

if TYPE_CHECKING:
    from unbend._types import IntArray, Progress

EXIT_REFUSED = 2
_DOUBTFUL = 0.5

MeshArgument = Annotated[
    str, typer.Argument(metavar="MESH", help="A .off, .obj, .ply, .stl, .xyz or .npy file.")
]
SourceArgument = Annotated[str, typer.Argument(metavar="SOURCE", help="The mesh to map from.")]
TargetArgument = Annotated[str, typer.Argument(metavar="TARGET", help="The mesh to map to.")]
MapOutOption = Annotated[
    str | None,
    typer.Option(
        "-o",
        "--out",
        metavar="MAP",
        help="Where to write the match: .npz (all of it); .npy, .txt, .csv (the target vertex of "
        "each source vertex, from 0) or .vts (from 1).",
    ),
]
BaseOption = Annotated[
    int | None,
    typer.Option("--base", metavar="0|1", help="What MAP counts from; .vts from 1, others from 0."),
]
UpOption = Annotated[
    Axis,
    typer.Option(
        "--up",
        help="The axis that points upward in pictures; for two shapes, the source's.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON to standard output.")]
ComponentOption = Annotated[
    str | None,
    typer.Option(
        "--component",
        metavar="largest|NUMBER",
        help="Which connected component to keep; numbers count from 0, largest first.",
    ),
]

LaplacianOption = Annotated[
    LaplacianKind,
    typer.Option("--laplacian", help="auto: robust for degenerate faces or non-manifold edges."),
]
TimeOption = Annotated[
    float | None,
    typer.Option("--time", help="Diffusion time, in units of the mesh's area; by default 0.1."),
]
RandomStateOption = Annotated[int, typer.Option("--random-state", help="Random seed.")]


def _switch_cache(ctx: typer.Context, keep: bool) -> bool:
    if not keep:
        from unbend.spectral import use_cache

        ctx.with_resource(use_cache(gib=0))
    return keep


CacheOption = Annotated[
    bool,
    typer.Option(
        "--cache/--no-cache",
        callback=_switch_cache,
        help="Keep eigenpairs on disk for later runs.",
    ),
]


def command_line() -> str:
    """Give the command that is running, as it could be typed again."""
    return quoted("unbend", *sys.argv[1:])


def quoted(*words: str) -> str:
    """Put words together as this system's shell takes them."""
    shown = [printable(word) for word in words]
    if sys.platform == "win32":
        from subprocess import list2cmdline

        return list2cmdline(shown)
    return shlex.join(shown)


def say(kind: str, sentence: str) -> None:
    """Print one line such as ``error: ...`` to stderr, where it cannot spoil piped output."""
    typer.echo(f"{kind}: {printable(sentence)}", err=True)


def warn_if_doubtful(confidence: float) -> None:
    """Warn of a match that is as likely wrong as right; NaN says that nobody knows.

    What counts is the confidence as it is shown: 0.4999 is 0.50, and no more doubtful than it.
    """
    if round(confidence, 2) < _DOUBTFUL:
        say(
            "warning",
            f"the match is doubtful (confidence {confidence:.2f}): the shapes may differ too much, "
            "or be symmetric; check the match with unbend match --report",
        )


def print_notes(notes: Iterable[str]) -> None:
    """Print what was done to the input, one line each, to stderr."""
    for note in notes:
        say("note", note)


def warning_printer() -> Callable[..., None]:
    """Make what prints each warning once, without the line of code: users did not write it."""
    printed: set[str] = set()

    def print_warning(message: Warning | str, category: type[Warning], *_: Any) -> None:
        if str(message) not in printed:
            printed.add(str(message))
            ours = issubclass(category, UnbendWarning)
            say("warning" if ours else f"warning ({category.__name__})", str(message))

    return print_warning


def print_json(value: Any) -> None:
    """Print JSON to stdout; NaN and infinity, which JSON lacks, become null."""
    typer.echo(json.dumps(_plain(value), indent=2, allow_nan=False))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if hasattr(value, "tolist"):  # NumPy arrays and scalars, without importing NumPy
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def parse_component(text: str | None) -> str | int | None:
    """Turn the value of ``--component`` into what the library takes."""
    if text is None or text == "largest":
        return text
    if text.isdecimal():
        return int(text)
    raise InputError(f"--component must be largest or a number counted from 0, not {text!r}")


def read_any_map(path: str, *, base: int | None, n_target: int) -> IntArray:
    """Read the point map of a .npz match, or of any other map file."""
    from unbend.correspondence import read_match
    from unbend.io import read_map

    if not path.lower().endswith(".npz"):
        return read_map(path, base=base, n_target=n_target)
    found = read_match(path)
    if len(found.target_to_source) != n_target:
        raise InputError(
            f"{path} maps to {plural(len(found.target_to_source), 'vertex')}, but the target has "
            f"{n_target}"
        )
    return found.source_to_target


def read_truth(paths: Sequence[str], n_source: int, n_target: int) -> list[IntArray]:
    """Read source vertices whose images are known, and those images, in one or more files."""
    from unbend.io import read_map

    sources = read_map(paths[0], n_target=n_source)
    if (sources < 0).any():
        row = int((sources < 0).argmax())
        raise InputError(f"{paths[0]}: row {row} is -1, but each must be a source vertex")
    truths = [read_map(path, n_target=n_target) for path in paths[1:]]
    for path, images in zip(paths[1:], truths, strict=True):
        if len(images) != len(sources):
            raise InputError(
                f"{path} holds {plural(len(images), 'row')}, but {paths[0]} {len(sources)}; each "
                "row of the one is the image of that row of the other"
            )
    return [sources, *truths]


def write_table(path: str, rows: Iterable[Iterable[Any]]) -> None:
    """Write rows to a .csv file, which appears once it is complete."""
    import csv
    import io

    from unbend.io import atomic_write

    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    with atomic_write(path) as file:
        file.write(text.getvalue().encode())


def print_rows(rows: Mapping[str, str]) -> None:
    """Print names and values in two aligned columns to stdout."""
    width = max(map(len, rows)) + 2
    for name, value in rows.items():
        typer.echo(f"{name:<{width}}{printable(value)}")


def print_written(*paths: str | None) -> None:
    """Name the files that were written, those of options that were given, on one line."""
    if written := [printable(path) for path in paths if path is not None]:
        typer.echo(f"written: {', '.join(written)}")


@contextmanager
def steps_on_stderr() -> Iterator[Progress]:
    """Show the step that is under way on stderr, if a person is watching."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda stage, share: None
        return
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        yield lambda stage, share: status.update(f"{stage}, {share:.0%}" if share else stage)
