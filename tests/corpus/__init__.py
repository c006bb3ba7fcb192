"""A corpus of bad input: what each command makes of files that are not as they should be.

Every case is made by code. ``python -m tests.corpus`` runs them all and writes what was seen into
``docs/bad-input.md``.
"""

from __future__ import annotations

from . import archives, files, places, stores, surfaces, tables
from .case import Answer, Case, Refused, try_case

CASES: tuple[Case, ...] = tuple(
    case
    for module in (files, surfaces, tables, archives, places, stores)
    for case in module.cases()
)

__all__ = ["CASES", "Answer", "Case", "Refused", "try_case"]
