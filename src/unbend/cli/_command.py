"""How functions become commands: groups of them, and the options that all have."""

from __future__ import annotations

import copy
import inspect
import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer

from unbend.cli._options import HELP, keep_what_is_given
from unbend.cli._output import begin


def make_group(help: str, *functions: Callable[..., None], **options: Any) -> typer.Typer:
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


def _command(function: Callable[..., None]) -> Callable[..., None]:
    """Add --json and --quiet to a function; its docstring, or `HELP`, has the help of its options.

    A parameter that is a dataclass stands for the options that are its fields.
    """
    defaults: dict[str, Any] = {}
    hints: dict[str, Any] = {}
    groups: dict[str, Any] = {}
    own = get_type_hints(function, include_extras=True)
    for name, one in inspect.signature(function).parameters.items():
        if is_dataclass(own[name]):
            groups[name] = own[name]
            defaults |= {each.name: each.default for each in fields(own[name])}
            hints |= get_type_hints(own[name], include_extras=True)
        else:
            defaults[name], hints[name] = one.default, own[name]
    text, _, examples = (function.__doc__ or "").partition("    Examples\n    --------\n")
    text, _, options = text.partition("    Options\n    -------\n")
    about = HELP | dict(re.findall(r"^ {6}(\w+): (.*(?:\n {10}.*)*)", options, re.MULTILINE))
    defaults |= {"as_json": False, "quiet": False}
    hints["as_json"] = Annotated[bool, typer.Option("--json")]
    hints["quiet"] = Annotated[bool, typer.Option("--quiet", "-q")]
    for name, hint in hints.items():
        kind, option = hint, typer.Option()
        if get_origin(hint) is Annotated:
            kind, option = get_args(hint)
        elif defaults[name] is inspect.Parameter.empty:
            option = typer.Argument(metavar=name.upper())
        option = copy.copy(option)  # which other commands may share
        option.help = " ".join(about[name].split())
        hints[name] = Annotated[kind, option]

    def run(*, ctx: typer.Context, as_json: bool, quiet: bool, **given: Any) -> None:
        begin(as_json, quiet)
        keep_what_is_given(ctx)
        for name, group in groups.items():
            given[name] = group(**{each.name: given.pop(each.name) for each in fields(group)})
        function(**given)

    run.__name__, run.__annotations__ = function.__name__, hints
    run.__doc__ = f"{text}    \b\n    Examples:\n{examples}"
    kind = inspect.Parameter.KEYWORD_ONLY
    parameters = [inspect.Parameter("ctx", kind, annotation=typer.Context)]
    parameters += [
        inspect.Parameter(name, kind, default=default, annotation=hints[name])
        for name, default in defaults.items()
    ]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run
