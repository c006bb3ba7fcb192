"""Tables: what is written is read again, and a line that does not fit is named."""

import pytest

from unbend.errors import FileError
from unbend.io import read_table, write_table


def test_what_is_written_is_read_again_in_any_order_of_columns(tmp_path):
    write_table(tmp_path / "a.csv", [("b", "a", "c"), ('say "x, y"', 0.1, 1), ("é", 2, 3)])
    assert read_table(tmp_path / "a.csv", ("a", "b")) == [["0.1", 'say "x, y"'], ["2", "é"]]


def test_names_with_line_breaks_are_read_again(tmp_path):
    names = [["a\rb.off"], ["c\nd.off"], ["e\r\nf.off"]]
    write_table(tmp_path / "a.csv", [("path", "group"), *((*name, 1) for name in names)])
    assert read_table(tmp_path / "a.csv", ("path",)) == names
    assert (tmp_path / "a.csv").read_bytes().startswith(b"path,group\n")


def test_a_file_name_that_is_no_text_stops_no_table(tmp_path):
    write_table(tmp_path / "a.csv", [("path",), (b"b\xe4r.ply".decode(errors="surrogateescape"),)])
    assert read_table(tmp_path / "a.csv", ("path",)) == [["b?r.ply"]]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_may_end_as_on_any_system_and_begin_with_a_byte_order_mark(tmp_path, end):
    (tmp_path / "a.csv").write_bytes(f"\ufeffa, b{end}1, 2{end}".encode())
    assert read_table(tmp_path / "a.csv", ("b", "a")) == [["2", "1"]]


def test_blanks_around_values_and_empty_cells_after_them_do_not_count(tmp_path):
    (tmp_path / "a.csv").write_text("a , b\t,,\n 1 ,2 3\t,,\n")
    assert read_table(tmp_path / "a.csv", ("a", "b")) == [["1", "2 3"]]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"a,c\n1,2\n", "there is no column b; the first line must name the columns a, b"),
        (b"a,b\n1,2\n3\n", "line 3 has no b"),
        (b"a,b\n1,2\n,2\n", "line 3 has no a"),
        (b"a,b\n\xff,2\n", "cannot read .*a.csv"),
        (b"", "is empty"),
        (b"a,b\n1, \t\n", "line 2 has no b"),
        (b"a,b, a\n1,2,3\n", "the first line names the column a twice"),
        (b"a,b\n1,2\n1,2,3\n", "line 3 has more values than there are columns"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path, data, message):
    (tmp_path / "a.csv").write_bytes(data)
    with pytest.raises(FileError, match=message):
        read_table(tmp_path / "a.csv", ("a", "b"))


def test_a_failed_write_leaves_nothing(tmp_path):
    def rows():
        yield ("a",)
        raise ValueError("none")

    with pytest.raises(ValueError, match="none"):
        write_table(tmp_path / "a.csv", rows())
    assert not list(tmp_path.iterdir())
