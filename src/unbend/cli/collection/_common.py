"""What the commands on collections share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from unbend.cli._output import command_line, list_failures, shown

if TYPE_CHECKING:
    from unbend._types import FloatArray
    from unbend.choices import Axis
    from unbend.collection import Collection, Entry, Hit
    from unbend.mesh import Mesh

SHORT_ID = 12  # digits of an id that are shown


def opened(store: str, *outputs: str | None) -> Collection:
    """Open a collection that must be there, and in whose folder nothing else shall be written."""
    from unbend.collection import Collection, check_outside
    from unbend.errors import FileError

    found = Collection(store)
    if not found.exists:
        raise FileError(
            f"there is no collection at {store}: unbend collection add {store} MESHES makes one"
        )
    for out in outputs:
        if out is not None:
            check_outside(store, out)
    return found


def shown_shape(shape: Entry | Hit) -> str:
    """Show the first path of a shape, and that it has others."""
    more = f" and {len(shape.also) - 1:,} more" if len(shape.also) > 1 else ""
    return shown(shape.path) + (f" (also {shown(shape.also[0])}{more})" if shape.also else "")


def read_shown(shapes: Sequence[Entry | Hit], store: str) -> list[Mesh]:
    """Read shapes to show them, and name on stderr what cannot be read."""
    from unbend.collection import read_found
    from unbend.report.pages import check_count

    check_count(len(shapes))
    meshes, failures = read_found(shapes, store)
    list_failures(failures)
    return meshes


def write_page(
    report: str,
    store: str,
    entries: Sequence[Entry],
    distances: FloatArray,
    up: Axis,
    groups: list[int] | None = None,
) -> None:
    """Write how far shapes of a collection are from each other as a page."""
    from unbend.report.pages import similarity_page

    similarity_page(
        read_shown(entries, store),
        distances,
        report,
        measure="distance",
        groups=groups,
        up=up,
        command=command_line(),
    )
