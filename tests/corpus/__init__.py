"""A corpus of bad input: the answer of each command to damaged and unusual files.

Every case is made by code. ``python -m tests.corpus`` runs them all and writes the answers into
``README.md`` here.
"""

from . import archives, files, places, stores, surfaces, tables
from .case import Answer, Case, Refused, try_case

CASES: tuple[Case, ...] = tuple(
    case
    for module in (files, surfaces, tables, archives, places, stores)
    for case in module.cases()
)

__all__ = ["CASES", "Answer", "Case", "Refused", "try_case"]
