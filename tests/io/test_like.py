"""Writing an OBJ file like another one: new positions, every other line as it was."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unbend import Mesh, read_mesh, write_mesh
from unbend.errors import FileError, InputError
from unbend.io import file_extras
from unbend.io.formats import obj

CUBE = b"""# a cube \\
mtllib wood.mtl
o box
v 0 0 0 1 0 0 # a red corner
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 \\
  1
v 0 1 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 -1
vn 0 0 1
vn 0 -1 0
vn 0 1 0
vn -1 0 0
vn 1 0 0
g sides
usemtl wood
s off
f 1/1/1 4/2/1 3/3/1 2/4/1
f 5/1/2 6/2/2 7/3/2 8/4/2
f 1/1/3 2/2/3 6/3/3 5/4/3
f 3/1/4 4/2/4 -1/3/4 -2/4/4
f 1/1/5 5/2/5 8/3/5 4/4/5
f 2/1/6 3/2/6 7/3/6 6/4/6
"""
TURN = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # x to y, y to -x: rows times this


def lines_but(data: bytes, *keywords: bytes) -> list[bytes]:
    return [
        line for line in data.split(b"\n") if line.split()[:1] not in [[one] for one in keywords]
    ]


def written(folder: Path, data: bytes, move=lambda vertices: vertices, **extras) -> bytes:
    (folder / "in.obj").write_bytes(data)
    mesh = read_mesh(folder / "in.obj")
    moved = Mesh(move(mesh.vertices), mesh.faces)
    write_mesh(folder / "out.obj", moved, like=folder / "in.obj", **extras)
    back = read_mesh(folder / "out.obj")
    np.testing.assert_array_equal(back.vertices, moved.vertices)
    np.testing.assert_array_equal(back.faces, mesh.faces)
    return (folder / "out.obj").read_bytes()


def test_only_positions_and_normals_change(tmp_path):
    found = written(tmp_path, CUBE, lambda vertices: vertices @ TURN * 2)
    joined = CUBE.replace(b"1 \\\n  1", b"1 1")
    assert lines_but(found, b"v", b"vn") == lines_but(joined, b"v", b"vn")
    assert b"v 0.0 0.0 0.0 1 0 0 # a red corner\n" in found


def test_normals_stay_as_they_were_made_if_nothing_moves(tmp_path):
    made = CUBE.replace(b"vn 0 0 1", b"vn .6 0 .8")
    found = written(tmp_path, made, colors=np.zeros((8, 3), int))
    assert lines_but(found, b"v") == lines_but(made.replace(b"1 \\\n  1", b"1 1"), b"v")


def test_normals_turn_with_the_surface_and_edges_stay_sharp(tmp_path):
    found = written(tmp_path, CUBE, lambda vertices: vertices @ TURN + 1000)
    normals = [line.split()[1:] for line in found.split(b"\n") if line.startswith(b"vn")]
    before = [line.split()[1:] for line in CUBE.split(b"\n") if line.startswith(b"vn")]
    np.testing.assert_allclose(
        np.array(normals, dtype=float), np.array(before, dtype=float) @ TURN, atol=1e-6
    )


def test_faces_that_no_longer_face_one_way_share_no_normal(tmp_path):
    data = b"""v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nv 5 0 0\nv 6 0 0\nv 6 1 0
