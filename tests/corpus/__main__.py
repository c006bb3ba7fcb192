"""Run every case and write the table into ``README.md``: ``python -m tests.corpus``."""

import re
import tempfile
from pathlib import Path

from . import CASES, try_case

PAGE = Path(__file__).parent / "README.md"
HEAD = """\
# Bad input

The answers of the command line to damaged and unusual files. Each case is made by code in
`tests/corpus` and run by the tests: the first file of a kind through every command that reads such
a file, the others through two of them in turn, for all call the same reader. A case ends in one of
two ways: with a result, which is compared with that of the repaired mesh, or with exit code 2 and
one sentence that names the file and the problem. There is no traceback and no hang, no file is
half-written, and no command uses more memory than the file accounts for.

This page is written by `python -m tests.corpus`.

| case | expected | seen |
| --- | --- | --- |
"""


def main() -> None:
    """Write the page; what goes wrong is raised."""
    rows = []
    for case in CASES:
        with tempfile.TemporaryDirectory() as folder:
            seen = try_case(case, Path(folder))
        rows.append(" | ".join(map(_cell, (case.name, str(case.expected), seen))))
    PAGE.write_text(HEAD + "".join(f"| {row} |\n" for row in rows))
    print(f"{len(rows)} cases, written to {PAGE}")


# The folders that cases are made in, which are others each time.
_FOLDERS = re.compile(rf"/?{re.escape(tempfile.gettempdir().strip('/'))}/\w+/(given/)?")


def _cell(text: str) -> str:
    text = _FOLDERS.sub("", text)
    return text.replace("|", "\\|").replace("<", "&lt;")


main()
