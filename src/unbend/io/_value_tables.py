"""Tables of values per vertex, as people, pandas, R and spreadsheets write them."""

from __future__ import annotations

import csv
import re
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._text import plural
from unbend.errors import FileError, warn
from unbend.io.formats.contents import are_numbers, misfit, refuse_blank_rows, text_lines

_MOST_LETTERS = 1000
_SEPARATE = "write decimal points, and separate columns by commas in .csv, by blanks in .txt"
# Names of columns of vertex numbers, without blanks; pandas and R give theirs none.
_NUMBERS = ("vertex", "vertexid", "vertexindex", "pointid", "index", "id", "", "unnamed:0")


def read_table_of_values(
    data: bytes, suffix: str, n_vertices: int | None
) -> tuple[npt.NDArray[Any], list[str]]:
    """Read a .csv or .txt file's values, and the names of its columns if it has any.

    Rows that are numbered like vertices are sorted, and the numbers are left out.
    """
    every = text_lines(data, suffix[1:])
    lines = [line for line in every if re.match(r"\s*[^\s#]", line)]
    header: list[str] = []
    if suffix == ".txt":
        rows = [re.sub(r"\s#.*", "", line).split() for line in lines]
    else:
        try:
            cells = csv.reader(f"{line}\n" for line in lines)
            rows = [[word.strip() for word in row] for row in cells]
        except csv.Error as error:
            raise FileError(f"not a table in CSV: {error}") from None
        # A column's name cannot be told from words, except by the number of rows or by numbers.
        first, rest = (rows[0], rows[1:]) if rows else ([], [])
        if not are_numbers(word for word in first if word.lower() not in ("na", "n/a")) and (
            len(rows) != n_vertices
            or (not are_numbers(_filled(first)) and (len(first) > 1 or _are_numeric(rest)))
        ):
            header, rows = first, rest
    if not rows:
        return np.empty(0), []
    for i, row in enumerate(rows):
        if len(row) != len(rows[0]):
            sizes = f"row {i} has {len(row)} entries, but row 0 has {len(rows[0])}"
            raise FileError(f"{sizes}; {_SEPARATE}")
        # An array of words gives each as much room as the longest.
        if max(map(len, row)) > _MOST_LETTERS:
            raise FileError(f"row {i} holds a word of more than {_MOST_LETTERS} letters")
    if len(rows[0]) == 1 and len(rows) != n_vertices:
        refuse_blank_rows(
            every[every.index(lines[0]) + 1 :] if header else every,
            "write NA for a value that is missing, or -1 in a map",
            may_be_doubled=n_vertices is None,
        )
    if suffix == ".csv":
        _refuse_decimal_commas(header, rows)
        if len(rows[0]) > 1:
            header, rows = _by_vertex(header, rows)
    numeric = [are_numbers(row) for row in rows]
    if len(rows[0]) == 1 and any(re.fullmatch(r"0\d+", row[0]) for row in rows):
        numeric = [False]  # as a number, the label 007 would become 7
    elif not all(numeric) and _are_numeric(rows):
        rows, numeric = [_filled(row) for row in rows], [True]
    table = np.array(rows)
    if all(numeric):
        whole = all(word.lstrip("+-").isdecimal() for row in rows for word in row)
        try:
            numbers = table.astype(np.int64 if whole else np.float64)
        except OverflowError:
            large = next(i for i, row in enumerate(rows) if any(len(word) > 18 for word in row))
            problem = ", more than 64 bits can hold"
            raise misfit(f"row {large}", " ".join(rows[large]), problem) from None
        if not whole:
            _refuse_rounded(table, numbers)
        table = numbers
    elif table.shape[1] > 1:
        bad, problem = numeric.index(False), ", not numbers; keep labels in one column alone"
        problem += "; landmarks go into a .mrk.json file by unbend transfer"
        raise misfit(f"row {bad}", " ".join(rows[bad]), problem)
    else:
        words = [row[0] for row in rows]
        _refuse_numbers_as_labels(words)
        alone = words.count(words[0]) == 1 and len({*words}) < len(words)
        if alone and suffix == ".csv" and not header:
            warn(
                f"the first line, {words[0]!r}, is taken as the label of vertex 0; if it names the "
                "column, a row is missing"
            )
    return table[:, 0] if table.shape[1] == 1 else table, header


def _filled(row: list[str]) -> list[str]:
    """Write nan for missing numbers, as pandas, R and spreadsheets leave them."""
    return ["nan" if word.lower() in ("", "na", "n/a") else word for word in row]


