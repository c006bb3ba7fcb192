"""Classes of the shapes of a collection, from a table."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from pathlib import Path

from unbend.errors import FileError
from unbend.io import read_bytes

_COLUMNS = "path", "label"


def read_labels(table: str | os.PathLike[str], paths: Sequence[str]) -> list[str | None]:
    r"""Read the class of each shape.

    Parameters
    ----------
    table : path
        A CSV file with the columns path and label, in any order and among others. A path is meant
        from the folder we are in or from the table's; where nothing is there, its end will do (as
        `cats/cat0.off`), if it is that of a single shape.
    paths : sequence of str
        Of the shapes.

    Returns
    -------
    list of str or None
        A label for each path; None where the table has none.

    Raises
    ------
    FileError
        If the table cannot be read or lacks a column, if a path is that of no shape or of several,
        or a shape has two labels.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend.collection import read_labels
    >>> table = Path(tempfile.mkdtemp()) / "labels.csv"
    >>> _ = table.write_text("path,label\ncat0.off,cat\n")
    >>> read_labels(table, ["/shapes/cat0.off", "/shapes/dog1.off"])
    ['cat', None]
    """
    table = Path(table)
    data = read_bytes(table, ())
    try:
        reader = csv.DictReader(io.StringIO(data.decode("utf-8-sig"), newline=""))
        missing = [name for name in _COLUMNS if name not in (reader.fieldnames or ())]
        rows = [] if missing else [(row["path"], row["label"]) for row in reader]
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"cannot read {table}: {error}") from None
    if missing:
        raise FileError(f"{table}: there is no column {missing[0]}; it needs path and label")
    number = {os.path.abspath(path): i for i, path in enumerate(paths)}
    ends: dict[str, list[int]] = {}
    for i, path in enumerate(paths):
        parts = Path(path).parts
        for start in range(len(parts)):
            ends.setdefault("/".join(parts[start:]), []).append(i)
    labels: list[str | None] = [None] * len(paths)
    for line, (path, label) in enumerate(rows, start=2):
        if not path or not label:
            raise FileError(f"{table}: line {line} lacks a path or a label")
        i = _find(path, table, number, ends, line)
        if labels[i] not in (None, label):
            raise FileError(
                f"{table}: line {line} calls {paths[i]} a {label}, an earlier one a {labels[i]}"
            )
        labels[i] = label
    return labels


def _find(
    path: str, table: Path, number: dict[str, int], ends: dict[str, list[int]], line: int
) -> int:
    for folder in (Path(), table.parent):
        absolute = os.path.abspath(folder / path)
        if absolute in number:
            return number[absolute]
    found = ends.get("/".join(Path(path).parts), [])
    if len(found) != 1:
        what = "several shapes" if found else "no shape"
        raise FileError(f"{table}: line {line}: {path} is {what} of the collection")
    return found[0]
