"""Ranking again: the best hypothesis of each match decides, then the distance."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from unbend.collection import Hit, _ranking
from unbend.collection._ranking import rank_by_match
from unbend.datasets import make_sphere
from unbend.errors import MeshError

BALL = make_sphere(1)


def test_matches_rank_by_their_best_energy_then_by_distance(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    energies = {"a": 0.3, "b": 0.1, "c": None, "d": 0.1}

    def match(query, path):
        assert query is BALL
        if energies[path] is None:
            raise MeshError("it cannot be matched")
        return SimpleNamespace(
            hypotheses=[SimpleNamespace(energy=energies[path] + i) for i in (0, 1)]
        )

    monkeypatch.setattr(_ranking, "find_file", lambda hit, store: hit.path)
    monkeypatch.setattr(_ranking, "read_mesh", lambda path: path)
    monkeypatch.setattr(_ranking, "match", match)
    told = []
    hits = [Hit(path=path, id=path, distance=4 - i) for i, path in enumerate("abcd")]
    found = rank_by_match(BALL, hits, "store", lambda *at: told.append(at))
    assert [hit.path for hit in found] == ["d", "b", "a", "c"]
    assert [hit.reranked for hit in found] == [0.1, 0.1, 0.3, math.inf]
    assert told == [(f"matching {i + 1} of 4", i / 4) for i in range(4)]
