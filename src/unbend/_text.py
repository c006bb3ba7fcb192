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


def gib(n_bytes: float) -> str:
    """Write a size: ``2.0 GiB``, or ``3 MiB`` where tenths of a GiB say nothing."""
    size = n_bytes / 2**30
    return f"{size:,.1f} GiB" if size >= 0.1 else f"{size * 1024:.0f} MiB"


def quoted(*words: str) -> str:
    """Put words together as this system's shell takes them."""
    shown = [printable(word) for word in words]
    if sys.platform == "win32":
        from subprocess import list2cmdline

        return list2cmdline(shown)
    return shlex.join(shown)
