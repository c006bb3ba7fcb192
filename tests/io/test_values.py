"""Values come back as they were written; a table that does not fit is refused."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from unbend import Mesh, read_mesh
from unbend.errors import FileError, InputError, UnbendWarning
from unbend.io import VALUE_SUFFIXES, read_named_values, read_values, write_values

SHAPES = array_shapes(min_dims=1, max_dims=2, max_side=6)
TABLES = st.one_of(
    arrays(np.int64, SHAPES),
    arrays(np.float64, SHAPES, elements=st.floats(allow_infinity=False)),
    arrays("U4", st.integers(1, 6), elements=st.text("abc", min_size=1, max_size=4)),
)


@given(TABLES, st.sampled_from(VALUE_SUFFIXES))
def test_round_trip(tmp_path_factory, table, suffix) -> None:
    path = tmp_path_factory.mktemp("values") / f"values{suffix}"
    write_values(path, table, Mesh(np.zeros((len(table), 3))))
    back = read_values(path)
    if suffix != ".npy" and table.ndim == 2 and table.shape[1] == 1:
        table = table[:, 0]  # a text file cannot tell a column from a list
    np.testing.assert_array_equal(back, table)
    assert back.dtype.kind == table.dtype.kind


def test_labels_without_a_header_keep_their_first(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("head\ntail\n")
    assert read_values(tmp_path / "a.csv", n_vertices=2).tolist() == ["head", "tail"]
    assert read_values(tmp_path / "a.csv", n_vertices=1).tolist() == ["tail"]


def test_a_name_of_a_column_that_seems_to_be_a_label_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("part\nhead\ntail\ntail\n")
    with pytest.warns(UnbendWarning, match="first line, 'part', is taken as the label of vertex 0"):
        assert read_values(tmp_path / "a.csv", n_vertices=4)[0] == "part"


def test_a_word_before_numbers_is_no_label(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("label\n7\n8\n")
    assert read_values(tmp_path / "a.csv", n_vertices=2).tolist() == [7, 8]
    with pytest.raises(FileError, match=r"holds 2 rows, but there are 3 vertices$"):
        read_values(tmp_path / "a.csv", n_vertices=3)
    (tmp_path / "a.csv").write_text("label\n7\n\n8\n\n")  # of a spreadsheet
    with pytest.raises(FileError, match=r"row 1 is blank; write NA for a value that is"):
        read_values(tmp_path / "a.csv", n_vertices=3)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "a.csv is empty"),
        ("part\n", "holds no rows"),
        ("part\n\n1.5\n2.5\n\n0.5\n", "row 2 is blank; write NA for a value that is missing"),
        ("1,2\n3\n", "row 1 has 1 entries, but row 0 has 2"),
        ('"","x"\n"2",4\n"3",5\n', "first column has no name, and does not number the rows"),
        ('"","x"\n"a",4\n"b",5\n', "first column has no name, and does not number the rows"),
        ('"";"x"\n"1";0,5\n"2";3\n', "row 1 has 1 entries, but row 0 has 2; write decimal points"),
        ("x,y\n1,2\n3,no\n", "row 1 holds '3 no', not numbers; keep labels in one column"),
        ("label,vertex\nnose,2\n3,3\n", "landmarks go into a .mrk.json file by unbend transfer"),
        ("1\n2\n3\n", "holds 3 rows, but there are 2 vertices"),
    ],
)
def test_what_is_no_table(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(FileError) as caught:
        read_values(tmp_path / "a.csv", n_vertices=2 if "3" in text else None)
    assert sentence in str(caught.value)


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
def test_comments_are_lines_and_labels_keep_their_signs(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_text("# parts\n\npart#1\n  # more\npart#2\n")
    assert read_values(path, n_vertices=2).tolist() == ["part#1", "part#2"]
    path.write_text("0.5\n1.5 # last\n")
    if suffix == ".txt":
        assert read_values(path).tolist() == [0.5, 1.5]
        return
    with pytest.raises(FileError, match=r"row 1 holds '1.5 # last', neither a number"):
        read_values(path, n_vertices=2)


@pytest.mark.parametrize("row", ["0.5;7", "1;", "0.5\t7", '"0,5"'])
def test_numbers_run_together_are_no_labels(tmp_path: Path, row: str) -> None:
    (tmp_path / "a.csv").write_text(f"left;right\n{row}\n")
    with pytest.raises(FileError, match=r"row 1 holds .* write decimal points"):
        read_values(tmp_path / "a.csv", n_vertices=2)
    (tmp_path / "a.txt").write_text("0,5\n")
    with pytest.raises(FileError, match="row 0 holds '0,5'"):
        read_values(tmp_path / "a.txt")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("height\n0,523\n0,1\n", "names 1 column, but row 0 holds '0,523'; write decimal"),
        ("vertex,height\n1,0,5\n0,0,25\n", "names 2 columns, but row 0 holds '1,0,5'"),
        ("12,5\n0,05\n", "row 1 holds '0,05', whose commas may be decimal ones"),
        ("1,2\n-0,5\n", "row 1 holds '-0,5', whose commas may be decimal ones"),
    ],
)
def test_decimal_commas_are_no_columns(tmp_path: Path, text: str, problem: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(FileError, match=problem):
        read_values(tmp_path / "a.csv", n_vertices=2)


@pytest.mark.parametrize("row", ["12,5", '"12,5"'])
def test_one_row_of_whole_numbers_may_be_a_decimal(tmp_path: Path, row: str) -> None:
    (tmp_path / "a.csv").write_text(f"{row}\n")
    with pytest.raises(FileError, match="row 0 holds '12,5', whose commas may be decimal ones"):
        read_values(tmp_path / "a.csv", n_vertices=1)
    (tmp_path / "a.csv").write_text("x,y\n12,5\n")
    assert read_values(tmp_path / "a.csv", n_vertices=1).tolist() == [[12, 5]]


def test_columns_of_whole_numbers_are_no_decimals(tmp_path: Path) -> None:
    for text, rows in (
        ("x,y\n0,05\n1,2\n", [[0, 5], [1, 2]]),
        ("0,50\n-1,20\n", [[0, 50], [-1, 20]]),
        ("0,-05\n1,2\n", [[0, -5], [1, 2]]),
        ("0,05,1\n1,2,3\n", [[0, 5, 1], [1, 2, 3]]),
    ):
        (tmp_path / "a.csv").write_text(text)
        assert read_values(tmp_path / "a.csv", n_vertices=2).tolist() == rows


LABELS = ["#ff0000", "upper arm, left", 'a "hand"', "", "two\nlines", "x;y", "plain"]


def test_any_label_comes_back_from_csv(tmp_path: Path) -> None:
    mesh = Mesh(np.zeros((len(LABELS), 3)))
    write_values(tmp_path / "a.csv", LABELS, mesh, kind="label")
    assert read_values(tmp_path / "a.csv", n_vertices=len(LABELS)).tolist() == LABELS
    write_values(tmp_path / "a.csv", ["head"] * len(LABELS), mesh, kind="label")
    assert (tmp_path / "a.csv").read_bytes() == b"label\n" + b"head\n" * len(LABELS)
    write_values(tmp_path / "a.csv", ["#1"] * len(LABELS), mesh, kind="label")
    assert (tmp_path / "a.csv").read_bytes() == b'"label"\n' + b'"#1"\n' * len(LABELS)


@pytest.mark.parametrize("label", ["#ff0000", "upper arm", ""])
def test_a_word_for_each_vertex_in_txt(tmp_path: Path, label: str) -> None:
    mesh = Mesh(np.zeros((2, 3)))
    with pytest.raises(InputError, match=r"one word for each vertex.*write .csv"):
        write_values(tmp_path / "a.txt", ["head", label], mesh)
    write_values(tmp_path / "a.txt", ["head", "tail#1"], mesh)
    assert read_values(str(tmp_path / "a.txt")).tolist() == ["head", "tail#1"]


def test_whole_numbers_only_where_all_are(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("1 -2\n+3 2.5\n")
    assert read_values(tmp_path / "a.txt").tolist() == [[1, -2], [3, 2.5]]
    (tmp_path / "a.txt").write_text("1 -2\n+3 2\n")
    assert read_values(tmp_path / "a.txt").dtype == np.int64
    (tmp_path / "a.txt").write_text("1 2\n3 4_0\n")
    with pytest.raises(FileError, match="row 1 holds '3 4_0', not numbers"):
        read_values(tmp_path / "a.txt")
    (tmp_path / "a.txt").write_text(f"1 {10**17}\n1 {10**19 - 1}\n")
    with pytest.raises(FileError, match="row 1 holds '1 9999999999999999999', more than 64 bits"):
        read_values(tmp_path / "a.txt")


def test_vertex_numbers_may_be_written_as_decimals(tmp_path: Path) -> None:
    for rows in ("0.0,5\n2.0,7\n1.0,6", "0.000e+00,5\n2.000e+00,7\n1.000e+00,6"):
        (tmp_path / "a.csv").write_text(f"vertex,value\n{rows}\n")
        assert read_values(tmp_path / "a.csv").tolist() == [5, 6, 7]
    for rows, problem in (
        ("0.0,5\n0,7", "row 1 holds vertex '0' again"),
        ("0,5\n1.5,7", "vertex 1:"),
    ):
        (tmp_path / "a.csv").write_text(f"vertex,value\n{rows}\n")
        with pytest.raises(FileError, match=problem):
            read_values(tmp_path / "a.csv")


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
def test_truth_values_are_numbers(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    write_values(path, [True, False, True], np.eye(3))
    assert read_values(path).tolist() == [1, 0, 1]


@pytest.mark.parametrize("missing", ["NA", "N/A", "nan", "NaN", '""'])
def test_missing_numbers_are_no_words(tmp_path: Path, missing: str) -> None:
    path = tmp_path / "a.csv"
    for header in ("height\n", ""):
        path.write_text(f"{header}{missing}\n1\n2\n")
        np.testing.assert_array_equal(read_values(path, n_vertices=3), [np.nan, 1, 2])
    path.write_text(f"id,x,y\n1,{missing},7\n0,2,{missing}\n")
    np.testing.assert_array_equal(read_values(path, n_vertices=2), [[2, np.nan], [np.nan, 7]])
    path.write_text(f"part\nhead\n{missing}\n7\n")
    assert read_values(path, n_vertices=3).tolist() == ["head", missing.strip('"'), "7"]


def test_labels_of_digits_stay_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("part\n007\n10\nNA\n")
    assert read_values(path).tolist() == ["007", "10", "NA"]
    path.write_text(f"part\n{2**60}\nNA\n4\n")
    assert read_values(path)[::2].tolist() == [2**60, 4]
    write_values(path, read_values(path), np.eye(3), kind="label")
    assert path.read_text().split() == ["label", "1.152921504606847e+18", "nan", "4"]
    for missing in ("NA", "nan", ""):
        path.write_text(f"part,side\n4,1\n{2**60 + 1},{missing}\n")
        with pytest.raises(FileError, match="row 1 holds '1152921504606846977', which would be"):
            read_values(path)


def test_a_column_without_any_number_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text('NA\n""\nNA\n')
    assert read_values(tmp_path / "a.csv", n_vertices=3).tolist() == ["NA", "", "NA"]
    (tmp_path / "a.csv").write_text("1,\n2,\n")
    with pytest.raises(FileError, match="row 0 holds '1 ', not numbers"):
        read_values(tmp_path / "a.csv", n_vertices=2)


def test_words_have_an_end(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(f"part\n{'a' * 1000}\n")
    assert read_values(tmp_path / "a.csv").tolist() == ["a" * 1000]
    (tmp_path / "a.csv").write_text(f"part\nb\n{'a' * 1001}\n")
    with pytest.raises(FileError, match="row 1 holds a word of more than 1000 letters"):
        read_values(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text(f"1,{'2' * 1001}\n")
    with pytest.raises(FileError, match="row 0 holds a word of more than 1000 letters"):
        read_values(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text("a" * 200_000)
    with pytest.raises(FileError, match="not a table in CSV: field larger than"):
        read_values(tmp_path / "a.csv")


def test_meshes_carry_values_colors_and_texture(blob: Mesh, tmp_path: Path) -> None:
    bytes_of = {}
    for name, values, kind in (
        ("weights.ply", np.ones((642, 2)), "weights"),
        ("label.ply", np.arange(642), "label"),
        ("colors.ply", np.full((642, 4), 255, np.uint8), "color"),
        ("colors.obj", np.zeros((642, 3), np.uint8), "color"),
        ("uv.ply", np.zeros((642, 2)), "uv"),
        ("value.obj", np.arange(642), "scalar"),
        ("column.obj", np.arange(642)[:, None], "scalar"),
        ("label.obj", np.repeat(["head", "", "tail"], 214), "label"),
    ):
        write_values(tmp_path / name, values, blob, kind=kind)
        np.testing.assert_array_equal(read_mesh(tmp_path / name).vertices, blob.vertices)
        bytes_of[name] = (tmp_path / name).read_bytes()
    assert bytes_of["value.obj"] == bytes_of["column.obj"]
    assert b"double value_0\nproperty double value_1" in bytes_of["weights.ply"]
    assert b"double label\nproperty uchar red" in bytes_of["label.ply"]
    assert b"uchar red" in bytes_of["weights.ply"]
    lines = bytes_of["label.obj"].decode().splitlines()
    seen = [tuple(float(word) for word in line.split()[4:]) for line in lines[:642:214]]
    assert len(set(seen)) == 3
    assert seen[1] == (0.6, 0.6, 0.6)  # what has no label is grey
    assert b"uchar red" in bytes_of["colors.ply"]
    places = np.full((642, 2), 0.5)
    places[7], places[9, 1] = np.nan, np.inf
    with pytest.warns(UnbendWarning, match="2 vertices without texture coordinates: 0, 0"):
        write_values(tmp_path / "uv.obj", places, blob, kind="uv")
    assert (tmp_path / "uv.obj").read_text().count("vt 0.0 0.0\n") == 2


def test_what_a_format_cannot_hold(blob: Mesh, tmp_path: Path) -> None:
    for name, values, sentence in (
        ("a.ply", ["a"] * 642, "cannot hold text"),
        ("a.obj", np.zeros((642, 2)), "a colour for each vertex, not 2 numbers"),
        ("a.csv", np.zeros((642, 2, 2)), "one or two dimensions"),
        ("a.csv", np.zeros(3), "one row for each of 642"),
        ("a.csv", np.zeros((642, 0)), "one row for each of 642"),
    ):
        with pytest.raises(InputError, match=sentence):
            write_values(tmp_path / name, values, blob)
    with pytest.raises(FileError, match="unknown suffix"):
        write_values(tmp_path / "a.stl", np.zeros(642), blob)
    with pytest.raises(InputError, match="not 2 numbers; write"):
        write_values(tmp_path / "a.glb", np.full((642, 2), 0.5), blob, kind="weights")
    assert list(tmp_path.iterdir()) == []


def test_any_mesh_will_do(blob: Mesh, tmp_path: Path) -> None:
    written = []
    for number, shape in enumerate([blob, (blob.vertices, blob.faces)]):
        path = tmp_path / f"{number}.ply"
        write_values(path, np.arange(blob.n_vertices), shape)
        written.append(path.read_bytes())
    assert written[0] == written[1]


def test_columns_keep_their_names_where_a_file_can_have_them(blob: Mesh, tmp_path: Path) -> None:
    table, rows = tmp_path / "bones.csv", np.eye(642)[:, :2]
    lines = ["Point ID,left arm,2nd", *(f"{i},{a},{b}" for i, (a, b) in enumerate(rows))]
    table.write_text("\n".join(lines))
    values, names = read_named_values(table)
    np.testing.assert_array_equal(values, rows)
    assert names == ["left arm", "2nd"]
    write_values(tmp_path / "a.csv", values, blob, kind="weights", names=names)
    assert (tmp_path / "a.csv").read_text().startswith("left arm,2nd\n")
    write_values(tmp_path / "a.ply", values, blob, kind="weights", names=names)
    assert read_named_values(tmp_path / "a.ply", name="_2nd")[1] == ["_2nd"]
    assert read_named_values(tmp_path / "a.ply", name="left_arm")[1] == ["left_arm"]
    with pytest.raises(InputError, match="2 columns cannot have 1 name"):
        write_values(tmp_path / "b.csv", values, blob, kind="weights", names=["one"])
    assert not (tmp_path / "b.csv").exists()
    write_values(tmp_path / "b.ply", values, blob, kind="weights")
    assert read_named_values(tmp_path / "b.ply")[1] == ["value_0", "value_1"]
    three = np.eye(642)[:, :3]
    for suffix, unfit, kept in (
        ("ply", ["x", "hip", "y"], ["value_0", "hip", "value_2"]),
        ("ply", ["左腕", "右腕", "hip"], ["value_0", "value_1", "hip"]),
        ("csv", ["hip", "hip", "one"], ["value_0", "value_1", "one"]),
        ("csv", ["hip", "", "value_1"], ["value_0", "value_1", "value_2"]),
    ):
        with pytest.warns(UnbendWarning, match=rf"c.{suffix}: renamed {unfit[0]}, .*value_"):
            write_values(
                tmp_path / f"c.{suffix}", three, blob, kind="weights", names=np.array(unfit)
            )
        columns = (tmp_path / f"c.{suffix}").read_bytes()
        assert all(re.search(rb"(^|[ ,])%s[,\n]" % name.encode(), columns) for name in kept)
    write_values(tmp_path / "b.ply", values[:, 0].astype(int), blob, kind="label", names=["part"])
    assert read_named_values(tmp_path / "b.ply")[1] == ["label"]
    np.save(tmp_path / "a.npy", values)
    assert read_named_values(tmp_path / "a.npy")[1] == []
