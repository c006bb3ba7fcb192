"""Finished pieces are kept and not made again, in one process or several."""

from pathlib import Path

import numpy as np
import pytest

from counting import count
from paper.collection import Collection
from paper.run import Run, everywhere, kept, piece
from unbend.errors import InputError

NOTHING = Collection("nothing", {}, {}, None)


def make_run(folder: Path, jobs: int = 1) -> Run:
    return Run(NOTHING, None, True, jobs, folder / "store", lambda step: None)


def test_what_is_kept_is_not_computed_again(tmp_path):
    run, log = make_run(tmp_path), tmp_path / "log"
    jobs = [(log, name, 2) for name in ("cat", "horse")]
    first = everywhere(run, count, jobs)
    again = everywhere(run, count, [*jobs, (log, "wolf", 2), (log, "cat", 3)])
    assert [one["value"].item() for one in first] == [9, 25]
    assert [one["value"].item() for one in again] == [9, 25, 16, 27]
    assert log.read_text().split() == ["cat", "horse", "wolf", "cat"]


def test_an_error_leaves_what_was_finished(tmp_path):
    run, log = make_run(tmp_path), tmp_path / "log"
    with pytest.raises(InputError, match="a bad one"):
        everywhere(run, count, [(log, "cat", 1), (log, "bad", 1), (log, "dog", 1)])
    everywhere(run, count, [(log, "cat", 1), (log, "dog", 1)])
    assert log.read_text().split() == ["cat", "bad", "dog"]


def test_several_processes_find_the_same(tmp_path):
    log = tmp_path / "log"
    jobs = [(log, "x" * n, 2) for n in range(1, 5)]
    found = everywhere(make_run(tmp_path, jobs=2), count, jobs)
    assert [one["value"].item() for one in found] == [1, 4, 9, 16]
    assert sorted(log.read_text().split()) == ["x", "xx", "xxx", "xxxx"]
    with pytest.raises(InputError, match="a bad one"):
        everywhere(make_run(tmp_path, jobs=2), count, [(log, "bad", 1), (log, "y", 1)])


def test_a_damaged_piece_is_made_again(tmp_path):
    kept(tmp_path, "one", lambda: {"x": np.ones(3)})
    (tmp_path / "one.npz").write_bytes(b"PK damaged")
    assert kept(tmp_path, "one", lambda: {"x": np.zeros(3)})["x"].tolist() == [0, 0, 0]
    assert kept(tmp_path, "one", lambda: {"x": np.ones(3)})["x"].tolist() == [0, 0, 0]


def test_names_of_pieces_tell_numbers_and_words_apart(tmp_path):
    log = tmp_path / "log"
    for power in (1, 2):
        assert piece(tmp_path, count, log, "a/b", power)["value"].item() == 3**power
    assert len(list(tmp_path.glob("*.npz"))) == 2
