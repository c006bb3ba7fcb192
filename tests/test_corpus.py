"""Bad input gets the right answer or one sentence: never a traceback, a hang or half a file."""

import re
import stat
from pathlib import Path

import pytest

from corpus import CASES, Case, try_case

TABLE = Path(__file__).parent / "corpus" / "README.md"


@pytest.mark.parametrize("case", CASES, ids=lambda case: re.sub(r"[^\w.]+", "-", case.name))
def test_case(case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A case needs no way through the folders above and opens none."""
    folders = [tmp_path / "above", tmp_path / "here"]
    for folder in folders:
        folder.mkdir()
        folder.chmod(0o700)
    monkeypatch.chdir(folders[1])
    (folders[0] / "case").mkdir()
    try_case(case, folders[0] / "case")
    assert [stat.S_IMODE(folder.stat().st_mode) for folder in folders] == [0o700, 0o700]


def test_no_two_cases_have_one_name() -> None:
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names)


def test_the_table_has_every_case() -> None:
    told = [line.split(" | ")[0].removeprefix("| ") for line in TABLE.read_text().splitlines()]
    assert [name for name in told if name in {case.name for case in CASES}] == [
        case.name for case in CASES
    ]
