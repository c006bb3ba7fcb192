"""The experiments by name."""

from __future__ import annotations

from collections.abc import Callable

from unbend.errors import InputError
from unbend.reproduce.result import Result
from unbend.reproduce.run import Run
from unbend.reproduce.table2 import table2

TARGETS: dict[str, Callable[[Run], Result]] = {
    "table2": table2,
}

# Experiments that run on SCAPE; all others run on TOSCA.
ON_SCAPE = frozenset({"table2"})


def check_shapes(target: str, run: Run) -> None:
    """Refuse an experiment whose shapes are not there.

    Raises
    ------
    InputError
        With what to put where.
    """
    if target in ON_SCAPE and run.scape is None:
        raise InputError(
            f"{target} needs the shapes of SCAPE: put mesh000.off and so on into a folder SCAPE "
            "of the data folder, or give --data synthetic"
        )
    if target not in ON_SCAPE and not len(run.shapes):
        raise InputError(
            f"{target} needs the shapes of TOSCA: put cat0.off and so on into a folder TOSCA of "
            "the data folder, or give --data synthetic"
        )
