"""Poses above their forms: what is measured, and how the forms stand."""

from dataclasses import replace

import numpy as np
import pytest

from paper.collection import Collection
from paper.drawing import upright
from paper.figure1 import KINDS, figure1, some_classes, turned
from paper.result import Result
from paper.run import Run
from unbend.errors import InputError


@pytest.fixture(scope="module")
def result(run: Run) -> Result:
    return figure1(run)


def test_poses_differ_and_their_forms_hardly(result):
    rows = result.tables["all_pairs"]
    assert [(row["first"], row["second"]) for row in rows] == [("dog0", "dog1"), ("dog0", "dog2")]
    for row in rows:
        assert 0 < row["biharmonic, exact"] < 0.4 * row["in space"]
        assert 0 < row["S-MDS"] < row["in space"]


def test_the_page_sums_the_pairs_up(result):
    (row,) = result.tables["differences"]
    for label in ("in space", *KINDS):
        values = [pair[label] for pair in result.tables["all_pairs"]]
        assert row[f"{label}, mean"] == pytest.approx(np.mean(values))
        assert row[f"{label}, most"] == max(values)
    assert f"biharmonic forms {row['biharmonic, exact, mean']:.3f}" in result.text
    assert "they are lower for dog." in result.text
    assert set(result.figures) == {"dog"}
    assert len(result.figures["dog"].axes) == 9


def test_forms_of_two_poses_stand_alike(run):
    standing = upright(run.shapes, "dog0").vertices
    for kind in KINDS.values():
        one, other = (turned(run, standing, ("dog0", name), kind) for name in ("dog0", "dog1"))
        assert np.linalg.norm(one - other) < 0.3 * np.linalg.norm(one - one.mean(axis=0))
        # As the shape does: the axis of most extent points the same way.
        longest = np.ptp(standing, axis=0).argmax()
        assert np.corrcoef(one[:, longest], standing[:, longest])[0, 1] > 0.5


def test_the_papers_classes_come_first(run, tmp_path):
    kinds = ("ape", "ape", "bat", "bat", "gorilla", "gorilla", "wolf", "wolf", "yak")
    names = {f"{kind}{i}": kind for i, kind in enumerate(kinds)}
    files = {name: tmp_path / f"{name}.off" for name in names}
    many = replace(run, shapes=Collection("many", names, files, None))
    assert list(some_classes(many)) == ["wolf", "gorilla"]
    assert list(some_classes(replace(many, quick=False))) == ["wolf", "gorilla", "ape", "bat"]
    alone = Collection("one", {"yak0": "yak"}, {}, None)
    with pytest.raises(InputError, match="two poses"):
        some_classes(replace(run, shapes=alone))
