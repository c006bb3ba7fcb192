"""A page holds the numbers, the figures and the command; an index lists the pages."""

import csv
import json
import math
from dataclasses import replace

from paper.collection import Collection
from paper.data import Described
from paper.page import markdown_table, write_index, write_page
from paper.result import Result
from unbend.report.figures import new_figure

DATA = Described(
    Collection("dogs", {}, {}, None), "dogs: 3 shapes", ("They are small.",), ("dog7 was not.",)
)
ROWS = [{"name": "a", "value": 0.25, "sure": True}, {"name": "b", "value": math.nan, "sure": False}]
RESULT = Result("A title", {"numbers": ROWS}, {"curve": new_figure(1, 1)}, "The text.")


def test_everything_is_written(tmp_path):
    page = write_page(tmp_path, "table9", RESULT, "python -m paper table9", DATA)
    text = page.read_text()
    assert text.startswith("# A title\n\n> Run on dogs: 3 shapes. They are small.\n\nThe text.\n")
    for words in ("![curve](curve.png)", "    python -m paper table9\n", "dog7 was not.", "numpy"):
        assert words in text
    assert (page.parent / "curve.png").read_bytes().startswith(b"\x89PNG")
    assert (page.parent / "curve.pdf").read_bytes().startswith(b"%PDF")
    with open(page.parent / "numbers.csv", newline="") as file:
        assert [row["value"] for row in csv.DictReader(file)] == ["0.25", "nan"]
    told = json.loads((page.parent / "results.json").read_text())
    assert told["tables"]["numbers"][1] == {"name": "b", "value": None, "sure": False}
    assert told["command"] == "python -m paper table9"
    assert told["left out"] == ["dog7 was not."]


def test_a_long_table_stays_in_its_file(tmp_path):
    long = replace(RESULT, tables={"numbers": ROWS * 30})
    text = write_page(tmp_path, "table9", long, "", DATA).read_text()
    assert "60 rows: [numbers.csv](numbers.csv)" in text
    assert "| a |" not in text


def test_the_index_lists_what_is_there_and_what_is_not(tmp_path):
    write_page(tmp_path, "table9", RESULT, "", DATA)
    text = write_index(tmp_path, {"table8": "there is no data"}).read_text()
    assert "| [table9](table9/) | A title |" in text
    assert "Not run: table8. There is no data." in text


def test_numbers_are_rounded_and_unknown_ones_left_blank():
    rows = markdown_table(ROWS).splitlines()
    assert rows[0] == "| name | value | sure |"
    assert rows[2:] == ["| a | 0.2500 | yes |", "| b |  | no |"]
    assert markdown_table([]) == ""
