"""Classes of the shapes of a collection, from a table."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from unbend.errors import FileError, warn
from unbend.io import read_table

_File = tuple[int, str]  # number of its shape, and path


def read_labels(table: str | os.PathLike[str], shapes: Sequence[Sequence[str]]) -> list[str | None]:
    r"""Read the class of each shape.

    Parameters
    ----------
    table : path
        A CSV file with the columns path and label, in any order and among others. A path is meant
        from the folder we are in or from the table's; where nothing is there, its end will do (as
        `cats/cat0.off`), if it is that of a single shape.
    shapes : sequence of sequence of str
        The paths of each shape; a shape has several where files are identical.

    Returns
    -------
    list of str or None
        A label for each shape; None where the table has none, or different ones for its files.

    Raises
    ------
    FileError
        If the table cannot be read or lacks a column, if a path is that of no shape or of several,
        or a file has two labels.

    Warns
    -----
    UnbendWarning
        If files of one shape have different labels.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend.collection import read_labels
    >>> table = Path(tempfile.mkdtemp()) / "labels.csv"
    >>> _ = table.write_text("path,label\ncat0.off,cat\n")
    >>> read_labels(table, [["/shapes/cat0.off", "/copies/cat0.off"], ["/shapes/dog1.off"]])
    ['cat', None]
    """
    table = Path(table)
    rows = read_table(table, ("path", "label"))
    files = {os.path.abspath(path): (i, path) for i, some in enumerate(shapes) for path in some}
    ends: dict[str, list[_File]] = {}
    for file in files.values():
        parts = Path(file[1]).parts
        for start in range(len(parts)):
            ends.setdefault("/".join(parts[start:]), []).append(file)
    labels: list[dict[str, str]] = [{} for _ in shapes]  # by path
    for line, (path, label) in enumerate(rows, start=2):
        i, path = _find(path, table, files, ends, line)
        if labels[i].setdefault(path, label) != label:
            raise FileError(
                f"{table}: line {line} calls {path} a {label}, an earlier one a {labels[i][path]}"
            )
    return [_agreed(one, table) for one in labels]


def _find(
    path: str, table: Path, files: dict[str, _File], ends: dict[str, list[_File]], line: int
) -> _File:
    for folder in (Path(), table.parent):
        absolute = os.path.abspath(folder / path)
        if absolute in files:
            return files[absolute]
    found = ends.get("/".join(Path(path).parts), [])
    if len({i for i, _ in found}) != 1:
        what = "several shapes" if found else "no shape"
        raise FileError(f"{table}: line {line}: {path} is {what} of the collection")
    return found[0]


def _agreed(labels: dict[str, str], table: Path) -> str | None:
    """Label that all files of a shape have, if there is one."""
    names: dict[str, str] = {}
    for path, label in labels.items():
        names.setdefault(label, path)
    if len(names) > 1:
        said = " and ".join(f"{path} a {label}" for label, path in names.items())
        warn(f"{table} calls {said}, but these files are identical: their shape is left out")
        return None
    return next(iter(names), None)
