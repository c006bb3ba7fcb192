"""Matches come back as they were written; damaged archives are refused."""

import struct
import tracemalloc
import zipfile
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from unbend.correspondence import _archive, read_match, write_match
from unbend.errors import FileError
from unbend.matching import Hypothesis, Match
from unbend.mesh import Mesh

RIGHT = Match(
    source_to_target=np.array([1, 0, -1]),
    target_to_source=np.array([1, 0]),
    functional_map=np.eye(2),
    orientation=0.7,
    confidence=0.9,
    hypotheses=(Hypothesis(-2.0, 0.7), Hypothesis(-1.5, 0.4, 0.25)),
    faces=np.array([0, 0, -1]),
    weights=np.array([[1, 0, 0], [0, 1, 0], [np.nan] * 3]),
    overlap_source=0.7,
    overlap_target=0.9,
    expected_error=np.array([0.01, 0.2, np.nan]),
)
BARE = Match(np.array([0]), np.array([0]), np.eye(1), 0.0, 0.0)

SEVERAL = replace(
    RIGHT,
    alternatives=(BARE,) * 11 + (RIGHT,),
    mirror_fits=True,
    missed_landmarks=(0, 2),
    landmark_hints=(2,),
    disorder=0.25,
)


@pytest.mark.parametrize("match", [RIGHT, BARE, SEVERAL, replace(BARE, confidence=np.nan)])
def test_matches_round_trip(tmp_path: Path, match: Match) -> None:
    path = tmp_path / "match.npz"
    write_match(path, match)
    found = read_match(path)
    _assert_same(found, match)


def _assert_same(found: Match, match: Match) -> None:
    assert found.hypotheses == match.hypotheses
    for one, other in zip(found.alternatives, match.alternatives, strict=True):
        _assert_same(one, other)
    for name, value in vars(match).items():
        if name not in ("hypotheses", "alternatives"):
            np.testing.assert_array_equal(getattr(found, name), value)


def test_an_alternative_that_lacks_an_array_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "match.npz"
    write_match(path, SEVERAL)
    with np.load(path) as file:
        arrays = dict(file)
    del arrays["alternatives/3/orientation"]
    np.savez(path, **arrays)
    with pytest.raises(FileError, match=r"match\.npz: holds no alternatives/3/orientation"):
        read_match(path)


def test_what_is_no_match_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "match.npz"
    for data, sentence in ((b"PK", "damaged"), (b"", "empty")):
        path.write_bytes(data)
        with pytest.raises(FileError, match=sentence):
            read_match(path)
    np.savez(path, functional_map=np.eye(3))
    with pytest.raises(FileError, match="holds no source_to_target"):
        read_match(path)
    write_match(path, RIGHT)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(FileError, match="damaged"):
        read_match(path)
    with pytest.raises(FileError, match="unknown suffix"):
        read_match(tmp_path / "match.npy")
    with pytest.raises(FileError, match="unknown suffix"):
        write_match(tmp_path / "match.npy", RIGHT)
    assert not (tmp_path / "match.npy").exists()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("source_to_target", np.array([0.5, 0, 0])),
        ("source_to_target", np.array([-3, 0, 0])),
        ("source_to_target", np.array([1, 2, -1])),  # the target has two vertices
        ("source_to_target", np.array(["a", "b", "c"])),
        ("source_to_target", np.array([[1, 0, -1]])),
        ("source_to_target", np.empty(0, dtype=np.int64)),
        ("target_to_source", np.array([1, 3])),
        ("target_to_source", np.array([1.0, np.nan])),
        ("functional_map", np.full((2, 2), np.inf)),
        ("functional_map", np.zeros((9, 2))),  # more functions than vertices
        ("functional_map", np.array([["a"]])),
        ("confidence", np.array("high")),
        ("orientation", np.array(np.nan)),
        ("orientation", np.array(-1.5)),
        ("orientation", np.array(1.5)),
        ("confidence", np.array(1.5)),
        ("overlap_source", np.array(-0.5)),
        ("overlap_target", np.array(1.5)),
        ("disorder", np.array(2.5)),
        ("landmark_hints", np.array([3])),  # the source has three vertices
        ("hypotheses", np.array([[-2.0, 0.7, 0], [-1.0, -1.5, 0]])),
        ("hypotheses", np.array([[-2.0, 0.7, 0], [-1.0, 1.5, 0]])),
        ("area_ratio", np.array(-0.1)),
        ("area_ratio", np.array(np.inf)),
        ("hypotheses", np.zeros(3)),
        ("hypotheses", np.zeros((2, 2))),
        ("hypotheses", np.array([["a", "b"]])),
        ("hypotheses", np.array([[-2.0, 0.7, 0], [np.nan, 0.4, 0]])),
        ("faces", np.array([0, 0])),
        ("faces", np.array([0, 0, -2])),
        ("weights", np.eye(3)),  # the last row has no face
        ("weights", np.zeros(3)),
        ("weights", np.array([[1, 0, 0], [0, 1, 0]])),
        ("weights", np.array([[1, 0, 0], [0, 7, 0], [np.nan] * 3])),
        ("weights", np.array([[1, 0, 0], [np.nan] * 3, [np.nan] * 3])),
        ("weights", np.array([[1, 0, 0], [0, 1, 0], [np.nan, 0, 0]])),
        ("expected_error", np.array([0.01, 0.2])),
        ("expected_error", np.array([0.01, np.nan, np.nan])),
        ("expected_error", np.array([0.01, -0.2, np.nan])),
        ("expected_error", np.array([0.01, 0.2, 0.3])),  # the last vertex has no partner
        ("mirror_fits", np.array(1.0)),
        ("mirrored", np.array([0, 1])),
        ("mirrored", np.array([0, 1, 2])),
    ],
)
def test_wrong_arrays_are_named(tmp_path: Path, name: str, value: np.ndarray) -> None:
    _alter(tmp_path / "match.npz", name, value)
    with pytest.raises(FileError, match=rf"match\.npz: its {name}\b"):
        read_match(tmp_path / "match.npz")


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("orientation", np.zeros(3), r"float64 of shape \(3,\), not a number"),
        ("functional_map", np.zeros(3), "not a table of 2 dimensions"),
        ("weights", np.array([[1, 0, 0], [-1, 2, 0], [np.nan] * 3]), "row 1 cannot go with face 0"),
    ],
)
def test_what_is_wrong_with_an_array_is_said(
    tmp_path: Path, name: str, value: np.ndarray, sentence: str
) -> None:
    _alter(tmp_path / "match.npz", name, value)
    with pytest.raises(FileError, match=sentence):
        read_match(tmp_path / "match.npz")


