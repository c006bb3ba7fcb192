"""How results show themselves: in a line, and in a notebook as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from html import escape
from typing import Any

_LISTED = 3  # entries of a tuple that are shown


class Brief:
    """Dataclasses, made with ``repr=False``, that say of arrays and long tuples only how large."""

    def __repr__(self) -> str:
        shown = (f"{one.name}={_brief(getattr(self, one.name))}" for one in fields(self))  # type: ignore[arg-type]
        return f"{type(self).__name__}({', '.join(shown)})"


def _brief(value: Any) -> str:
    if hasattr(value, "shape") and value.shape:
        return f"<{' x '.join(map(str, value.shape))}>"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key!r}: {_brief(one)}" for key, one in value.items()) + "}"
    if isinstance(value, tuple) and len(value) > _LISTED:
        return f"<{len(value)}>"
    return repr(value)


def table(rows: Sequence[Sequence[str]], heads: Sequence[str] = ()) -> str:
    """Turn rows of plain text into a table; without heads, each row's first cell is its head."""
    top = "".join(f'<th scope="col">{escape(one)}</th>' for one in heads)
    lines = [f"<thead><tr>{top}</tr></thead>"] if heads else []
    for first, *others in rows:
        head = f"<td>{escape(first)}</td>" if heads else f'<th scope="row">{escape(first)}</th>'
        lines.append(f"<tr>{head}{''.join(f'<td>{escape(one)}</td>' for one in others)}</tr>")
    return "<table>" + "\n".join(lines) + "</table>"


MIRROR_FITS = (
    "the mirror image of the target fits better, as if one were a left hand and the other a right "
    "one: if so, mirror one (negate x and turn its faces), or match with allow_mirror=True (unbend "
    "match --allow-mirror); of one symmetric body in two mirrored poses the map may be right"
)


def where_landmarks_help(hints: Sequence[int]) -> str:
    """Name the source vertices where landmarks would help most, if there are any."""
    if not hints:
        return ""
    return f", best at source vertex {' or '.join(map(str, hints))} (counted from 0)"


def confidence_told(confidence: float) -> str:
    """Write a confidence; NaN says that nobody knows it."""
    return "not estimated" if math.isnan(confidence) else f"{confidence:.2f}"


def is_doubtful(confidence: float) -> bool:
    """Tell whether a match may well be wrong: its confidence, as it is shown, is below 0.6.

    NaN says that nobody knows.
    """
    return round(confidence, 2) < 0.6
