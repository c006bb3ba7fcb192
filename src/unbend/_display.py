"""How results show themselves: what draws them is looked up when they are asked to."""

from __future__ import annotations

from importlib import import_module
from typing import Any


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
