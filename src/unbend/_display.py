"""How results show themselves: what draws them is looked up when they are asked to."""

from __future__ import annotations

from dataclasses import fields
from importlib import import_module
from typing import Any

_LISTED = 3  # entries of a tuple that are shown


class Drawn:
    """What can be drawn, by :mod:`unbend.report.display`."""

    def plot(self) -> Any:
        """Draw this with matplotlib.

        Returns
        -------
        matplotlib.figure.Figure
            Notebooks show it; ``savefig`` writes it.

        Raises
        ------
        MissingExtraError
            If matplotlib is not installed.
        """
        return import_module("unbend.report.display").figure_of(self)

    def _repr_html_(self) -> str:
        """Show this in a notebook."""
        html: str = import_module("unbend.report.display").html_of(self)
        return html


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
