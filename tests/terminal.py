"""The command line in this process, made once: that takes longer than most commands."""

import functools
from collections.abc import Iterable
from typing import Any
from unittest.mock import patch

import typer.main
import typer.testing

from unbend.cli import app


@functools.cache
def command_line() -> Any:
    return typer.main.get_command(app)


def invoke(words: Iterable[object]) -> Any:
    """Run a command, and give its exit code and what it said."""
    with patch.object(typer.testing, "_get_command", lambda _: command_line()):
        return typer.testing.CliRunner().invoke(app, [*map(str, words)])
