"""Values that mesh files hold come back, from ours and from other programs'."""

import struct
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from unbend import Mesh, read_mesh, write_mesh
from unbend.errors import FileError, InputError, UnbendWarning
from unbend.io import read_values, write_values

SQUARE = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
FILES = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@FILES
@given(st.data(), st.sampled_from(["scalar", "label", "weights", "color", "uv"]))
def test_what_is_written_to_ply_is_read_back(tmp_path: Path, data, kind) -> None:
    values = data.draw(
        {
            "scalar": arrays(float, (4, 3), elements=st.floats(allow_infinity=False)),
            "label": arrays(np.int64, 4, elements=st.integers(-1, 2**50)),
            "weights": arrays(float, (4, 2), elements=st.floats(0, 1)),
            "color": arrays(np.uint8, (4, 3)),
            "uv": arrays(float, (4, 2), elements=st.floats(-1, 2)),
        }[kind]
    )
    write_values(tmp_path / "a.ply", values, SQUARE, kind=kind)
    back = read_values(tmp_path / "a.ply", n_vertices=4)
    np.testing.assert_array_equal(back, values)
    assert back.dtype == values.dtype


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb"])
def test_colours_of_every_format_come_back(tmp_path: Path, suffix: str) -> None:
    if suffix == ".glb":
        pytest.importorskip("trimesh")
    colors = np.arange(12).reshape(4, 3) * 23
    write_mesh(tmp_path / f"a{suffix}", SQUARE, colors=colors)
    back = read_values(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(back, colors)
    assert back.dtype == np.uint8


def ply(encoding: str) -> bytes:
    header = (
        f"ply\nformat {encoding} 1.0\nelement vertex 2\nproperty uchar part\nproperty list uchar "
        "int more\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
        "property float quality\nproperty float red\nproperty float green\nproperty float blue\n"
        "end_header\n"
    )
    rows = [(3, 1, 9, 0, 0, 0, 1, 0.5, 1, 0, 0), (4, 1, 8, 1, 2, 3, 1, 0.25, 0, 0.2, 1)]
    if encoding == "ascii":
        return (header + "".join(" ".join(map(str, row)) + "\n" for row in rows)).encode()
    order = "<" if encoding == "binary_little_endian" else ">"
    return header.encode() + b"".join(struct.pack(f"{order}BBi8f", *row) for row in rows)


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_properties_are_read_by_name(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(ply(encoding))
    assert read_values(path, name="part").tolist() == [3, 4]
    assert read_values(path, name="part").dtype == np.uint8
    assert read_values(path, name="quality").tolist() == [0.5, 0.25]
    assert read_values(path, name="color").tolist() == [[255, 0, 0], [0, 51, 255]]
    assert read_mesh(path).vertices.tolist() == [[0, 0, 0], [1, 2, 3]]
    with pytest.raises(FileError, match=r"a\.ply: holds color, part, quality; name one"):
        read_values(path)
    with pytest.raises(FileError, match="name one"):
        read_values(path, name="nx")


@pytest.mark.parametrize("most", [255, 65535])
def test_colours_of_16_bits_are_colours(tmp_path: Path, most: int) -> None:
    header = ply("ascii").decode().split("end_header")[0].replace("float red", "ushort red")
    header = header.replace("float green", "ushort green").replace("float blue", "ushort blue")
    path = tmp_path / "a.ply"
    path.write_text(f"{header}end_header\n3 0 0 0 0 1 1 {most} 0 0\n3 0 1 2 3 1 1 0 0 {most}\n")
    assert read_values(path, name="color").tolist() == [[255, 0, 0], [0, 0, 255]]


@pytest.mark.parametrize("most", [1.0000004, 1.02])
def test_float_colours_a_little_above_one_are_shares(tmp_path: Path, most: float) -> None:
    path = tmp_path / "a.obj"
    path.write_text(f"v 0 0 0 {most} 0.5 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n")
    assert read_values(path).tolist() == [[255, 128, 0], [0, 255, 0], [0, 0, 255]]


@pytest.mark.parametrize(("second", "warns"), [(255, False), (7, True)])
@pytest.mark.parametrize("suffix", [".ply", ".glb"])
def test_transparency_is_said_to_be_left_out(
    tmp_path: Path, suffix: str, second: int, warns: bool
) -> None:
    trimesh = pytest.importorskip("trimesh")
    colors = [[0, 0, 255, 255], [0, 255, 0, second], [255, 0, 0, 255], [0, 0, 0, 255]]
    given = trimesh.Trimesh(
        SQUARE.vertices, SQUARE.faces, process=False, vertex_colors=np.array(colors, np.uint8)
    )
    given.export(tmp_path / f"a{suffix}")
    warning = partial(pytest.warns, UnbendWarning, match="transparency of colours is not kept")
    said = warning if warns else nullcontext
    with said():
        np.testing.assert_array_equal(read_values(tmp_path / f"a{suffix}"), np.array(colors)[:, :3])
    with said():
        write_values(tmp_path / "b.ply", colors, SQUARE, kind="color")


def test_names_that_are_alike_hide_no_values(tmp_path: Path) -> None:
    path, names = tmp_path / "a.ply", ("a", "a_0", "a_1", "u", "v")
    columns = dict(zip(names, np.arange(20.0).reshape(5, 4), strict=True))
    write_mesh(path, SQUARE, scalars=columns, uvs=np.zeros((4, 2)))
    for name, values in columns.items():
        np.testing.assert_array_equal(read_values(path, name=name), values)
    write_mesh(path, SQUARE, scalars={"label": [1, 2, 3, np.inf]})
    assert read_values(path).tolist() == [1, 2, 3, np.inf]
    write_mesh(path, SQUARE, scalars={"color": [0.1, 0.2, 0.3, 0.4]})
    assert read_values(path, name="color").tolist() == [0.1, 0.2, 0.3, 0.4]


def test_a_word_that_is_no_number_is_named_only_when_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(ply("ascii").replace(b"0.25", b"high"))
    assert read_mesh(path).n_vertices == 2
    with pytest.raises(FileError, match=r"^a\.ply: vertex 1 holds 'high'"):
        read_values(path, name="quality")


def test_a_mesh_without_values_says_so(tmp_path: Path) -> None:
    write_mesh(tmp_path / "a.ply", SQUARE)
    with pytest.raises(FileError, match="holds no values per vertex"):
        read_values(tmp_path / "a.ply")
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n")
    with pytest.raises(FileError, match="no values per vertex; registering carries its texture"):
        read_values(tmp_path / "a.obj", name="uv")
    write_mesh(tmp_path / "a.obj", SQUARE)
    with pytest.raises(FileError, match=r"no values per vertex$"):
        read_values(tmp_path / "a.obj")
    (tmp_path / "a.off").write_text("COFF\n1 0 0\n0 0 0 255 0 0 255\n")
    with pytest.raises(FileError, match=r"per vertex; its colours are not read: save it as \.ply$"):
        read_values(tmp_path / "a.off")
    (tmp_path / "a.csv").write_text("part,side\n1,2\n")
    with pytest.raises(InputError, match=r"all its columns are taken: .* keep the column part"):
        read_values(tmp_path / "a.csv", name="part")


@given(st.permutations(range(5)), st.lists(st.sampled_from(["head", "a tail", "7"]), min_size=5))
def test_rows_with_vertex_numbers_may_be_in_any_order(tmp_path_factory, order, words) -> None:
    path = tmp_path_factory.mktemp("v") / "a.csv"
    words[4] = "paw"  # so that not all are numbers
    path.write_text("vertex,part\n" + "".join(f"{i},{words[i]}\n" for i in order))
    assert read_values(path, n_vertices=5).tolist() == words[:5]
    path.write_text("Vertex,x,y\n" + "".join(f"{i},{i / 2},{-i}\n" for i in order))
    np.testing.assert_array_equal(read_values(path), [(i / 2, -i) for i in range(5)])


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        ("0,a\n0,b\n", "row 1 holds vertex '0' again"),
        ("1,a\n2,b\n", "no row of vertex 0: all are needed, counted from 0"),
        ("0,a\n1\n", "row 1 has 1 entries, but row 0 has 2"),
        ("0,a\n2,b\n3,c\n4,d\n", "no row of vertex 1"),
        ("x,a\n", "no row of vertex 0"),
        ("", "holds no rows"),
    ],
)
def test_vertex_numbers_must_be_all_of_them(tmp_path: Path, rows: str, problem: str) -> None:
    (tmp_path / "a.csv").write_text(f"vertex,part\n{rows}")
    for n in (None, 5):
        with pytest.raises(FileError, match=problem):
            read_values(tmp_path / "a.csv", n_vertices=n)


