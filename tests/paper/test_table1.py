"""The percentages, columns and verdicts of Table 1, from errors that are known."""

import numpy as np
import pytest

from paper import table1 as module
from paper.collection import Collection
from paper.correspondences import ALTERNATIVES, FORMS, METHODS, PROGRESSIVE, label_of
from paper.run import Run
from paper.table1 import table1
from unbend.errors import InputError

KINDS = {"cat0": "cat", "cat1": "cat", "cat2": "cat", "cat3": "cat", "david0": "david",
         "david1": "david", "wolf0": "wolf"}  # fmt: skip
SHAPES = Collection("TOSCA", KINDS, {}, None)


def make_run(tmp_path, quick: bool = False) -> Run:
    return Run(SHAPES, None, quick, 1, tmp_path, lambda step: None)


def judged(run, pairs, n_rows, progressive=0.01):
    """Progressive as given, but 0.12 for the second cat; all others 0.03 and 0.3 by halves."""
    found = []
    for _, target in pairs:
        rest = np.repeat([0.03, 0.3], n_rows // 2)
        labels = [label_of(name, way) for name in FORMS for way in ("", *ALTERNATIVES)]
        one = dict.fromkeys(labels, rest)
        one[PROGRESSIVE] = np.full(n_rows, 0.12 if target == "cat2" else progressive)
        one |= {f"{method} seconds": np.array(1.0) for method in METHODS}
        found.append(one | {"confidence": np.array(0.9)})
    return found


def test_each_first_pose_is_paired_with_every_other(tmp_path, monkeypatch):
    asked = []

    def judge_all(run, pairs, n_rows):
        asked.append((pairs, n_rows))
        return judged(run, pairs, n_rows)

    monkeypatch.setattr(module, "judge_all", judge_all)
    table1(make_run(tmp_path))
    table1(make_run(tmp_path, quick=True))
    cats = [("cat0", "cat1"), ("cat0", "cat2"), ("cat0", "cat3")]
    assert asked[0] == ([*cats, ("david0", "david1")], 500)
    assert asked[1] == ([*cats[:2], ("david0", "david1")], 200)


def test_columns_hold_the_shares_of_their_pairs(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "judge_all", judged)
    result = table1(make_run(tmp_path))
    shares = {(row["shapes"], row["method"]): row for row in result.tables["summary"]}
    assert shares["animals", "the paper's S-MDS"]["<= 0.1, %"] == 67.38
    assert shares["all", "S-MDS"]["<= 0.05, %"] == 50
    assert shares["humans", PROGRESSIVE]["<= 0.025, %"] == 100
    assert shares["all", PROGRESSIVE]["<= 0.1, %"] == 75
    assert shares["animals", PROGRESSIVE]["mean error"] == pytest.approx((0.01 * 2 + 0.12) / 3)
    assert {row["shapes"] for row in result.tables["classes"]} == {"cat", "david"}
    worst = result.tables["pairs"][0]
    assert (worst["target"], worst[f"{PROGRESSIVE}, mean error"]) == ("cat2", pytest.approx(0.12))
    curve = next(row for row in result.tables["curves"] if row["method"] == PROGRESSIVE)
    assert (curve["0"], curve["0.0125"], curve["0.2"]) == (0, pytest.approx(200 / 3), 100)
    assert set(result.figures) == {"figure2", "figure2_classes", "alternatives"}


def test_the_verdict_follows_the_figures(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "judge_all", judged)
    text = table1(make_run(tmp_path)).text
    assert "- **humans**: above the paper's from 0.025 to 0.1" in text
    assert "- **animals**: not everywhere above the paper's" in text
    assert "at 99.5 % or more from 0.15 on (100.00 % within 0.15" in text
    assert "- cat0 to cat2: mean error 0.1200, confidence 0.90" in text
    monkeypatch.setattr(module, "judge_all", lambda *args: judged(*args, progressive=0.16))
    text = table1(make_run(tmp_path)).text
    assert "- **humans**: not everywhere above the paper's" in text
    assert "not at 99.5 % or more from 0.15 on (0.00 % within 0.15, 100.00 % within 0.2)" in text
    assert "biharmonic, sampled, all: does not agree with the paper's" in text
    assert "below the paper's at 0.025, 0.05, 0.1, 0.15, 0.2" in text


def test_single_shapes_make_no_table(tmp_path):
    alone = Collection("TOSCA", {"cat0": "cat"}, {}, None)
    with pytest.raises(InputError, match="two shapes of a class"):
        table1(Run(alone, None, False, 1, tmp_path, print))
