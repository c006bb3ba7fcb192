"""Tricky files keep their order; bad ones get one sentence; none does harm."""

import gzip
import struct
from contextlib import nullcontext, suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from unbend import Mesh
from unbend.errors import FileError, InputError, MeshError, UnbendError
from unbend.io import read_mesh, write_mesh
from unbend.io._meshes import READ_SUFFIXES
from unbend.io.formats import ply, stl
from unbend.io.formats.contents import triangulate

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.1]], dtype=np.float64)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
QUICK = settings(
    deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def put(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


PLY_VERTEX = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
PLY_FACE = "element face 2\nproperty list uchar int vertex_indices\n"
POINTS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
TWO = "3 0 1 2\n3 0 2 3\n"
ASCII = "ply\nformat ascii 1.0\n"

# Each of these is the square of POINTS, in order, split into TRIANGLES.
SAME_SQUARE = {
    "plain.off": f"OFF\n4 2 0\n{POINTS}{TWO}",
    "no_edge_count.off": f"OFF\n4 2\n{POINTS}{TWO}",
    "one_line.off": f"OFF 4 2 0\n{POINTS}{TWO}",
    "glued.off": f"OFF4 2 0\n{POINTS}{TWO}",
    "windows.off": f"OFF\n4 2 0\n{POINTS}{TWO}".replace("\n", "\r\n"),
    "old_mac.off": f"OFF\n4 2 0\n{POINTS}{TWO}".replace("\n", "\r"),
    "bom.off": f"\ufeffOFF\n4 2 0\n{POINTS}{TWO}",
    "comments.off": f"# COFF by hand\n\nOFF # it is\n 4 2 0\n# points\n{POINTS}\n#\n{TWO}# end",
    "latin1.off": f"# cr\xe9\xe9\nOFF\n4 2 0\n{POINTS}{TWO}".encode("latin-1"),
    "colours.off": "COFF\n4 2 0\n" + POINTS.replace("\n", " 255 0 0 255\n") + TWO,
    "normals.off": "NOFF\n4 2 0\n" + POINTS.replace("\n", " 0 0 1\n") + TWO,
    "meshlab.off": "NCSTOFF\n4 2 0\n" + POINTS.replace("\n", " 0 0 1 9 9 9 255 0.5 1\n") + TWO,
    "face_colours.off": f"OFF\n4 2 0\n{POINTS}" + TWO.replace("\n", " 10 20 30\n"),
    "quad.off": f"OFF\n4 1 0\n{POINTS}4 0 1 2 3\n",
    "plain.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n",
    "blank.obj": "# square\n\nv 0 0 0\nv 1 0 0\n\n \nv 1 1 0\nv 0 1 0\nf 1 2 3\n\nf 1 3 4\n",
    "textured.obj": (
        "mtllib a.mtl\no square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .5 .5\nvn 0 0 1\nvn 0 0 -1\ns off\nusemtl red\n"
        "f 1/5/2 2/1/1 3/3/1\nf 1/2/1 3/4/2 4/1/1\n"
    ),
    "normals.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\n"
        "f 1//1 2//1 3//1\nf 1//1 3//1 4//1",
    "negative.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf -4/1 -2/1 -1/1\n",
    "colours.obj": "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 1 1 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3 4\n",
    "continued.obj": "v 0 0 \\\n0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 \\\r\n 3 4 # quad\n",
    "folder_in_a_comment.obj": (
        "v 0 0 0\n# from C:\\shapes\\\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 \\\n4\n"
    ),
    "faces_first.obj": "f 1 2 3\nf 1 3 4\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n",
    "plain.ply": f"{ASCII}{PLY_VERTEX}{PLY_FACE}end_header\n{POINTS}{TWO}",
    "bom.ply": f"\ufeff{ASCII}{PLY_VERTEX}{PLY_FACE}end_header\n{POINTS}{TWO}",
    "windows.ply": f"{ASCII}{PLY_VERTEX}{PLY_FACE}end_header\n{POINTS}{TWO}".replace("\n", "\r\n"),
    "quad.ply": f"{ASCII}{PLY_VERTEX}{PLY_FACE}end_header\n{POINTS}4 0 1 2 3\n".replace(
        "face 2", "face 1"
    ),
    "colours_first.ply": (
        f"{ASCII}comment by hand\nelement vertex 4\nproperty uchar red\nproperty double z\n"
        f"property double y\nproperty double x\n{PLY_FACE}end_header\n"
        "9 0 0 0\n9 0 0 1\n9 0 1 1\n9 0 1 0\n" + TWO
    ),
    "texture.ply": (
        f"{ASCII}{PLY_VERTEX}property float s\nproperty float t\nelement face 2\n"
        "property uchar flags\nproperty list uchar float texcoord\n"
        "property list uchar int vertex_index\nend_header\n"
        + POINTS.replace("\n", " 0 0\n")
        + "7 6 0 0 1 0 1 1 3 0 1 2\n7 6 0 0 .5 1 0 1 3 0 2 3\n"
    ),
    "more_elements.ply": (
        f"{ASCII}element camera 1\nproperty list uchar int view\nproperty float zoom\n"
        f"{PLY_VERTEX}{PLY_FACE}element edge 1\nproperty int vertex1\nend_header\n"
        f"2 5 6 1.5\n{POINTS}{TWO}0\n"
    ),
}  # fmt: skip


def binary_square(order: str, kind: str, quad_and_list: bool = False) -> bytes:
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    real = {"f": "float32", "d": "double"}[kind]
    header = f"ply\nformat {name} 1.0\n" + PLY_VERTEX.replace("float", real)
    if quad_and_list:  # lists of different lengths before the one that matters
        header += "element face 2\nproperty list uchar short tags\n"
        header += "property list int uint vertex_index\nproperty uchar flag\nend_header\n"
        faces = struct.pack(f"{order}BhiIIIB", 1, 5, 3, 0, 1, 2, 0)
        faces += struct.pack(f"{order}BhhiIIIB", 2, 5, 6, 3, 0, 2, 3, 0)
    else:
        header += PLY_FACE + "end_header\n"
        faces = struct.pack(f"{order}BiiiBiii", 3, 0, 1, 2, 3, 0, 2, 3)
    points = np.array(POINTS.split(), dtype=f"{order}f{8 if kind == 'd' else 4}")
    return header.encode() + points.tobytes() + faces


for _order in "<>":
    for _kind in "fd":
        for _ragged in (False, True):
            _name = f"{'big' if _order == '>' else 'little'}_{_kind}_{_ragged}.ply"
            SAME_SQUARE[_name] = binary_square(_order, _kind, _ragged)


WIDTHS = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
          "float": "f4", "double": "f8"}  # fmt: skip


LONG = np.finfo(np.longdouble).max > np.finfo(np.float64).max


class AnyPly:
    """A PLY file of any layout that the format allows, and what is in it."""

    def __init__(self, seed: int, encoding: str) -> None:
        self.draw = np.random.default_rng(seed)
        self.order = "" if encoding == "ascii" else "<" if "little" in encoding else ">"
        self.vertices = self.draw.integers(-50, 50, (self.draw.integers(1, 9), 3))
        self.n_corners = 0 if self.draw.random() < 0.3 else self.draw.integers(2, 5)
        self.faces: list[list[int]] = []
        self.rows: list[bytes] = []
        elements = ["vertex", "face", "camera", "nothing"]
        order = [elements[i] for i in self.draw.permutation(4)]
        lists = order.index("vertex"), order.index("face")
        if lists[0] > lists[1] and self.draw.random() < 0.8:
            order[lists[0]], order[lists[1]] = "face", "vertex"
        header = "".join(self.element(name) for name in order)
        self.header = f"ply\nformat {encoding} 1.0\n{header}end_header\n".encode()
        self.data = self.header + b"".join(self.rows)

    def element(self, name: str) -> str:
        counts = {"vertex": len(self.vertices), "nothing": 2}
        count = counts.get(name, int(self.draw.integers(0, 4)))
        extra = ["a", "b", "l"][: 0 if name == "nothing" else self.draw.integers(0, 4)]
        own = {"vertex": ["x", "y", "z"], "face": ["vertex_indices"]}.get(name, [])
        names = [[*own, *extra][i] for i in self.draw.permutation(len(own) + len(extra))]
        sizes = {one: self.kind("uchar char ushort short int uint") for one in names}
        kinds = {one: self.kind("float double" if one in "xyz" else "uint int") for one in names}
        length = self.draw.integers(0, 3) if name == "vertex" or self.draw.random() < 0.5 else None
        for row in range(count):
            for one in names:
                if one in "xyz":
                    self.put([self.vertices[row]["xyz".index(one)]], kinds[one])
                elif one == "vertex_indices":
                    size = self.n_corners or self.draw.integers(0, 6)
                    if row == 1 and not self.n_corners and sizes[one][0] == "u":
                        size = 200  # more than a signed byte counts
                    self.faces.append(self.draw.integers(0, len(self.vertices), size).tolist())
                    self.put([size], sizes[one])
                    self.put(self.faces[-1], kinds[one])
                elif one == "l":
                    size = self.draw.integers(0, 4) if length is None else length
                    self.put([size], sizes[one])
                    self.put(self.draw.integers(0, 99, size), kinds[one])
                else:
                    self.put([7], kinds[one])
            if not self.order:
                self.rows.append(b"\n")
        if not self.order and not names:
            self.rows.append(b"\n" * count)
        text = f"element {name} {count}\n"
        for one in names:
            listed = f"list {sizes[one]} " if one in ("l", "vertex_indices") else ""
            text += f"property {listed}{kinds[one]} {one}\n"
        return text

    def kind(self, names: str) -> str:
        return str(self.draw.choice(names.split()))

    def put(self, values: object, kind: str) -> None:
        if self.order:
            self.rows.append(np.array(values, self.order + WIDTHS[kind]).tobytes())
        else:
            self.rows.append("".join(f" {value}" for value in values).encode())


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_of_any_layout(encoding: str) -> None:
    for seed in range(60):
        made = AnyPly(seed, encoding)
        found = ply.read(made.data)
        np.testing.assert_array_equal(found.vertices, made.vertices)
        sizes = np.array([len(face) for face in made.faces], dtype=np.int64)
        corners = np.concatenate([[], *made.faces]).astype(np.int64)
        faces, _ = triangulate(sizes, corners, found.vertices)
        np.testing.assert_array_equal(found.faces, faces, str(seed))
        rows = b"".join(made.rows)
        if encoding == "ascii":
            ends = [i for i in range(len(rows)) if rows[i : i + 1] == b"\n" and rows[:i].strip()]
            needed = len(rows.rstrip()) if rows.strip() else 0
        else:
            ends, needed = list(range(0, len(rows), 3)), len(rows)
        for end in [end for end in ends if end < needed]:
            with pytest.raises(FileError, match=r"truncated|fewer"):
                ply.read(made.header + rows[:end])


def areas_along_x(mesh: Mesh) -> np.ndarray:
    """Areas of the triangles of a mesh in a plane across x, negative if they face -x."""
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    return np.cross(b - a, c - a)[:, 0] / 2


class TestTrickyFiles:
    @pytest.mark.parametrize("name", SAME_SQUARE)
    def test_order_survives(self, tmp_path: Path, name: str) -> None:
        mesh = read_mesh(put(tmp_path, name, SAME_SQUARE[name]))
        np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
        np.testing.assert_array_equal(mesh.faces, TRIANGLES)

    def test_polygons_are_split_in_order_and_noted(self, tmp_path: Path) -> None:
        text = "OFF\n5 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n-1 .5 0\n3 1 2 3\n5 0 1 2 3 4\n4 3 2 1 0\n"
        mesh = read_mesh(put(tmp_path, "m.off", text))
        expected = [[1, 2, 3], [0, 1, 2], [0, 2, 3], [0, 3, 4], [3, 2, 1], [3, 1, 0]]
        np.testing.assert_array_equal(mesh.faces, expected)
        assert mesh.notes == ("2 polygons split into triangles",)

    @pytest.mark.parametrize("turn", range(5))
    @pytest.mark.parametrize("step", [1, -1])
    def test_concave_polygons_are_split_without_overlap(
        self, tmp_path: Path, turn: int, step: int
    ) -> None:
        corners = np.roll(np.arange(5), turn)[::step]
        text = "OFF\n5 1 0\n0 9 0\n0 9 4\n0 5 4\n0 8 2\n0 5 0\n5 " + " ".join(map(str, corners))
        mesh = read_mesh(put(tmp_path, "m.off", text))
        areas = areas_along_x(mesh) * step
        assert (areas > 0).all()
        assert areas.sum() == 10
        assert mesh.notes == ("1 polygon split into triangles",)

    def test_a_long_spiral_is_split_without_overlap(self, tmp_path: Path) -> None:
        angles = np.linspace(0, 15, 100)
        outer, inner = 2 + angles, 1 + angles
        radii = np.concatenate([outer, inner[::-1]])
        places = [radii * f(np.concatenate([angles, angles[::-1]])) for f in (np.cos, np.sin)]
        corners = np.column_stack([np.zeros(200), *places])
        x, y = places
        whole = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
        lines = [f"v {a} {b} {c}" for a, b, c in corners.tolist()]
        lines.append("f " + " ".join(str(i + 1) for i in range(200)))
        mesh = read_mesh(put(tmp_path, "m.obj", "\n".join(lines)))
        areas = areas_along_x(mesh)
        assert (areas * np.sign(whole) > 0).all()
        assert areas.sum() == pytest.approx(whole)
        assert mesh.n_faces == 198

    def test_a_turned_polygon_is_split_without_overlap(self) -> None:
        rectangle = np.array([[0, 3], [0, 0], [3, 0], [3, 3], [2, 3], [2, 2], [1, 2], [1, 3]])
        flat = np.column_stack([rectangle, np.zeros(8)])
        for seed in range(50):
            turned = flat @ np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0].T
            faces, notes = triangulate(np.array([8]), np.arange(8), turned)
            areas = np.linalg.norm(np.cross(*np.diff(turned[faces], axis=1).swapaxes(0, 1)), axis=1)
            assert areas.sum() / 2 == pytest.approx(8)
            assert notes == ["1 polygon split into triangles"]

    def test_a_polygon_that_crosses_itself_is_noted(self, tmp_path: Path) -> None:
        text = "OFF\n4 1 0\n0 0 0\n4 4 0\n4 0 0\n0 5 0\n4 0 1 2 3\n"
        mesh = read_mesh(put(tmp_path, "m.off", text))
        assert mesh.n_faces == 2
        assert mesh.notes[1] == "1 polygon split into triangles that overlap"

    def test_lines_among_the_faces_are_left_out_and_noted(self, tmp_path: Path) -> None:
        mesh = read_mesh(put(tmp_path, "m.off", f"OFF\n4 3 0\n{POINTS}2 0 1\n{TWO}"))
        np.testing.assert_array_equal(mesh.faces, TRIANGLES)
        assert mesh.notes == ("1 face with fewer than 3 vertices left out",)

    def test_lines_after_the_last_face_are_noted(self, tmp_path: Path) -> None:
        mesh = read_mesh(put(tmp_path, "m.off", f"OFF\n4 2 0\n{POINTS}{TWO}3 1 2 3\n"))
        np.testing.assert_array_equal(mesh.faces, TRIANGLES)
        assert mesh.notes == ("1 line after the last face left out",)

    @pytest.mark.parametrize("binary", [False, True])
    def test_rows_after_the_last_of_a_ply_are_noted(self, tmp_path: Path, binary: bool) -> None:
        encoding = "binary_little_endian" if binary else "ascii"
        header = ply_header(4, 1, encoding).encode()
        points = SQUARE.astype("<f4").tobytes() if binary else POINTS.encode()
        faces = [b"\3" + one.astype("<i4").tobytes() for one in TRIANGLES]
        rows = faces if binary else [f"{line}\n".encode() for line in TWO.splitlines()]
        padding = b"\n\0\0" if binary else b"\n \n"
        mesh = read_mesh(put(tmp_path, "m.ply", header + points + rows[0] + padding))
        assert mesh.notes == ()
        mesh = read_mesh(put(tmp_path, "m.ply", header + points + b"".join(rows)))
        assert mesh.n_faces == 1
        left = "13 bytes" if binary else "1 line"
        assert mesh.notes == (f"{left} after the last row left out",)

    def test_bytes_after_the_last_triangle_of_an_stl_are_noted(self, tmp_path: Path) -> None:
        facet = bytes(12) + np.eye(3, dtype="<f4").tobytes() + bytes(2)
        head = bytes(80) + struct.pack("<I", 1)
        mesh = read_mesh(put(tmp_path, "m.stl", head + facet + facet))
        assert mesh.n_faces == 1
        assert mesh.notes[1:] == ("50 bytes after the last triangle left out",)
        assert len(read_mesh(put(tmp_path, "m.stl", head + facet + bytes(9))).notes) == 1

    def test_text_stl_in_capitals(self, tmp_path: Path) -> None:
        corners = "VERTEX 0 0 0\nVERTEX 1 0 0\nVERTEX 1 1 0\n"
        text = f"SOLID\nFACET NORMAL 0 0 1\nOUTER LOOP\n{corners}ENDLOOP\nENDFACET\nENDSOLID\n"
        for content in (text, f"\ufeff{text}"):
            mesh = read_mesh(put(tmp_path, "m.stl", content))
            assert (mesh.n_faces, len(mesh.notes)) == (1, 1)

    def test_unknown_obj_lines_are_noted(self, tmp_path: Path) -> None:
        mesh = read_mesh(put(tmp_path, "m.obj", "v 0 0 0\nw 1 0 0\nv 1 1 0\n"))
        assert mesh.n_vertices == 2
        assert mesh.notes[-1] == "1 line that OBJ does not know left out"

    def test_an_obj_without_faces_is_noted(self, tmp_path: Path) -> None:
        """A file that ends too early has none, and would pass for a cloud in silence."""
        mesh = read_mesh(put(tmp_path, "m.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0"))
        assert mesh.notes == ("there are no faces: taken as a point cloud",)

    def test_text_stl_with_two_solids(self, tmp_path: Path) -> None:
        facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 {z}\nvertex 1 0 {z}\nvertex 0 1 0\n"
        solid = "SOLID a\n" + facet + "endloop\nendfacet\nendsolid a\n"
        mesh = read_mesh(put(tmp_path, "m.stl", solid.format(z=0) + solid.format(z=1)))
        np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [3, 4, 2]])

    def test_binary_stl_that_starts_like_text(self, tmp_path: Path) -> None:
        write_mesh(tmp_path / "m.stl", (SQUARE, TRIANGLES))
        data = (tmp_path / "m.stl").read_bytes()
        mesh = read_mesh(put(tmp_path, "m.stl", b"solid facet " + data[12:]))
        assert mesh.n_faces == 2

    def test_binary_stl_of_the_largest_positions(self, tmp_path: Path) -> None:
        far = SQUARE * np.finfo(np.float32).max
        write_mesh(tmp_path / "m.stl", (far[:3], TRIANGLES[:1]))
        data = (tmp_path / "m.stl").read_bytes()
        assert data[84:96] == bytes(12)  # no normal, so that programs compute it
        assert data[132:] == bytes(2)
        for more in (b"", b"more"):
            mesh = read_mesh(put(tmp_path, "m.stl", data + more))
            np.testing.assert_array_equal(mesh.vertices, far[:3])
        with pytest.raises(InputError, match="single-precision"):
            write_mesh(tmp_path / "m.stl", (far[:3] * 1.01, TRIANGLES[:1]))

    def test_xyz_with_commas_and_normals(self, tmp_path: Path) -> None:
        mesh = read_mesh(put(tmp_path, "m.xyz", "# x,y,z\n0,0,0\n1, 2, 3\n4 5 6 0 0 1\n"))
        np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 2, 3], [4, 5, 6]])
        assert mesh.notes == ("columns after the third left out",)
        assert read_mesh(put(tmp_path, "m.xyz", "0 0 0\n1 2 3\n")).notes == ()
        assert read_mesh(put(tmp_path, "m.xyz", "0 0 0 7\n1 2 3 8\n")).notes == mesh.notes

    def test_npy_with_normals(self, tmp_path: Path) -> None:
        points = np.arange(24.0).reshape(4, 6)
        np.save(tmp_path / "p.npy", points)
        mesh = read_mesh(tmp_path / "p.npy")
        np.testing.assert_array_equal(mesh.vertices, points[:, :3])
        assert mesh.notes == ("columns after the third left out",)

    def test_npy_of_numbers_that_float64_has_not(self, tmp_path: Path) -> None:
        np.save(tmp_path / "p.npy", np.full((2, 3), np.finfo(np.longdouble).max))
        with pytest.raises(MeshError, match="vertex 0 is at") if LONG else nullcontext():
            read_mesh(tmp_path / "p.npy")
        np.save(tmp_path / "p.npy", np.full((2, 3), 0x7F800001, "<u4").view("<f4"))
        with pytest.raises(MeshError, match="vertex 0 is at"):
            read_mesh(tmp_path / "p.npy")

    def test_nan_rows_that_no_face_uses(self, tmp_path: Path) -> None:
        vertices = np.vstack([SQUARE, [[np.nan] * 3]])
        for suffix in (".off", ".obj", ".ply"):
            write_mesh(tmp_path / f"m{suffix}", (vertices, TRIANGLES))
            np.testing.assert_array_equal(read_mesh(tmp_path / f"m{suffix}").vertices, vertices)

    @pytest.mark.parametrize("entries", [b"\0", b"\2\7\7"])
    def test_a_list_may_end_the_file(self, entries: bytes) -> None:
        header = (
            ply_header(1).split("element face")[0] + "property list uchar uchar l\nend_header\n"
        )
        point = np.array([1, 2, 3], "<f4").tobytes()
        assert ply.read(header.encode() + point + entries).vertices.tolist() == [[1, 2, 3]]

    def test_nan_of_every_kind(self) -> None:
        signalling = np.array([0x7F800001, 0, 0], "<u4").tobytes()
        header = ply_header(1).split("element face")[0] + "end_header\n"
        assert np.isnan(ply.read(header.encode() + signalling).vertices[0, 0])
        facet = bytes(12) + 3 * signalling + bytes(2)
        with pytest.raises(MeshError, match="triangle 0 has a corner that is not at a finite"):
            stl.read(bytes(80) + struct.pack("<I", 1) + facet)


