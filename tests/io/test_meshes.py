"""Reading and writing meshes: order, count and bits survive."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from unbend import Mesh
from unbend.errors import FileError, InputError, UnbendWarning
from unbend.io import read_mesh, write_mesh
from unbend.io._meshes import READ_SUFFIXES
from unbend.io._writing import WRITE_SUFFIXES
from unbend.mesh import vertex_areas

FACE_SUFFIXES = (".off", ".obj", ".ply")  # those that keep vertices and faces exactly
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.1]], dtype=np.float64)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
QUICK = settings(
    deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@st.composite
def meshes(draw: st.DrawFn, with_faces: bool = True) -> Mesh:
    n = draw(st.integers(1, 12))
    finite = st.floats(allow_nan=False, allow_infinity=False)
    vertices = draw(hnp.arrays(np.float64, (n, 3), elements=finite))
    if not with_faces:
        return Mesh(vertices)
    m = draw(st.integers(1, 12))
    faces = draw(hnp.arrays(np.int64, (m, 3), elements=st.integers(0, n - 1)))
    unused = np.setdiff1d(np.arange(n), faces)
    vertices[unused[: draw(st.integers(0, 3))]] = np.nan
    return Mesh(vertices, faces)


class TestRoundTrip:
    @pytest.mark.parametrize("suffix", FACE_SUFFIXES)
    @QUICK
    @given(mesh=meshes())
    def test_every_bit_and_every_index_survives(
        self, tmp_path: Path, suffix: str, mesh: Mesh
    ) -> None:
        write_mesh(tmp_path / f"m{suffix}", mesh)
        back = read_mesh(tmp_path / f"m{suffix}")
        np.testing.assert_array_equal(back.vertices, mesh.vertices)
        np.testing.assert_array_equal(np.signbit(back.vertices), np.signbit(mesh.vertices))
        np.testing.assert_array_equal(back.faces, mesh.faces)
        assert back.notes == ()

    @pytest.mark.parametrize("suffix", [".off", ".obj", ".ply", ".xyz"])
    @QUICK
    @given(mesh=meshes(with_faces=False))
    def test_point_clouds_survive(self, tmp_path: Path, suffix: str, mesh: Mesh) -> None:
        write_mesh(tmp_path / f"m{suffix}", mesh)
        back = read_mesh(tmp_path / f"m{suffix}")
        assert back.is_point_cloud
        np.testing.assert_array_equal(back.vertices, mesh.vertices)

    @QUICK
    @given(
        corners=hnp.arrays(
            np.float32,
            st.tuples(st.integers(1, 6), st.just(3), st.just(3)),
            elements=st.floats(-2, 2, width=16),
        )
    )
    def test_stl_keeps_every_triangle_even_degenerate_ones(
        self, tmp_path: Path, corners: np.ndarray
    ) -> None:
        mesh = Mesh(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
        write_mesh(tmp_path / "m.stl", mesh)
        back = read_mesh(tmp_path / "m.stl")
        if len(back.notes) == 1:
            np.testing.assert_array_equal(back.vertices[back.faces], corners)
        else:
            assert "divided at corners of other triangles" in back.notes[1]
            assert back.n_faces > mesh.n_faces
            np.testing.assert_allclose(vertex_areas(back).sum(), vertex_areas(mesh).sum())
        assert len(np.unique(back.vertices, axis=0)) == back.n_vertices
        kept, given = (np.unique(one.vertices + 0.0, axis=0) for one in (back, mesh))
        np.testing.assert_array_equal(kept, given)
        assert "welded" in back.notes[0]

    def test_a_cube_in_stl_has_its_vertices_in_order_of_appearance(self, tmp_path: Path) -> None:
        write_mesh(tmp_path / "m.stl", (SQUARE, TRIANGLES))
        back = read_mesh(tmp_path / "m.stl")
        np.testing.assert_array_equal(back.faces, TRIANGLES)
        np.testing.assert_allclose(back.vertices, SQUARE, rtol=1e-7)

    def test_npy_points(self, tmp_path: Path) -> None:
        for array in (SQUARE, SQUARE.astype(">f4"), np.asfortranarray(SQUARE), TRIANGLES):
            np.save(tmp_path / "p.npy", array)
            np.testing.assert_array_equal(read_mesh(tmp_path / "p.npy").vertices, array)

    def test_the_name_is_the_files(self, tmp_path: Path) -> None:
        write_mesh(tmp_path / "cat.off", (SQUARE, TRIANGLES))
        assert read_mesh(str(tmp_path / "cat.off")).name == "cat.off"

    def test_suffixes_in_capitals(self, tmp_path: Path) -> None:
        write_mesh(tmp_path / "cat.OFF", (SQUARE, TRIANGLES))
        assert read_mesh(tmp_path / "cat.OFF").n_faces == 2

    @pytest.mark.parametrize("suffix", FACE_SUFFIXES)
    def test_trimesh_reads_what_we_write(self, tmp_path: Path, suffix: str) -> None:
        trimesh = pytest.importorskip("trimesh")
        write_mesh(tmp_path / f"m{suffix}", (SQUARE / 3, TRIANGLES))
        other = trimesh.load(tmp_path / f"m{suffix}", process=False)
        np.testing.assert_array_equal(other.vertices, SQUARE / 3)
        np.testing.assert_array_equal(other.faces, TRIANGLES)

    def test_real_shapes(self, tmp_path: Path, real_data: Path) -> None:
        cat = read_mesh(real_data / "tosca_remeshed" / "cat0.off")
        assert (cat.n_vertices, cat.n_faces) == (5000, 9996)
        for suffix in FACE_SUFFIXES:
            write_mesh(tmp_path / f"m{suffix}", cat)
            back = read_mesh(tmp_path / f"m{suffix}")
            assert back.vertices.tobytes() == cat.vertices.tobytes()
            assert back.faces.tobytes() == cat.faces.tobytes()


class TestPaths:
    def test_missing(self, tmp_path: Path) -> None:
        with pytest.raises(FileError, match="no such file"):
            read_mesh(tmp_path / "missing.off")

    def test_folder(self, tmp_path: Path) -> None:
        with pytest.raises(FileError, match="it is a folder"):
            read_mesh(tmp_path)

    def test_closed(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def refuse(self: Path) -> bytes:
            raise PermissionError(13, "Permission denied")

        (tmp_path / "m.off").touch()
        monkeypatch.setattr(Path, "read_bytes", refuse)
        with pytest.raises(FileError, match=r"cannot read .*m\.off: Permission denied"):
            read_mesh(tmp_path / "m.off")

    @pytest.mark.parametrize("name", ["shape.jpg", "shape"])
    def test_unknown_suffixes_list_the_known_ones(self, tmp_path: Path, name: str) -> None:
        with pytest.raises(FileError) as caught:
            read_mesh(tmp_path / name)
        assert all(suffix in str(caught.value) for suffix in READ_SUFFIXES)

    @pytest.mark.parametrize(
        ("name", "advice"), [("a.vrm", "rename it"), ("a.FBX", "export it"), ("lh.surf", r"\.pial")]
    )
    def test_of_some_files_it_is_known_what_to_do(self, name: str, advice: str) -> None:
        with pytest.raises(FileError, match=f"unknown suffix .*; .*{advice}"):
            read_mesh(name)


class TestWriting:
    def test_scalars_and_colors_go_into_ply(self, tmp_path: Path) -> None:
        distance, colors = np.array([0, 0.1, np.nan, 3]), np.arange(12).reshape(4, 3)
        path = tmp_path / "m.ply"
        write_mesh(path, (SQUARE, TRIANGLES), scalars={"distance": distance}, colors=colors)
        back = read_mesh(path)
        np.testing.assert_array_equal(back.vertices, SQUARE)
        np.testing.assert_array_equal(back.faces, TRIANGLES)
        trimesh = pytest.importorskip("trimesh")
        other = trimesh.load(path, process=False)
        np.testing.assert_array_equal(other.visual.vertex_colors[:, :3], colors)
        raw = other.metadata["_ply_raw"]["vertex"]["data"]["distance"]
        np.testing.assert_array_equal(raw, distance)

    def test_colors_and_uvs_go_into_obj_and_ply(self, tmp_path: Path) -> None:
        colors, uvs = np.arange(12).reshape(4, 3), np.arange(8).reshape(4, 2) / 8
        for suffix in (".obj", ".ply"):
            path = tmp_path / f"m{suffix}"
            write_mesh(path, (SQUARE, TRIANGLES), colors=colors, uvs=uvs)
            back = read_mesh(path)
            np.testing.assert_array_equal(back.vertices, SQUARE)
            np.testing.assert_array_equal(back.faces, TRIANGLES)
        lines = [line.split() for line in (tmp_path / "m.obj").read_text().splitlines()]
        rows = [line[1:] for line in lines if line[0] == "v"]
        np.testing.assert_allclose(np.array(rows, float)[:, 3:], colors / 255)
        rows = [line[1:] for line in lines if line[0] == "vt"]
        np.testing.assert_array_equal(np.array(rows, float), uvs)
        assert ["f", *(f"{i + 1}/{i + 1}" for i in TRIANGLES[0])] in lines
        header, body = (tmp_path / "m.ply").read_bytes().split(b"end_header\n")
        assert b"property double s\nproperty double t\n" in header
        rows = np.frombuffer(body, [("xyz", "<f8", 3), ("st", "<f8", 2), ("rgb", "u1", 3)], 4)
        np.testing.assert_array_equal(rows["st"], uvs)
        np.testing.assert_array_equal(rows["rgb"], colors)

    @pytest.mark.parametrize("suffix", [s for s in WRITE_SUFFIXES if s not in (".ply", ".vtp")])
    def test_other_formats_refuse_them(self, tmp_path: Path, suffix: str) -> None:
        for keywords in ({"colors": np.zeros((4, 3), dtype=int)}, {"uvs": np.zeros((4, 2))}):
            if suffix not in (".obj", ".glb"):
                with pytest.raises(InputError, match=r"write \.ply"):
                    write_mesh(tmp_path / f"m{suffix}", SQUARE, **keywords)
        with pytest.raises(InputError, match=r"write \.ply"):
            write_mesh(tmp_path / f"m{suffix}", SQUARE, scalars={"d": np.zeros(4)})
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize(
        ("keywords", "sentence"),
        [
            ({"scalars": {"x": np.zeros(4)}}, "'x' cannot name values"),
            ({"scalars": {"two words": np.zeros(4)}}, "'two words' cannot name"),
            ({"scalars": {"s": np.ones(4)}, "uvs": np.zeros((4, 2))}, "'s' cannot name"),
            ({"scalars": {"color": np.ones(4)}, "colors": np.zeros((4, 3), int)}, "none of x"),
            ({"scalars": {"d": np.zeros(3)}}, "'d' have shape"),
            ({"colors": np.zeros((4, 3))}, "colors must be whole numbers"),
            ({"colors": np.full((4, 3), 256)}, "between 0 and 255"),
            ({"colors": np.diag([-1, 9, 9, 9])[:, :3]}, "between 0 and 255"),
            ({"colors": np.diag([256, 9, 9, 9])[:, :3]}, "between 0 and 255"),
            ({"uvs": np.full((4, 2), np.nan)}, "uvs must be finite"),
            ({"uvs": np.diag([np.nan, 1, 1, 1])[:, :2]}, "uvs must be finite"),
        ],
    )
    def test_bad_values(self, tmp_path: Path, keywords: dict[str, object], sentence: str) -> None:
        with pytest.raises(InputError, match=sentence):
            write_mesh(tmp_path / "m.ply", SQUARE, **keywords)  # type: ignore[arg-type]
        assert list(tmp_path.iterdir()) == []

    def test_xyz_refuses_faces_and_stl_refuses_points(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="points only"):
            write_mesh(tmp_path / "m.xyz", (SQUARE, TRIANGLES))
        with pytest.raises(InputError, match="triangles only"):
            write_mesh(tmp_path / "m.stl", SQUARE)

    def test_stl_refuses_what_single_precision_cannot_hold(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="single-precision"):
            write_mesh(tmp_path / "m.stl", (SQUARE * 1e300, TRIANGLES))
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("suffix", [".stl", ".glb"])
    def test_it_warns_where_single_precision_is_too_coarse(
        self, tmp_path: Path, suffix: str
    ) -> None:
        far = SQUARE + np.array([500_000.3, 4_500_000, 100])
        with pytest.warns(UnbendWarning, match=r"rounded to about 0\.5, and vertices are about 0"):
            write_mesh(tmp_path / f"m{suffix}", (far, TRIANGLES))
        write_mesh(tmp_path / f"m{suffix}", (np.rint(far), TRIANGLES))  # which it holds
        with pytest.warns(UnbendWarning, match="rounded to about 1e-45, and vertices"):
            write_mesh(tmp_path / f"m{suffix}", (SQUARE * 1e-50, TRIANGLES))
        write_mesh(tmp_path / "m.ply", (far, TRIANGLES))

    def test_the_suffix_is_checked_before_any_work(self, tmp_path: Path) -> None:
        with pytest.raises(FileError, match=r"unknown suffix \"\.jpg\"; use \.off, "):
            write_mesh(tmp_path / "m.jpg", "no mesh at all")