@pytest.mark.parametrize("name", ["functional_map", "weights"])
def test_numbers_of_fewer_digits_are_read_as_any_other(tmp_path: Path, name: str) -> None:
    _alter(tmp_path / "match.npz", name, getattr(RIGHT, name).astype(np.float32))
    found = getattr(read_match(tmp_path / "match.npz"), name)
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, getattr(RIGHT, name))


def _alter(path: Path, name: str, value: np.ndarray | None) -> None:
    write_match(path, RIGHT)
    arrays = {**np.load(path), name: value}
    np.savez_compressed(path, **{key: one for key, one in arrays.items() if one is not None})


@pytest.mark.parametrize(("name", "other"), [("faces", "weights"), ("weights", "faces")])
def test_faces_and_weights_belong_together(tmp_path: Path, name: str, other: str) -> None:
    _alter(tmp_path / "match.npz", name, None)
    with pytest.raises(FileError, match=rf"match\.npz: its {other} .* without {name}"):
        read_match(tmp_path / "match.npz")


@pytest.mark.parametrize("name", ["source_to_target", "functional_map", "confidence", "other"])
def test_small_files_stay_small_in_memory(tmp_path: Path, name: str) -> None:
    path = tmp_path / "match.npz"
    size = 12_500_000  # 100 MB
    value = np.zeros((size // 5, 5) if name == "functional_map" else size)
    _alter(path, name, value)
    del value
    assert path.stat().st_size < 200_000
    refused = pytest.raises(FileError, match=rf"match\.npz: its {name}")
    tracemalloc.start()
    with refused if name != "other" else nullcontext():
        read_match(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10e6


def test_what_is_large_may_not_be_packed_too_small(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, many = tmp_path / "match.npz", np.zeros(200_000, dtype=np.int64)
    write_match(path, Match(many, many, np.eye(1), 0.0, 0.0))
    assert path.stat().st_size < many.nbytes / 200
    np.testing.assert_array_equal(read_match(path).source_to_target, many)  # not large
    monkeypatch.setattr(_archive, "_ALWAYS_ALLOWED", 0)
    with pytest.raises(FileError, match="its source_to_target would grow"):
        read_match(path)
    write_match(path, RIGHT)
    assert read_match(path).orientation == RIGHT.orientation


def test_a_directory_that_lies_about_a_size_is_not_believed(tmp_path: Path) -> None:
    path = tmp_path / "match.npz"
    write_match(path, RIGHT)
    whole = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        size = archive.getinfo("source_to_target.npy").file_size
    for lie in (size - 8, size + 8):
        path.write_bytes(whole.replace(struct.pack("<I", size), struct.pack("<I", lie)))
        with pytest.raises(FileError, match=r"match\.npz: "):
            read_match(path)


def test_what_numpy_would_not_write_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "match.npz"
    write_match(path, RIGHT)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for more, packing, sentence in (
        ({"functional_map": b""}, zipfile.ZIP_STORED, "two arrays of one name"),
        ({}, zipfile.ZIP_BZIP2, "is packed in a way"),
    ):
        with zipfile.ZipFile(path, "w", packing) as archive:
            for name, data in (members | more).items():
                archive.writestr(name, data)
        with pytest.raises(FileError, match=sentence):
            read_match(path)


def test_two_poses_that_are_exchanged_are_refused(tmp_path: Path) -> None:
    path, (one, other) = tmp_path / "match.npz", (Mesh(np.eye(3) * size) for size in (1, 2))
    names = {"source": Mesh(one.vertices, name="a"), "target": Mesh(other.vertices, name="b")}
    same = np.arange(3)
    write_match(path, Match(same, same, np.eye(1), 1.0, 1.0), source=one, target=other)
    assert (read_match(path, **names).source_to_target == same).all()
    with pytest.raises(FileError, match=r"match\.npz: maps a to b: exchange source and target"):
        read_match(path, source=names["target"], target=names["source"])


def test_pickles_are_never_opened(tmp_path: Path) -> None:
    _alter(tmp_path / "match.npz", "functional_map", np.array([{"a": 1}], dtype=object))
    with pytest.raises(FileError, match="not numbers or text"):
        read_match(tmp_path / "match.npz")
