"""What commands share: options, messages on stderr, rows and JSON on stdout."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, Any

import typer

from unbend.choices import LaplacianKind
from unbend.errors import InputError, UnbendWarning

EXIT_REFUSED = 2

MeshArgument = Annotated[
    str, typer.Argument(metavar="MESH", help="A .off, .obj, .ply, .stl, .xyz or .npy file.")
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
    typer.Option("--laplacian", help="auto: robust where faces or edges are out of order."),
]
TimeOption = Annotated[
    float, typer.Option("--time", help="Diffusion time, in units of the mesh's area.")
]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of whatever is left to chance.")]
CacheOption = Annotated[
    bool, typer.Option("--cache/--no-cache", help="Keep eigenpairs on disk for the next time.")
]


def say(kind: str, sentence: str) -> None:
    """Print one line such as ``error: ...`` to stderr, where it cannot spoil piped output."""
    typer.echo(f"{kind}: {sentence}", err=True)


def print_notes(notes: Iterable[str]) -> None:
    """Print what was done to the input, one line each, to stderr."""
    for note in notes:
        say("note", note)


def print_warning(message: Warning | str, category: type[Warning], *_: Any) -> None:
    """Print a warning without the line of code it came from: users did not write that code."""
    kind = "warning" if issubclass(category, UnbendWarning) else f"warning ({category.__name__})"
    say(kind, str(message))


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


def print_rows(rows: Mapping[str, str]) -> None:
    """Print names and values in two aligned columns to stdout."""
    width = max(map(len, rows)) + 2
    for name, value in rows.items():
        typer.echo(f"{name:<{width}}{value}")


@contextmanager
def steps_on_stderr() -> Iterator[Callable[[str], None]]:
    """Show the step that is under way on stderr, if a person is watching."""
    if not sys.stderr.isatty():
        yield lambda name: None
        return
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        yield lambda name: status.update(f"{name} ...")