vt 0 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\nf 2/1/1 5/1/1 6/1/1\nf 2//1 6//1 3//1\nf 7//1 8//1 9//1
f 7/1/1 8/1/1 9/1/1
"""

    def lift(vertices):  # the face that stands alone is turned upright
        vertices = vertices.copy()
        vertices[6:] = [[5, 0, 0], [5, 1, 0], [5, 1, 0.5]]
        return vertices

    def turned(vertices):
        return vertices * [1, -1, -1]

    assert lines_but(written(tmp_path, data, turned), b"v", b"vn") == lines_but(data, b"v", b"vn")
    found = written(tmp_path, data, lift)
    left = data.replace(b"f 7//1 8//1 9//1\nf 7/1/1 8/1/1 9/1/1", b"f 7 8 9\nf 7/1 8/1 9/1")
    assert lines_but(found, b"v", b"vn") == lines_but(left, b"v", b"vn")


def test_a_normal_that_does_not_exist_needs_no_room(tmp_path):
    data = CUBE.replace(b"f 1/1/1 4", b"f 1/1/999999999999999 4")
    assert len(written(tmp_path, data)) < 2 * len(data)


def test_colours_replace_those_of_the_file(tmp_path):
    colors = np.full((8, 3), 255)
    found = written(tmp_path, CUBE, colors=colors)
    assert b"v 0.0 0.0 0.0 1.0 1.0 1.0 # a red corner\n" in found


def test_materials_are_named_relative_to_the_new_file(tmp_path):
    (tmp_path / "new place").mkdir()
    (tmp_path / "in.obj").write_bytes(CUBE.replace(b"wood.mtl", b"my wood.mtl /abs/paint.MTL"))
    mesh = read_mesh(tmp_path / "in.obj")
    write_mesh(tmp_path / "new place" / "out.obj", mesh, like=tmp_path / "in.obj")
    found = (tmp_path / "new place" / "out.obj").read_bytes()
    assert b"\nmtllib ../my wood.mtl /abs/paint.MTL\n" in found
    assert [path.name for path in (tmp_path / "new place").iterdir()] == ["out.obj"]
    for name, expected in ((b"my paint", b"../my paint"), (b"/abs/paint", b"/abs/paint")):
        (tmp_path / "in.obj").write_bytes(CUBE.replace(b"wood.mtl", name))
        write_mesh(tmp_path / "new place" / "out.obj", mesh, like=tmp_path / "in.obj")
        found = (tmp_path / "new place" / "out.obj").read_bytes()
        assert b"\nmtllib " + expected + b"\n" in found


def test_a_vertex_without_position_keeps_its_line(tmp_path):
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 7 7 7\nf 1 2 3\n"
    (tmp_path / "in.obj").write_bytes(data)
    mesh = read_mesh(tmp_path / "in.obj")
    moved = mesh.vertices.copy()
    moved[3] = np.nan
    write_mesh(tmp_path / "out.obj", Mesh(moved, mesh.faces), like=tmp_path / "in.obj")
    assert b"v 7 7 7\n" in (tmp_path / "out.obj").read_bytes()


def test_what_does_not_fit_is_refused(tmp_path):
    (tmp_path / "in.obj").write_bytes(CUBE)
    triangle = Mesh(np.eye(3), [[0, 1, 2]])
    with pytest.raises(FileError, match="other vertices or faces"):
        write_mesh(tmp_path / "out.obj", triangle, like=tmp_path / "in.obj")
    with pytest.raises(InputError, match="like keeps what an OBJ or GLB"):
        write_mesh(tmp_path / "out.ply", triangle, like=tmp_path / "in.obj")
    # The second line belongs to the first.
    (tmp_path / "in.obj").write_bytes(b"g a \\\nv 9 9 9\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n")
    with pytest.raises(FileError, match=r"has 4 plain v lines .* save it again"):
        write_mesh(tmp_path / "out.obj", triangle, like=tmp_path / "in.obj")
    assert not (tmp_path / "out.obj").exists()


def test_what_a_file_holds_besides_its_shape_is_named(tmp_path):
    (tmp_path / "in.obj").write_bytes(CUBE)
    assert file_extras(tmp_path / "in.obj") == [
        "colours", "texture coordinates", "normals", "materials", "groups", "object names"
    ]  # fmt: skip


LINES = [
    *(b"v 1 2 3", b"  v\t1 2 3 0.5", b"v 1 2 3#v 1", b"# v 9 9 9", b"v 1 \\\n 2 3", b"g v 1 2 3"),
    *(b"vn 0 0 1", b"s 1", b"", b"f 1//1 1 1//1", b"f 1//1 1//1 1//1 1//1", b"f -1 -1 -1"),
]


@pytest.mark.parametrize(
    ("text", "extras"),
    [
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", []),
        ("COFF\n1 0 0\n0 0 0 9 9 9 9\n", ["colours"]),
        ("STNOFF1 0 0\n0 0 0 0 0 1 0 0\n", ["texture coordinates", "normals"]),
        ("OFF\n1 0 0\n0 0 0 255 0 0\n", ["colours"]),
        ("OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 2 9 9 9\n", ["colours of faces"]),
    ],
)
def test_what_an_off_file_holds_besides_its_shape_is_named(tmp_path, text, extras):
    (tmp_path / "a.off").write_text(f"# comment\n{text}")
    assert file_extras(tmp_path / "a.off") == extras


def test_colours_of_stl_are_named(tmp_path, blob):
    write_mesh(tmp_path / "a.stl", blob)
    assert file_extras(tmp_path / "a.stl") == []
    data = bytearray((tmp_path / "a.stl").read_bytes())
    data[-1] = 0x80
    (tmp_path / "a.stl").write_bytes(data)
    assert file_extras(tmp_path / "a.stl") == ["colours of triangles"]
    (tmp_path / "a.stl").write_text("solid a\nendsolid a\n")
    assert file_extras(tmp_path / "a.stl") == []


@settings(deadline=None, max_examples=60)
@given(
    st.lists(
        st.sampled_from(LINES),
        max_size=12,
    ),
    st.sampled_from([b"\n", b"\r\n", b"\r"]),
)
def test_any_file_that_is_read_is_rewritten(lines, end):
    data = b"\xef\xbb\xbfv 4 5 6" + end + end.join(lines).replace(b"\n", end) + end
    contents = obj.read(data)
    text = obj.rewrite(data, contents.vertices + 1)
    again = obj.read(text)
    np.testing.assert_array_equal(again.vertices, contents.vertices + 1)
    np.testing.assert_array_equal(again.faces, contents.faces)