def _are_numeric(rows: list[list[str]]) -> bool:
    """Whether each column has numbers, and else only cells where one is missing."""
    some = all(any(are_numbers([word]) for word in column) for column in zip(*rows, strict=False))
    return bool(rows) and some and all(are_numbers(_filled(row)) for row in rows)


def _in_order(rows: list[list[str]]) -> list[list[str]]:
    """Sort rows by their first word, the number of a vertex, and remove it."""
    found: dict[float | str, list[str]] = {}
    for i, (vertex, *words) in enumerate(rows):
        number = float(vertex) if are_numbers([vertex]) else vertex  # NumPy and pandas write 2.0
        if number in found:
            raise FileError(f"row {i} holds vertex {vertex[:20]!r} again")
        found[number] = words
    for i in range(len(rows)):
        if i not in found:
            raise FileError(f"holds no row of vertex {i}: all are needed, counted from 0")
    return [found[i] for i in range(len(rows))]


def _numbers_of(rows: list[list[str]], column: int) -> list[float]:
    return [float(row[column]) for row in rows if are_numbers([row[column]])]


def _by_vertex(header: list[str], rows: list[list[str]]) -> tuple[list[str], list[list[str]]]:
    """Sort rows by a column that is named like vertex numbers and holds all, and remove it."""
    names = [re.sub(r"[\s_-]", "", name.lower()) for name in header]
    if names and names[0] == "vertex":
        return header[1:], _in_order(rows)
    for i in (names.index(name) for name in _NUMBERS if name in names):
        numbers = _numbers_of(rows, i)
        from_one = list(range(1, len(rows) + 1))  # as R names rows
        if sorted(numbers) == list(range(len(rows))) or (numbers == from_one and not names[i]):
            others = [rows[at][:i] + rows[at][i + 1 :] for at in np.argsort(numbers)]
            return header[:i] + header[i + 1 :], others
        if sorted(numbers) == from_one:
            raise FileError(f"column {header[i]!r} numbers vertices from 1; count them from 0")
    if names and not names[0]:
        raise FileError("its first column has no name, and does not number the rows; leave it out")
    first = _numbers_of(rows, 0)
    every = list(range(len(rows)))
    numbered = header and header[0].endswith("_0")  # one of several of a name
    if first != every and not numbered and sorted(first) == every:
        raise FileError(
            f"its first column holds each number from 0 to {len(rows) - 1} once: name it vertex if "
            "these are vertex numbers, else put another first"
        )
    return header, rows


def _refuse_decimal_commas(header: list[str], rows: list[list[str]]) -> None:
    """Refuse columns that are the two sides of decimal commas, as far as that can be known."""
    if header and rows and len(rows[0]) != len(header):
        raise FileError(
            f"the first line names {plural(len(header), 'column')}, but row 0 holds "
            f"{','.join(rows[0])[:40]!r}; write decimal points, and a name for each column"
        )
    pairs = (",".join(row[i : i + 2]) for row in rows for i in range(0, len(row), 2))
    if header or not all(re.fullmatch(r"[+-]?\d+,\d+", pair) for pair in pairs):
        return
    for i, row in enumerate(rows):
        # No number begins with -0, or with 0 before other digits; one row tells nothing.
        if len(rows) == 1 or re.search(r"^-0,|,0\d", ",".join(row)):
            problem = ", whose commas may be decimal ones; write decimal points or column names"
            raise misfit(f"row {i}", ",".join(row), problem)


def _refuse_rounded(words: npt.NDArray[np.str_], numbers: npt.NDArray[Any]) -> None:
    """Refuse whole numbers that beside NaN or fractions become others."""
    for i, k in np.argwhere(np.abs(numbers) >= 2**53):  # floats skip numbers there
        word = str(words[i, k])
        if word.lstrip("+-").isdecimal() and int(word) != float(word):
            problem = ", which would be rounded beside NaN; begin labels with a letter"
            raise misfit(f"row {i}", word, problem)


def _refuse_numbers_as_labels(words: list[str]) -> None:
    """Refuse words like 0,5 or 1;2, which are misread numbers rather than labels."""
    for index, word in enumerate(words):
        first, *more = re.split(r"[,;\t#]", word)
        if more and are_numbers([first]):
            raise misfit(f"row {index}", word, f", neither a number nor a label; {_SEPARATE}")