def ply_header(vertices: object, faces: object = 0, encoding: str = "binary_little_endian") -> str:
    text = f"ply\nformat {encoding} 1.0\n{PLY_VERTEX}{PLY_FACE}end_header\n"
    return text.replace("vertex 4", f"vertex {vertices}").replace("face 2", f"face {faces}")


BAD_FILES = {
    "empty.off": (b"", "is empty"),
    "blank.obj": (b" \n\n", "is empty"),
    "packed.stl": (gzip.compress(bytes(134)), "is compressed with gzip; unpack it first"),
    "packed.ply": (gzip.compress(b"ply"), "is compressed with gzip; unpack it first"),
    "comments.off": (b"# nothing\n", "nothing but comments"),
    "junk.off": (b"\x00\x01\x02\xff", "binary data"),
    "junk.obj": (bytes(range(1, 250)), "no line of it starts with v"),
    "junk.ply": (b"\x00\x01\x02\xff", "not a PLY file"),
    "junk.stl": (b"\x00\x01\x02\xff", "not an STL file"),
    "junk.npy": (b"\x00\x01\x02\xff", "not a NumPy array file"),
    "junk.xyz": (b"\x01\x02\xff\xff", "point 0 has 1 numbers instead of 3"),
    "decimal_commas.xyz": (b"0 0 0\n0,5 1 2,25\n", "point 1 holds '0,5 1 2,25'"),
    "numbered.xyz": (b"".join(b"%d 0 1 2\n" % i for i in range(1, 11)), "numbers the points"),
    "decimal_pair.xyz": (b"0,5 1\n", "point 0 holds '0,5 1'"),
    "decimal_semicolons.xyz": (b"0,5;1,5;2,5\n", "write decimal points"),
    "utf16.off": ("OFF\n4 2 0\n".encode("utf-16"), "UTF-16"),
    "latin1.off": (b"OFF\n1 0 0\n0 0 \xe9\n", "vertex 0 holds '\ufffd', not a number"),
    "header.off": (b"OFF\n4\n", "lacks the line"),
    "words.off": (b"OFF\nfour 2 0\n", "'four' is not a number of vertices"),
    "minus.off": (b"OFF\n-4 2 0\n", "'-4' is not a number of vertices"),
    "hostile.off": (b"OFF\n2000000000 2 0\n", "promises 2,000,000,000 vertices"),
    "binary.off": (b"OFF BINARY\n\0\0\0\4", "binary OFF"),
    "commented.off": (b"# made elsewhere\nOFF BINARY\n\0\0\0\4", "binary OFF"),
    "four.off": (b"4OFF\n1 0 0\n0 0 0 1\n", "not three-dimensional"),
    "cut.off": (f"OFF\n4 2 0\n{POINTS}3 0 1 2\n", "truncated"),
    "short.off": (f"OFF\n4 2 0\n{POINTS}3 0 1 2\n3 0 2\n", "face 1 promises 3 vertices"),
    "word.off": (f"OFF\n4 2 0\n{POINTS}3 0 1 2\n3 0 2 x\n", "face 1 holds 'x', not a vertex"),
    "word_quad.off": (f"OFF\n4 2 0\n{POINTS}4 0 1 2 3\n3 0 2 1.5\n", "face 1 holds '1.5'"),
    "size.off": (f"OFF\n4 2 0\n{POINTS}3 0 1 2\nx 0 2 3\n", "face 1 holds 'x', not a number of"),
    "python_count.off": (b"OFF\n1_0 0 0\n", "'1_0' is not a number of vertices"),
    "python.off": (b"OFF\n1 0 0\n0 1_0 0\n", "vertex 0 holds '1_0', not a number"),
    "python_index.off": (f"OFF\n4 1 0\n{POINTS}3 0 0_1 2\n", "face 0 holds '0_1', not a vertex"),
    "python_quad.off": (f"OFF\n4 1 0\n{POINTS}4 0 0_1 2 3\n", "face 0 holds '0_1', not a vertex"),
    "python.obj": (b"v 0 0 0\nf 1 0_1 1\n", "face 0 holds '1 0_1 1', not vertex indices"),
    "second.off": (f"OFF\n4 2 0\n{POINTS}4 0 1 2 {'9' * 18}\n3 0 2 x\n", "face 1 holds 'x'"),
    "64_bits.off": (f"OFF\n4 1 0\n{POINTS}4 0 1 2 {'9' * 19}\n", "face 0 holds '99999"),
    "flat.off": (b"OFF\n2 0 0\n0 0 0\n1 2\n", "vertex 1 has 2 numbers"),
    "none.off": (b"OFF\n0 0 0\n", "holds no vertices"),
    "huge_index.off": (f"OFF\n4 1 0\n{POINTS}3 0 1 {'9' * 30}\n", "face 0 holds '99999"),
    "word.obj": (b"v 0 0 0\nf 1 a 1\n", "face 0 holds '1 a 1', not vertex indices"),
    "flat.obj": (b"v 0 0 0\nv 1 2\n", "vertex 1 has 2 numbers"),
    "hostile.ply": (ply_header(2_000_000_000), "2,000,000,000 vertex rows, but holds 0 bytes"),
    "hostile_text.ply": (ply_header(2_000_000_000, 0, "ascii"), "but holds 0 lines"),
    "hostile_faces.ply": (ply_header(1, 10**18) + "x" * 40, "it promises 1,000,000,000,000,"),
    "astronomic.ply": (ply_header("9" * 5000), "is not a number of vertex rows"),
    "negative.ply": (ply_header(-1), "'-1' is not a number of vertex rows"),
    "headless.ply": (b"ply\nformat ascii 1.0\n", "no line end_header"),
    "formatless.ply": (f"ply\n{PLY_VERTEX}end_header\n", "no format line"),
    "type.ply": (ply_header(1).replace("float x", "quad x"), "header line that PLY does not know"),
    "twice.ply": (ply_header(1).replace("float y", "float x"), "twice"),
    "no_z.ply": (ply_header(0).replace("vertex 0", "vertex 1").replace("float z", "float w"),
                 "without the properties x, y and z"),
    "no_list.ply": (ply_header(1, 1).replace("vertex_indices", "corners"), "vertex_indices"),
    "float_list.ply": (ply_header(1, 1).replace("uchar int", "uchar float"), "whole numbers"),
    "strips.ply": (ply_header(1, 1).replace("element face", "element tristrips"), "strips"),
    "faces_and_strips.ply": (
        ply_header(1, 1).replace(
            "end_", "element tristrips 1\nproperty list int int vertex_indices\nend_"),
        "strips"),
    "list.ply": (ply_header(1).replace("float y", "list uchar float y"), "without the properties"),
    "two_lists.ply": (
        ply_header(1, 1).replace("end_", "property list uchar int vertex_index\nend_"),
        "faces with both vertex_indices and vertex_index"),
    "no_strips.ply": (ply_header(0).replace("element face", "element tristrips"), "no vertices"),
    "camera_twice.ply": (ply_header(1).replace("end_", "element face 3\nend_"), "face twice"),
    "vertexless.ply": (ply_header(0), "holds no vertices"),
    "cut_rows.ply": (binary_square("<", "f", True)[:-3], "truncated or damaged"),
    "minus.ply": (  # after a triangle, a polygon of -1 corners and many bytes
        ply_header(1, 2).replace("uchar int", "char uchar").encode()
        + bytes(12) + b"\3\0\0\0\xff" + bytes(300), "truncated or damaged"),
    "ragged_vertices.ply": (
        ply_header(2).replace("element face", "property list uchar uchar l\nelement face").encode()
        + bytes(12) + b"\0" + bytes(12) + b"\1\0", "vertices with lists of different lengths"),
    "row.ply": (f"{ASCII}element vertex 1\nproperty int a\nproperty int x\nproperty int y\n"
                "property int z\nend_header\n1 2 3\n", "vertex 0 has fewer numbers"),
    "cut.stl": (b" " * 80 + struct.pack("<I", 9) + b"x" * 60, "promises 9 triangles, 534 bytes"),
    "cut_text.stl": (b"solid\nfacet normal 0 0 0\nvertex 0 0 0\n", "last line is not endsolid"),
    "corners.stl": (b"solid\nfacet\nvertex 0 0 0\nendfacet\nendsolid", "1 facet but 1 corner"),
    "facets.stl": (b"vertex 0 0 0\nendfacet\nendsolid" + bytes(80), "not an STL file"),
    "nothing.stl": (b"solid\nendsolid", "no triangles"),
    "cut.npy": (b"", "is empty"),
}  # fmt: skip


