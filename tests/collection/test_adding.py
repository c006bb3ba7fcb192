"""Adding: when rows are committed, and what is remembered of those under way."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from unbend.collection import _adding
from unbend.collection._adding import _Adding, add_files


class Kept:
    """A store that keeps ids."""

    exists = False

    def __init__(self) -> None:
        self.commits: list[list[str]] = []

    def commit(self, rows: list[dict]) -> None:
        self.commits.append([row["id"] for row in rows])

    def paths_of(self, ids: Iterable[str]) -> dict[str, list[str]]:
        kept = {one for commit in self.commits for one in commit}
        return {one: [f"path of {one}"] for one in kept.intersection(ids)}

    def copy(self, files: list[tuple[str, str]]) -> None:
        pass

    def remove(self, paths: list[str]) -> None:
        pass


def test_rows_are_committed_when_it_is_time_or_there_are_many(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now, store = [0.0], Kept()
    monkeypatch.setattr(_adding.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(_adding, "_MOST_ROWS", 3)
    adding = _Adding(store)

    def take(ids: str) -> int:
        for one in ids:
            adding.take((one, one), {"id": one, "path": one})
        adding.commit_if_due()
        return len(store.commits)

    assert take("a") == 1
    assert take("bc") == 1  # just after
    assert (adding.added, adding.computed) == (1, 3)
    now[0] = 0.25
    assert take("") == 2
    assert take("de") == 2
    assert take("f") == 3
    assert store.commits == [["a"], ["b", "c"], ["d", "e", "f"]]


def test_what_the_store_has_is_no_longer_remembered(tmp_path: Path) -> None:
    adding, paths = _Adding(Kept()), [str(tmp_path / name) for name in ("a.off", "b.off")]
    for path in paths:
        Path(path).write_text(path)
        (file,) = filter(None, adding.fresh([path, path]))  # a second time it is under way
        assert adding._under_way == {file[1]}
        adding.take(file, {"id": file[1], "path": path})
        adding.commit()
    assert (adding.added, adding.skipped) == (2, 2)


def test_workers_are_those_asked_for(tmp_path: Path, idle_engine: Callable[[object], dict]) -> None:
    asked = idle_engine(_adding)
    (tmp_path / "a.off").touch()
    where = {"workers": 3, "scheduler": "tcp://somewhere:8786"}
    add_files(Kept(), [str(tmp_path)], progress=None, **where)
    assert asked == where
