"""Labels find the shapes that are meant, or say which line does not."""

import pytest

from unbend.collection import read_labels
from unbend.errors import FileError, UnbendWarning


@pytest.fixture
def table(tmp_path):
    def write(text):
        (tmp_path / "labels.csv").write_text(text)
        return tmp_path / "labels.csv"

    return write


def test_paths_may_be_whole_or_from_the_table_or_an_end(table, tmp_path):
    paths = [str(tmp_path / "a" / "0.off"), "/far/b/0.off", "/far/c/1.off", "/far/c/2.off"]
    found = read_labels(
        table(f"label,note,path\ncat,,{paths[0]}\ncat,,a/0.off\ndog,x,./b/0.off\nbird,,1.off\n"),
        [[path] for path in paths],
    )
    assert found == ["cat", "dog", "bird", None]


def test_paths_from_where_we_are(table, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert read_labels(table("path,label\n./0.off,cat\n"), [[str(tmp_path / "0.off")]]) == ["cat"]


def test_a_path_that_fits_here_and_beside_the_table_is_refused(table, tmp_path, monkeypatch):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    both = str(here / "0.off"), str(tmp_path / "0.off")
    text = table("path,label\n0.off,cat\n")
    with pytest.raises(FileError, match=r"0.off is several shapes .*; write the whole path"):
        read_labels(text, [[path] for path in both])
    assert read_labels(text, [both]) == ["cat"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("path,kind\n0.off,cat\n", "no column label"),
        ("", "is empty"),
        ("path,label\n9.off,cat\n", "line 2: 9.off is no shape"),
        ("path,label\n0.off,cat\n", "line 2: 0.off is several shapes"),
        ("path,label\n1.off,\n", "line 2 has no label"),
        (
            "path,label\n1.off,cat\n1.off,dog\n",
            "line 3 labels .*1.off dog, but an earlier line labels it cat",
        ),
    ],
)
def test_a_line_that_does_not_fit_is_named(table, text, message):
    with pytest.raises(FileError, match=message):
        read_labels(table(text), [["/a/0.off"], ["/b/0.off"], ["/c/1.off"]])


def test_a_label_may_be_that_of_any_file_of_a_shape(table):
    shapes = [["/a/0.off", "/b/0.off"], ["/a/1.off", "/b/copy.off"], ["/a/2.off"]]
    assert read_labels(table("path,label\nb/0.off,cat\ncopy.off,dog\n"), shapes) == [
        "cat",
        "dog",
        None,
    ]
    assert read_labels(table("path,label\n0.off,cat\na/0.off,cat\n"), shapes)[0] == "cat"


def test_a_shape_with_two_labels_is_left_out_and_both_are_named(table):
    text = table("path,label\na/0.off,cat\nb/0.off,lion\n1.off,dog\n")
    with pytest.warns(UnbendWarning, match="/a/0.off a cat and /b/0.off a lion, but these files"):
        assert read_labels(text, [["/a/0.off", "/b/0.off"], ["/a/1.off"]]) == [None, "dog"]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_may_end_as_on_any_system(tmp_path, end):
    (tmp_path / "labels.csv").write_bytes(f"path,label{end}0.off,cat{end}".encode())
    assert read_labels(tmp_path / "labels.csv", [["/a/0.off"]]) == ["cat"]


def test_a_table_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(FileError, match="cannot read"):
        read_labels(tmp_path / "none.csv", [])
