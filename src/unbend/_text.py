"""Words in messages."""

from __future__ import annotations

import shlex
import sys


def printable(text: str) -> str:
    """Write what does not print as an escape: a file's name may hold line breaks and worse."""
    return "".join(one if one.isprintable() else repr(one)[1:-1] for one in text)


def plural(number: int, noun: str) -> str:
    """Write a number with its noun: ``1 vertex``, ``2,000 vertices``, ``3 faces``."""
    if number != 1:
        noun = f"{noun.removesuffix('ex')}ices" if noun.endswith("ex") else f"{noun}s"
    return f"{number:,} {noun}"


def quoted(*words: str) -> str:
    """Put words together as this system's shell takes them."""
    shown = [printable(word) for word in words]
    if sys.platform == "win32":
        from subprocess import list2cmdline

        return list2cmdline(shown)
    return shlex.join(shown)
