"""Every command of the command line."""

from collections.abc import Iterator
from typing import Any

from terminal import command_line


def every_command(
    group: Any = None, words: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Give every command with the words that call it."""
    for name, one in (group or command_line()).commands.items():
        if hasattr(one, "commands"):
            yield from every_command(one, (*words, name))
        else:
            yield (*words, name), one
