"""The experiments by name."""

from collections.abc import Callable

from paper.collection import Collection
from paper.convergence import convergence
from paper.data import Data, Described
from paper.efficiency import efficiency
from paper.figure1 import figure1
from paper.figure3 import figure3
from paper.result import Result
from paper.robustness import robustness
from paper.run import Run
from paper.table1 import table1
from paper.table2 import table2
from unbend.errors import InputError

TARGETS: dict[str, Callable[[Run], Result]] = {
    "table1": table1,
    "table2": table2,
    "figure1": figure1,
    "figure3": figure3,
    "robustness": robustness,
    "efficiency": efficiency,
    "convergence": convergence,
}

# Experiments that run on SCAPE; most others run on TOSCA.
ON_SCAPE = frozenset({"table2"})
# Those that need shapes which no collection has.
_ON_OUR_OWN = {
    "efficiency": Described(
        Collection("shapes of our own", {}, {}, None),
        "shapes of our own: a walking dog, meshed at every size",
        (),
        (),
    )
}


def shapes_for(target: str, data: Data) -> Described:
    """Return the shapes that an experiment is about.

    Raises
    ------
    InputError
        With what to put where.
    """
    if target in _ON_OUR_OWN:
        return _ON_OUR_OWN[target]
    found = data.scape if target in ON_SCAPE else data.shapes
    if found is not None:
        return found
    if target in ON_SCAPE:
        raise InputError(
            f"{target} needs the shapes of SCAPE: put mesh000.off and so on into a folder SCAPE "
            "of the data folder, or give --data synthetic"
        )
    raise InputError(
        f"{target} needs the shapes of TOSCA: put cat0.off and so on into a folder TOSCA of "
        "the data folder, or give --data synthetic"
    )