class TestBadFiles:
    @pytest.mark.parametrize("name", BAD_FILES)
    def test_one_sentence_that_names_the_file(self, tmp_path: Path, name: str) -> None:
        content, sentence = BAD_FILES[name]
        with pytest.raises(FileError) as caught:
            read_mesh(put(tmp_path, name, content))
        assert sentence in str(caught.value)
        assert name in str(caught.value)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize(
        ("name", "content", "sentence"),
        [
            ("a.off", f"OFF\n4 2 0\n{POINTS}3 0 1 2\n3 0 2 4\n", "face 1 names vertex 4"),
            ("a.off", f"OFF\n4 2 0\n{POINTS}4 0 1 2 3\n3 0 2 -1\n", "face 1 names vertex -1"),
            ("a.off", f"OFF\n4 2 0\n{POINTS}4 0 1 2 3\n3 4 0 1\n", "face 1 names vertex 4"),
            ("a.off", f"OFF\n4 1 0\n{POINTS.replace('1 1', 'nan 1')}3 0 1 2\n", "vertex 2 is at"),
            ("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 0\n", "face 0 names vertex 0"),
            ("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 2\nf 1 2 3\n", "face 1 names vertex 3"),
            ("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 2\nf 3 1 1\n", "face 1 names vertex 3"),
            ("a.obj", f"v 0 0 0\nf 1 1 {2**63}\n", f"face 0 names vertex {2**63}"),
            ("a.obj", f"v 0 0 0\nf 1 1 {2**64}\n", f"face 0 names vertex {2**64}"),
            ("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 -3\n", "face 0 names vertex -3"),
            ("a.xyz", "0 0 0\ninf 0 0\n", "vertex 1 is at (inf, 0, 0)"),
        ],
    )
    def test_bad_meshes_name_the_place(
        self, tmp_path: Path, name: str, content: str, sentence: str
    ) -> None:
        with pytest.raises(MeshError, match=r"^a\.\w+: ") as caught:
            read_mesh(put(tmp_path, name, content))
        assert sentence in str(caught.value)

    def test_npy_of_the_wrong_kind(self, tmp_path: Path) -> None:
        for array in (np.zeros((3, 2)), np.zeros(3), np.array([["a"] * 3]), np.zeros((1, 3)) * 1j):
            np.save(tmp_path / "p.npy", array)
            with pytest.raises(FileError, match="holds an array of shape"):
                read_mesh(tmp_path / "p.npy")

    def test_npy_that_promises_too_much(self, tmp_path: Path) -> None:
        np.save(tmp_path / "p.npy", np.zeros((100, 3)))
        data = (tmp_path / "p.npy").read_bytes()[:-10]
        with pytest.raises(FileError, match="promises 100 rows, 2,400 bytes, but 2,390"):
            read_mesh(put(tmp_path, "p.npy", data))