@pytest.mark.parametrize("name", ["Vertex", "index", "ID", "Point ID", "", "Unnamed: 0"])
@given(st.permutations(range(5)))
def test_columns_of_vertex_numbers_have_other_names_too(tmp_path_factory, name, order) -> None:
    path = tmp_path_factory.mktemp("v") / "a.csv"
    path.write_text(f"{name},height\n" + "".join(f"{i},{i / 2}\n" for i in order))
    assert read_values(path, n_vertices=5).tolist() == [0, 0.5, 1, 1.5, 2]
    path.write_text(f"height,{name}\n" + "".join(f"{i / 2},{i}.0\n" for i in order))
    assert read_values(path, n_vertices=5).tolist() == [0, 0.5, 1, 1.5, 2]
    path.write_text(f"{name}\n" + "".join(f"{i}\n" for i in order))
    assert read_values(path, n_vertices=5).tolist() == order
    path.write_text(f"height,{name}\n0,1\n1\n")
    with pytest.raises(FileError, match="row 1 has 1 entries"):
        read_values(path, n_vertices=2)
    path.write_text(f"x,{name}\n" + "".join(f"0.5,{i // 2}\n" for i in order))
    assert read_values(path, n_vertices=5).tolist() == [[0.5, i // 2] for i in order]


def test_a_column_that_may_number_vertices_must_say_so(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    for header in ("nr,height\n", ""):
        path.write_text(f"{header}0,7\n1,9\n")
        assert read_values(path, n_vertices=2).tolist() == [[0, 7], [1, 9]]
        path.write_text(f"{header}1,7\n0,9\n")
        with pytest.raises(FileError, match="first column holds each number from 0 to 1 once"):
            read_values(path, n_vertices=2)
    for name, message in (
        ("", "column '' numbers vertices from 1"),
        ("id", "column 'id' numbers vertices from 1"),
    ):
        path.write_text(f'"{name}","height"\n"2",7\n"1",9\n')
        with pytest.raises(FileError, match=message):
            read_values(path, n_vertices=2)
    write_values(path, [[1, 0], [0, 1]], np.zeros((2, 3)))  # weights
    assert read_values(path, n_vertices=2).tolist() == [[1, 0], [0, 1]]
