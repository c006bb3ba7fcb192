"""What the commands on collections share."""

from __future__ import annotations

from collections.abc import Sequence

import unbend
from unbend.cli._output import list_failures
from unbend.errors import FileError

SHORT_ID = 12  # digits of an id that are shown


def opened(store: str, *outputs: str | None) -> unbend.collection.Collection:
    """Open a collection that must be there, and in whose folder nothing else shall be written."""
    found = unbend.collection.Collection(store)
    if not found.exists:
        raise FileError(
            f"there is no collection at {store}: unbend collection add {store} MESHES makes one"
        )
    for out in outputs:
        if out is not None:
            unbend.collection.check_outside(store, out)
    return found


def read_shown(
    shapes: Sequence[unbend.collection.Entry | unbend.collection.Hit], store: str
) -> list[unbend.Mesh]:
    """Read shapes to show them, and name on stderr what cannot be read."""
    unbend.report.check_count(len(shapes))
    meshes, failures = unbend.collection.read_found(shapes, store)
    list_failures(failures)
    return meshes
