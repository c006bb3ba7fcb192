"""Maps keep every number through every format, and what a file cannot mean is refused."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.errors import FileError, InputError
from unbend.io import (
    MAP_SUFFIXES,
    invert_map,
    read_landmarks,
    read_map,
    refuse_other_base,
    roughness,
    straight_error,
    write_map,
)

images = arrays(np.int64, st.integers(1, 30), elements=st.integers(-1, 2**40))


@given(images, st.sampled_from(MAP_SUFFIXES), st.sampled_from([None, 0, 1]))
def test_round_trip(tmp_path_factory, point_map, suffix, base) -> None:
    path = tmp_path_factory.mktemp("maps") / f"map{suffix}"
    write_map(path, point_map, base=base)
    np.testing.assert_array_equal(read_map(path, base=base), point_map)


@pytest.mark.parametrize(("suffix", "base"), [(".npy", 0), (".txt", 0), (".csv", 0), (".vts", 1)])
def test_each_format_has_its_base(tmp_path: Path, suffix: str, base: int) -> None:
    path = tmp_path / f"map{suffix}"
    write_map(path, [0, -1, 7])
    np.testing.assert_array_equal(read_map(path, base=base), [0, -1, 7])
    np.testing.assert_array_equal(read_map(path, base=0), [base, -1, 7 + base])


def test_numbers_of_other_programs(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("# from elsewhere\r\n 3 \r\n\r\n1.0000e+00\r\n")
    np.testing.assert_array_equal(read_map(tmp_path / "a.txt"), [3, 1])
    (tmp_path / "a.csv").write_text('"vertex"\n3\n0\n')
    np.testing.assert_array_equal(read_map(tmp_path / "a.csv"), [3, 0])
    for names, first in (('"","x"', 1), (",x", 0), ("vertex,x", 0)):  # of rows: R, pandas
        (tmp_path / "a.csv").write_text(f'{names}\n"{first}",3\n"{first + 1}",-1\n')
        np.testing.assert_array_equal(read_map(tmp_path / "a.csv"), [3, -1])
    np.save(tmp_path / "a.npy", np.array([2.0, -1.0], np.float32))
    np.testing.assert_array_equal(read_map(tmp_path / "a.npy"), [2, -1])


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("a.txt", "", "a.txt is empty"),
        ("a.txt", "# nothing\n", "holds no rows"),
        ("a.csv", "target\n", "holds no rows"),
        ("a.txt", "1\ntwo\n", "row 1 holds 'two'"),
        ("a.txt", "1 2\n", "row 0 holds '1 2'; a map has one vertex number to a line"),
        ("a.csv", "12,5\n1\n", "row 1 has 1 entries, but row 0 has 2"),
        ("a.csv", "1\ntwo\n", "row 1 holds 'two'; a map has one vertex number to a line"),
        ("a.txt", "1\n1.5\n", "row 1 is 1.5, which is not a vertex number"),
        ("a.txt", "nan\n", "row 0 is nan"),
        ("a.txt", "3\n\n# a note\n5\n6\n", "row 1 is blank; write -1 for a vertex without image"),
        (
            "a.csv",
            "target\n3\n\n5\n6\n",
            "row 1 is blank; write NA for a value that is missing, or -1",
        ),
        ("a.txt", "0\n-2\n", "row 1 is -2, but counted from 0 vertices are 0 or more"),
        ("a.vts", "1\n0\n", "row 1 is 0, but counted from 1 vertices are 1 or more"),
        ("a.obj", "1\n", "unknown suffix"),
        ("a.npy", "1\n", "not a NumPy array file"),
    ],
)
def test_what_a_file_cannot_mean(tmp_path: Path, name: str, text: str, sentence: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError) as caught:
        read_map(tmp_path / name)
    assert sentence in str(caught.value)
    assert name in str(caught.value)


def test_lengths_and_ranges_are_those_of_the_shapes(tmp_path: Path) -> None:
    path = tmp_path / "map.vts"
    write_map(path, [0, 4, -1])
    assert read_map(path, n_source=3, n_target=5).tolist() == [0, 4, -1]
    with pytest.raises(FileError, match="holds 3 rows, but the source has 4 vertices"):
        read_map(path, n_source=4)
    with pytest.raises(FileError, match=r"row 1 is 5, but counted from 1 .* are 1 to 4 .*from 0\?"):
        read_map(path, n_target=4)
    with pytest.raises(FileError, match="there is no such file"):
        read_map(tmp_path / "none.vts")


@pytest.mark.parametrize(("name", "first"), [("map.txt", 0), ("map.vts", 1)])
def test_a_map_that_is_off_by_one_is_refused(tmp_path: Path, name: str, first: int) -> None:
    ball = make_sphere(2)
    n, inner = ball.n_vertices, np.arange(1, ball.n_vertices - 1)
    true = np.concatenate([[-1], inner, [-1]])
    write_map(tmp_path / name, true, base=1 - first)
    wrong = read_map(tmp_path / name)
    noise = np.random.default_rng(0).permutation(n)
    for cost in (roughness(ball, ball), straight_error(ball, inner, inner)):
        for kept in (true, np.arange(n), np.full(n, -1), noise):
            refuse_other_base(name, kept, n, cost)
        with pytest.raises(
            FileError, match=f"if it counts from {1 - first}: add --base {1 - first}"
        ):
            refuse_other_base(name, wrong, n, cost)


@pytest.mark.parametrize("array", [np.zeros((2, 2), int), np.array(["1"]), np.array([], int)])
def test_arrays_that_are_no_maps(tmp_path: Path, array: np.ndarray) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(FileError, match=r"a.npy: holds"):
        read_map(tmp_path / "a.npy")


def test_numbers_that_floats_skip(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", [0.0, 2.0**53 - 1])
    assert read_map(tmp_path / "a.npy").tolist() == [0, 2**53 - 1]
    np.save(tmp_path / "a.npy", [0.0, 2.0**53])
    with pytest.raises(FileError, match=r"row 1 is 9007199254740992\.0, which is not a vertex"):
        read_map(tmp_path / "a.npy")


def test_only_maps_are_written(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="unknown suffix"):
        write_map(tmp_path / "map.obj", [1])
    for wrong in ([], np.empty(0, int), [[1]], [1.0], [-2, 3], ["a"]):
        with pytest.raises(InputError, match=r"list of vertex numbers|no vertices"):
            write_map(tmp_path / "map.txt", wrong)
    with pytest.raises(InputError, match="base must be 0 or 1"):
        write_map(tmp_path / "map.txt", [1], base=2)
    assert list(tmp_path.iterdir()) == []


def test_ground_truth_of_real_shapes(real_data: Path) -> None:
    path = real_data / "tosca_remeshed" / "corres" / "cat0.vts"
    found = read_map(path)
    np.testing.assert_array_equal(found, np.loadtxt(path, dtype=int) - 1)
    write_rows = [str(row + 1) for row in found]
    assert path.read_text().split() == write_rows


def test_a_map_turned_round_and_back_is_itself(blob: Mesh) -> None:
    order = np.random.default_rng(0).permutation(blob.n_vertices)
    inverse = invert_map(order, blob)
    np.testing.assert_array_equal(inverse, np.argsort(order))


def test_rounding_does_not_choose_between_neighbours() -> None:
    ball = make_sphere(3)
    noise = 1e-15 * np.random.default_rng(0).standard_normal(ball.vertices.shape)
    found = [
        invert_map([0, 1, 2, 50], Mesh(vertices, ball.faces))
        for vertices in (ball.vertices, ball.vertices + noise)
    ]
    np.testing.assert_array_equal(*found)


def test_vertices_that_are_nobodys_image_ask_their_neighbours(blob: Mesh) -> None:
    some = np.arange(0, blob.n_vertices, 25)
    inverse = invert_map(some, blob)
    np.testing.assert_array_equal(inverse[some], np.arange(len(some)))
    # Each has an image that no other is nearer than, along edges.
    i, j = blob.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    lengths = np.linalg.norm(blob.vertices[i] - blob.vertices[j], axis=1)
    ways = np.where(some[:, None] == np.arange(blob.n_vertices), 0, np.inf)
    for _ in range(100):  # relaxed until no edge shortens a way
        np.minimum.at(ways.T, i, ways.T[j] + lengths[:, None])
    mine = ways[inverse, np.arange(blob.n_vertices)]
    np.testing.assert_allclose(mine, ways.min(axis=0), rtol=1e-6, atol=1e-6 * lengths.max())
    assert (invert_map(np.full(4, -1), blob) == -1).all()
    apart = Mesh(np.vstack([blob.vertices, [[9, 9, 9]]]), blob.faces)
    assert invert_map([5, -1], apart).tolist() == [0] * blob.n_vertices + [-1]
    with pytest.raises(InputError, match="names target vertex 642"):
        invert_map([642], blob)
    for wrong in ([0.5], [-2, 0], [[0]]):
        with pytest.raises(InputError, match="list of vertex numbers"):
            invert_map(wrong, blob)
    assert invert_map(np.empty(0, int), apart).tolist() == [-1] * apart.n_vertices
    cloud = Mesh([[0.0, 0, 0]])
    assert invert_map([-1, 0], cloud).tolist() == [1]
    with pytest.raises(InputError, match="names target vertex 1, but the target has 1 vertex"):
        invert_map([1], cloud)


@pytest.mark.parametrize(
    "text",
    [
        "3,4\n5,6\n",
        "Template,Scan\n3,4\n5,6\n",
        "scan,template\n4,3\n6,5\n",
        "3;4\r\n\n5 6\n",
        "source,target\n3,4\n5,6\n",
        "Target vertex,source vertex\n4,3\n6,5\n",
        '"","source","target"\n"1",3,4\n"2",5,6\n',  # with names of rows, by R
        '"";"target";"source"\n"one";4;3\n"2";6;5\n',
        ",source,target\n0,3,4\n1,5,6\n",  # by pandas
        "# target,source\n4,3\n6,5\n",  # by NumPy
    ],
)
def test_landmarks_of_other_programs(tmp_path: Path, text: str) -> None:
    (tmp_path / "hints.csv").write_text(text)
    np.testing.assert_array_equal(read_landmarks(tmp_path / "hints.csv"), [[3, 4], [5, 6]])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "hints.csv is empty"),
        ("source,target\n", "holds no landmarks"),
        ("cat,dog\n1,2\n", "columns are named 'cat,dog', which tells no direction"),
        ("label,vertex\n1,500\n", "holds vertices of one mesh; landmarks are pairs"),
        ('"","name","vertex"\n"1",nose,500\n', "holds vertices of one mesh; landmarks are pairs"),
        ("1,2\n3\n", "row 1 holds '3'; a landmark is two vertex numbers"),
        ("1,-2\n", "row 0 holds '1 -2'"),
        ("12,4o\n7,3\n", "row 0 holds '12 4o'"),  # a slip, no names of columns
        (f"0,{10**19 - 1}\n", "row 0 holds '0 99999"),
        ("nose tip,1,2,3\n", "row 0 holds 'nose tip 1 2 3'.*; points need a file for each"),
        ("1,2,3\n", "row 0 holds '1 2 3'.*; points need a file for each shape"),
    ],
)
def test_what_landmarks_cannot_mean(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "hints.csv").write_text(text)
    with pytest.raises(FileError, match=sentence):
        read_landmarks(tmp_path / "hints.csv")
