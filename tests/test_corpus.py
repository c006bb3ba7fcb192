"""Bad input gets the right answer or one sentence: never a traceback, a hang or half a file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from corpus import CASES, Case, try_case

TABLE = Path(__file__).parents[1] / "docs" / "bad-input.md"


@pytest.mark.parametrize("case", CASES, ids=lambda case: re.sub(r"[^\w.]+", "-", case.name))
def test_case(case: Case, tmp_path: Path) -> None:
    try_case(case, tmp_path)


def test_no_two_cases_have_one_name() -> None:
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names)


def test_the_table_has_every_case() -> None:
    told = [line.split(" | ")[0].removeprefix("| ") for line in TABLE.read_text().splitlines()]
    assert [name for name in told if name in {case.name for case in CASES}] == [
        case.name for case in CASES
    ]
