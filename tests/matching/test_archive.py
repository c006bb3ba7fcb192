"""Matches and functional maps come back as they were written; damaged archives are refused."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from unbend.errors import FileError, InputError
from unbend.matching import (
    Match,
    read_functional_map,
    read_match,
    write_functional_map,
    write_match,
)
from unbend.matching._result import Hypothesis

RIGHT = Match(
    source_to_target=np.array([1, 0, -1]),
    target_to_source=np.array([1, 0]),
    functional_map=np.eye(2),
    orientation=0.7,
    residual=0.1,
    confidence=0.9,
    hypotheses=(Hypothesis(-2.0, 0.7), Hypothesis(-1.5, 0.4)),
    faces=np.array([0, 0, -1]),
    weights=np.array([[1, 0, 0], [0, 1, 0], [np.nan] * 3]),
)
BARE = Match(np.array([0]), np.array([0]), np.eye(1), 0.0, 0.0, 0.0)

tables = arrays(
    np.float64,
    array_shapes(min_dims=2, max_dims=2),
    elements=st.floats(allow_nan=False, allow_infinity=False),
)


@given(tables)
def test_functional_maps_round_trip(tmp_path_factory, table) -> None:
    path = tmp_path_factory.mktemp("maps") / "map.npz"
    write_functional_map(path, table)
    np.testing.assert_array_equal(read_functional_map(path), table)


@pytest.mark.parametrize("match", [RIGHT, BARE])
def test_matches_round_trip(tmp_path: Path, match: Match) -> None:
    path = tmp_path / "match.npz"
    write_match(path, match)
    found = read_match(path)
    assert found.hypotheses == match.hypotheses
    for name, value in vars(match).items():
        if name != "hypotheses":
            np.testing.assert_array_equal(getattr(found, name), value)
    np.testing.assert_array_equal(read_functional_map(path), match.functional_map)


def test_what_is_no_match_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "match.npz"
    for data, sentence in ((b"PK", "damaged"), (b"", "empty")):
        path.write_bytes(data)
        with pytest.raises(FileError, match=sentence):
            read_match(path)
    write_functional_map(path, np.eye(3))
    with pytest.raises(FileError, match="holds no source_to_target"):
        read_match(path)
    write_match(path, RIGHT)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(FileError, match="damaged"):
        read_match(path)
    with pytest.raises(FileError, match="unknown suffix"):
        read_match(tmp_path / "match.npy")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("source_to_target", np.array([0.5])),
        ("source_to_target", np.array([-3])),
        ("functional_map", np.zeros(3)),
        ("confidence", np.zeros(3)),
        ("weights", np.zeros(3)),
    ],
)
def test_wrong_arrays_are_named(tmp_path: Path, name: str, value: np.ndarray) -> None:
    write_match(tmp_path / "match.npz", RIGHT)
    arrays = {**np.load(tmp_path / "match.npz"), name: value}
    np.savez(tmp_path / "match.npz", **arrays)
    with pytest.raises(FileError, match=f"its {name}"):
        read_match(tmp_path / "match.npz")


def test_pickles_are_never_opened(tmp_path: Path) -> None:
    np.savez(tmp_path / "map.npz", functional_map=np.array([{"a": 1}], dtype=object))
    with pytest.raises(FileError, match="not numbers or text"):
        read_functional_map(tmp_path / "map.npz")


def test_only_functional_maps_are_written(tmp_path: Path) -> None:
    for wrong in ([1.0], [[np.nan]], np.zeros((0, 2))):
        with pytest.raises(InputError, match="table of finite numbers"):
            write_functional_map(tmp_path / "map.npz", wrong)
    assert list(tmp_path.iterdir()) == []
