"""What the commands on collections share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from unbend.cli._output import command_line, say, shown

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


def read_found(shapes: Sequence[Entry | Hit], store: str) -> list[Mesh]:
    """Read shapes to show them; one whose file is not there any more has nothing to draw."""
    from collections import Counter
    from dataclasses import replace
    from pathlib import Path

    from unbend.collection import find_file
    from unbend.errors import UnbendError
    from unbend.io import read_mesh
    from unbend.mesh import Mesh
    from unbend.report.pages import check_count

    check_count(len(shapes))
    alike = Counter(Path(one.path).name for one in shapes)
    found = []
    for one in shapes:
        name = Path(one.path).name
        try:
            mesh = replace(read_mesh(find_file(one, store)), name=name)
        except UnbendError as error:
            say("failed", f"{shown(one.path)}: {error}")
            mesh = Mesh([[0, 0, 0]], name=name, notes=(f"not drawn: {error}",))
        found.append(mesh if alike[name] == 1 else replace(mesh, name=shown(one.path)))
    return found


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
        read_found(entries, store),
        distances,
        report,
        measure="distance",
        groups=groups,
        up=up,
        command=command_line(),
    )
