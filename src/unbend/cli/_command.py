"""How functions become commands: groups of them, and the options that all have."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any, get_type_hints

import typer

from unbend.cli._output import begin

Function = Callable[..., None]

_JsonOption = Annotated[
    bool,
    typer.Option(
        "--json",
        help="Print one JSON object to standard output; besides the result it has the files that "
        "were written, the warnings, and the seconds that it took.",
    ),
]
_QuietOption = Annotated[
    bool,
    typer.Option(
        "--quiet", "-q", help="No progress, notes or hints; only results, warnings and errors."
    ),
]


def make_group(help: str, *functions: Function, **options: Any) -> typer.Typer:
    """Make a command of each function, named like it."""
    app = typer.Typer(
        help=help,
        no_args_is_help=True,
        rich_markup_mode=None,  # plain help: rich would double the time it takes
        context_settings={"help_option_names": ["-h", "--help"]},
        **options,
    )
    for function in functions:
        app.command(function.__name__.rstrip("_"))(_command(function))
    return app


def _command(function: Function) -> Function:
    """Add --json and --quiet to a function, and keep the lines of its examples apart."""

    @functools.wraps(function)
    def run(*, as_json: bool, quiet: bool, **given: Any) -> None:
        begin(as_json, quiet)
        function(**given)

    options = {"as_json": _JsonOption, "quiet": _QuietOption}
    hints = get_type_hints(function, include_extras=True)
    own = inspect.signature(function).parameters.values()
    parameters = [one.replace(annotation=hints[one.name]) for one in own]
    kind = inspect.Parameter.KEYWORD_ONLY
    for name, hint in options.items():
        parameters.append(inspect.Parameter(name, kind, default=False, annotation=hint))
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = hints | options
    text = (function.__doc__ or "").replace("    --------\n", "")
    run.__doc__ = text.replace("    Examples\n", "    \b\n    Examples:\n")
    return run
