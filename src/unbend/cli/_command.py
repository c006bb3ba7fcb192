"""How functions become commands: groups of them, their help, and the options that all have."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import is_dataclass
from inspect import Parameter, Signature, signature
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from unbend.cli._options import HELP, check_files
from unbend.cli._output import begin, end_progress
from unbend.errors import InputError


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
        app.command(function.__name__.rstrip("_"), cls=_Command)(_with_common_options(function))
    return app


class _Command(TyperCommand):
    """A command whose docstring has examples, and the help of its options that is not in `HELP`."""

    def __init__(self, *, help: str, **settings: Any) -> None:
        text, *examples = help.split("\n$ ")
        text, *options = re.split(r"\n {2}(\w+): ", text)
        about = HELP | dict(zip(options[::2], options[1::2], strict=True))
        lines = "".join(f"\n  {one}" for one in examples)
        super().__init__(help=f"{text}\n\b\nExamples:{lines}", **settings)
        params: list[Any] = self.params
        for one in params:
            one.help = " ".join(about[one.name].split())
            if one.param_type_name == "argument" and one.metavar is None:
                one.metavar = one.name.upper()


def _with_common_options(function: Callable[..., None]) -> Callable[..., None]:
    """Add --json and --quiet; a parameter that is a dataclass stands for the options in it."""
    own = signature(function, eval_str=True).parameters
    groups = {
        name: signature(one.annotation, eval_str=True).parameters
        for name, one in own.items()
        if isinstance(one.annotation, type) and is_dataclass(one.annotation)
    }

    def run(
        ctx: typer.Context,
        as_json: Annotated[bool, typer.Option("--json")] = False,
        quiet: Annotated[bool, typer.Option("--quiet", "-q")] = False,
        **given: Any,
    ) -> None:
        begin(as_json, quiet)
        check_files(given)
        pictures = [given[name] for name in ("figure", "report") if name in given]
        up = ctx.get_parameter_source("up")
        if pictures and not any(pictures) and up is not None and up.name == "COMMANDLINE":
            options = " or ".join(f"--{name}" for name in ("report", "figure") if name in given)
            raise InputError(
                f"--up is for pictures, and none is drawn; leave it out, or add {options}"
            )
        ctx.call_on_close(end_progress)
        for name, fields in groups.items():
            given[name] = own[name].annotation(**{field: given.pop(field) for field in fields})
        function(**given)

    ctx, *common, _ = signature(run, eval_str=True).parameters.values()
    chosen = [each for name, one in own.items() for each in groups.get(name, {name: one}).values()]
    every = [one.replace(kind=Parameter.KEYWORD_ONLY) for one in (ctx, *chosen, *common)]
    run.__name__, run.__doc__ = function.__name__, function.__doc__
    run.__annotations__ = {one.name: one.annotation for one in every}
    run.__signature__ = Signature(every)  # type: ignore[attr-defined]
    return run