def good_files() -> dict[str, bytes]:
    contents = {k: v if isinstance(v, bytes) else v.encode() for k, v in SAME_SQUARE.items()}
    contents["m.xyz"] = POINTS.encode()
    contents["m.stl"] = b" " * 80 + struct.pack("<I", 1) + bytes(50)
    contents["text.stl"] = (
        b"solid\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendfacet\nendsolid"
    )
    header = b"\x93NUMPY\x01\x00\x46\x00{'descr': '<f8', 'fortran_order': False, 'shape': (1, 3), }"
    contents["m.npy"] = header.ljust(79) + b"\n" + bytes(24)
    return contents


GOOD_FILES = good_files()


@settings(QUICK, max_examples=250)
@given(data=st.data())
def test_damaged_files_never_break_anything_but_the_file(
    tmp_path: Path, data: st.DataObject
) -> None:
    name = data.draw(st.sampled_from(sorted(GOOD_FILES)))
    content = bytearray(GOOD_FILES[name])
    for _ in range(data.draw(st.integers(0, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    del content[data.draw(st.integers(0, len(content))) or len(content) :]
    sentence = ""
    try:
        assert isinstance(read_mesh(put(tmp_path, name, bytes(content))), Mesh)
    except UnbendError as error:
        sentence = str(error)
    assert "\n" not in sentence


@pytest.mark.parametrize("suffix", READ_SUFFIXES)
@settings(QUICK)
@given(content=st.binary(max_size=300))
@example(content=b"\x93NUMPY\x01\x00\x10\x00{'descr': [[[[[[[")
def test_junk_is_refused_or_read(tmp_path: Path, suffix: str, content: bytes) -> None:
    with suppress(UnbendError):
        read_mesh(put(tmp_path, f"m{suffix}", content))
