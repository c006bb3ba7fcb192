"""Reading and writing tables of text and numbers (.csv)."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from unbend.errors import FileError
from unbend.io._files import atomic_write, read_bytes


def read_table(path: str | os.PathLike[str], columns: Sequence[str]) -> list[list[str]]:
    """Read the values of these columns, in any order and among others; the first line names them.

    Row i is line i + 2 of a file without empty lines. Raises FileError if the file cannot be read,
    or lacks a column or a value.
    """
    path = Path(path)
    data = read_bytes(path, (".csv", ".txt"))
    try:
        reader = csv.DictReader(
            io.StringIO(data.decode("utf-8-sig"), newline=""), skipinitialspace=True
        )
        for name in columns:
            if name not in (reader.fieldnames or ()):
                raise FileError(
                    f"{path}: there is no column {name}; the first line must name the columns "
                    f"{', '.join(columns)}"
                )
        rows = [[row[name] for name in columns] for row in reader]
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"cannot read {path}: {error}") from None
    for line, row in enumerate(rows, start=2):
        for name, value in zip(columns, row, strict=True):
            if not value:
                raise FileError(f"{path}: line {line} has no {name}")
    return rows


def write_table(
    path: str | os.PathLike[str], rows: Iterable[Iterable[Any]], *, quote_all: bool = False
) -> None:
    """Write rows, the first being the names of the columns; the file appears once complete."""
    with atomic_write(path) as file:
        text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
        options: dict[str, Any] = {"quoting": csv.QUOTE_ALL} if quote_all else {}
        csv.writer(text, lineterminator="\n", **options).writerows(rows)
        text.detach()
