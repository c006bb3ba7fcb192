"""Words in messages."""

from __future__ import annotations


def plural(number: int, noun: str) -> str:
    """Write a number with its noun: ``1 vertex``, ``2 vertices``, ``3 faces``."""
    if number == 1:
        return f"1 {noun}"
    return f"{number} {noun.removesuffix('ex')}ices" if noun.endswith("ex") else f"{number} {noun}s"
