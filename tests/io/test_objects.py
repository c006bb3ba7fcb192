"""Meshes of other programs, by their attributes; and of their files, where they are installed."""

import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from unbend import Mesh, as_mesh, diagnose, read_mesh, write_mesh
from unbend.errors import FileError, InputError, MissingExtraError
from unbend.io import read_values

QUAD = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
FACES = [[0, 1, 2], [0, 2, 3]]


def poly_data(n_strips: int = 0) -> SimpleNamespace:
    """What unbend asks a vtkPolyData for."""
    polygons = SimpleNamespace(
        GetOffsetsArray=lambda: np.array([0, 4]), GetConnectivityArray=lambda: np.arange(4)
    )
    return SimpleNamespace(
        GetNumberOfStrips=lambda: n_strips,
        GetPolys=lambda: polygons,
        GetPoints=lambda: SimpleNamespace(GetData=lambda: np.array(QUAD)),
    )


def block(kind, rows):
    return SimpleNamespace(type=kind, data=np.array(rows))


def meshio_like(points, *cells):
    return SimpleNamespace(points=np.array(points), cells=list(cells), cells_dict={})


@pytest.mark.parametrize(
    "given",
    [
        SimpleNamespace(vertices=QUAD, triangles=FACES, vertex_normals=[]),  # Open3D
        SimpleNamespace(vertices=QUAD, faces=FACES),  # trimesh
        meshio_like(QUAD, block("triangle", FACES)),
        meshio_like(QUAD, block("vertex", [[0]]), block("quad", [[0, 1, 2, 3]])),
        meshio_like([row[:2] for row in QUAD], block("triangle", FACES)),
        poly_data(),
    ],
)
def test_surfaces(given) -> None:
    mesh = as_mesh(given)
    np.testing.assert_array_equal(mesh.vertices, QUAD)
    np.testing.assert_array_equal(mesh.faces, FACES)


@pytest.mark.parametrize(
    "given",
    [
        SimpleNamespace(points=QUAD, estimate_normals=print),  # Open3D
        SimpleNamespace(vertices=QUAD, colors=[]),  # trimesh
    ],
)
def test_points(given) -> None:
    assert as_mesh(given).is_point_cloud


def test_tensors_of_open3d() -> None:
    legacy = SimpleNamespace(vertices=QUAD, triangles=FACES)
    mesh = as_mesh(SimpleNamespace(vertex={}, triangle={}, to_legacy=lambda: legacy))
    np.testing.assert_array_equal(mesh.faces, FACES)


def test_what_has_no_surface_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    volume = meshio_like(QUAD, block("tetra", [[0, 1, 2, 3]]))
    with pytest.raises(InputError, match="a mesh of tetra has no surface"):
        as_mesh(volume)
    monkeypatch.setattr("unbend.io._foreign.find_spec", lambda name: name)
    monkeypatch.setattr("unbend.io._foreign._by_meshio", lambda path: as_mesh(volume))
    (tmp_path / "a.msh").write_text("a solid")
    with pytest.raises(InputError, match=r"^a\.msh: a mesh of tetra has no surface"):
        read_mesh(tmp_path / "a.msh")
    volume.extract_surface = print  # PyVista's grids have cells_dict, too
    with pytest.raises(InputError, match=r"give its extract_surface\(\)"):
        as_mesh(volume)
    with pytest.raises(InputError, match="vtkTriangleFilter"):
        as_mesh(poly_data(n_strips=1))


def test_objects_of_the_programs_themselves() -> None:
    pyvista = pytest.importorskip("pyvista")
    surface = pyvista.PolyData(np.array(QUAD), faces=[4, 0, 1, 2, 3])
    np.testing.assert_array_equal(as_mesh(surface).faces, FACES)
    meshio = pytest.importorskip("meshio")
    given = meshio.Mesh(QUAD, [("polygon", [[0, 1, 2, 3]])])
    np.testing.assert_array_equal(as_mesh(given).faces, FACES)


def test_our_own_glb_comes_back(blob: Mesh, tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    write_mesh(tmp_path / "a.glb", blob)
    back = read_mesh(tmp_path / "a.glb")
    np.testing.assert_array_equal(back.vertices, blob.vertices.astype(np.float32))
    np.testing.assert_array_equal(back.faces, blob.faces)
    assert back.notes == ("read by trimesh",)


def test_a_scene_is_read_where_it_stands_and_is_one_along_its_seams(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    left = trimesh.Trimesh(QUAD, FACES, process=False)
    right = left.copy()
    scene = trimesh.Scene()
    scene.add_geometry(left)
    scene.add_geometry(right, transform=trimesh.transformations.translation_matrix([1, 0, 0]))
    scene.export(tmp_path / "a.glb")
    mesh = read_mesh(tmp_path / "a.glb")
    assert (mesh.n_vertices, mesh.n_faces) == (8, 4)
    assert diagnose(mesh).component_vertices == (6,)  # two are shared
    assert mesh.vertices[:, 0].max() == 2


def test_texture_coordinates_may_differ_at_seams(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    image = pytest.importorskip("PIL.Image").new("RGB", (2, 2))
    corners = np.ravel(FACES)
    uvs = np.array(QUAD)[corners, :2] / 2
    uvs[[0, 2]] += 0.5  # two corners of the diagonal
    visual = trimesh.visual.TextureVisuals(uv=uvs, image=image)
    cut = trimesh.Trimesh(np.array(QUAD)[corners], [[0, 1, 2], [3, 4, 5]], process=False)
    cut.visual = visual
    cut.export(tmp_path / "a.glb")
    np.testing.assert_allclose(read_values(tmp_path / "a.glb", n_vertices=6), uvs, atol=1e-6)


def test_a_cloud_of_ours_in_glb_comes_back(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    write_mesh(tmp_path / "a.glb", np.array(QUAD, dtype=float))
    mesh = read_mesh(tmp_path / "a.glb")
    assert mesh.is_point_cloud
    np.testing.assert_array_equal(mesh.vertices, QUAD)


def test_colours_of_gltf_are_amounts_of_light(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    given = trimesh.Trimesh(QUAD, FACES, process=False, vertex_colors=[[128, 0, 255, 255]] * 4)
    given.export(tmp_path / "a.glb")
    assert read_values(tmp_path / "a.glb").tolist() == [[188, 0, 255]] * 4


@pytest.mark.parametrize("data", [b"glTF", b"glTF\2\0\0\0\xff\xff\xff\x7f", b"nothing"])
def test_a_broken_glb_is_one_sentence(tmp_path: Path, data: bytes) -> None:
    pytest.importorskip("trimesh")
    (tmp_path / "a.glb").write_bytes(data)
    with pytest.raises(FileError, match=r"^a\.glb: trimesh cannot read it"):
        read_mesh(tmp_path / "a.glb")


def test_a_dae_file_has_trimeshs_numbers_of_vertices(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("collada")
    trimesh.Trimesh(QUAD, FACES, process=False).export(tmp_path / "a.dae")
    assert "numbered as trimesh reads them" in read_mesh(tmp_path / "a.dae").notes[1]


def test_a_gltf_names_no_file_that_is_opened(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    (tmp_path / "secret.bin").write_bytes(bytes(36))
    (tmp_path / "a.gltf").write_text(
        '{"asset": {"version": "2.0"}, "buffers": [{"uri": "secret.bin", "byteLength": 36}]}'
    )
    with pytest.raises(FileError, match=r"its data are in other files: save it as \.glb"):
        read_mesh(tmp_path / "a.gltf")


@pytest.mark.parametrize(
    ("suffix", "why"),
    [
        (".mesh", "Unknown keyword 'nothing'."),
        (".inp", "it is damaged, or no .inp file that it knows"),
    ],
)
def test_what_meshio_says_is_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str, why: str
) -> None:
    pytest.importorskip("meshio")
    (tmp_path / f"a{suffix}").write_text("nothing")
    with pytest.raises(FileError) as caught:
        read_mesh(tmp_path / f"a{suffix}")
    assert str(caught.value) == f"a{suffix}: meshio cannot read it: {why}"
    assert capsys.readouterr() == ("", "")  # JSON may go there


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("a.bdf", "BEGIN BULK\n", "truncated: it lacks the line BEGIN BULK, or"),  # read for ever
        ("a.bdf", "ENDDATA\nBEGIN BULK\n\n", "truncated: it lacks the line BEGIN BULK, or"),
        ("a.bdf", "BEGIN BULK\nCORD2C,1\nENDDATA\n", "has coordinate systems of its own"),
        ("a.inp", "*System\n9.,0.,0.\n*NODE\n1,0.,0.,0.\n", "has coordinate systems of its own"),
        ("a.inp", "*Node, nset=a, system=C\n1,0.,0.,0.\n", "has coordinate systems of its own"),
        ("a.inp", "*NODE\n1,0.,0.,0.\n*Elgen\n1,5,1,1\n", r"generates nodes .* by \*ELGEN"),
        ("a.inp", "*NODE\n1,0.,0.,0.\n*node, nset=b\n1,9.,9.,9.\n", "has several parts"),
        (
            "a.inp",
            "*NODE\n1,0.,0.,0.\n*Node print\n*INCLUDE, INPUT=b.inp\n",
            "includes other files",
        ),
        ("a.inp", "*NODE\n1,0.,0.,0.\n*Element, type=S3, input=b.txt\n", "includes other files"),
        ("a.inp", "*Node, nset=all,\ninput = b.txt\n", "includes other files"),
    ],
)
def test_what_meshio_would_read_wrong_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, why: str
) -> None:
    monkeypatch.setattr("unbend.io._foreign.find_spec", lambda name: name)
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError, match=f"^{name}: {why}"):
        read_mesh(tmp_path / name)


def test_threads_that_read_with_meshio_leave_standard_output_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    meshio = pytest.importorskip("meshio")
    meshio.Mesh(QUAD, [("triangle", FACES)]).write(tmp_path / "a.mesh")
    both, read = threading.Barrier(2), meshio.medit.read
    before, during = sys.stdout, []

    def slowly(path):
        both.wait()
        during.append(sys.stdout)
        return read(path)

    monkeypatch.setattr(meshio.medit, "read", slowly)
    with ThreadPoolExecutor(2) as threads:
        list(threads.map(read_mesh, [tmp_path / "a.mesh"] * 2))
    assert during == [before, before]
    assert sys.stdout is before


@pytest.mark.parametrize(
    ("suffix", "program"),
    [(".glb", "trimesh"), (".mesh", "meshio"), (".gii", "nibabel"), (".pial", "nibabel")],
)
def test_without_the_program_it_is_named(tmp_path: Path, monkeypatch, suffix, program) -> None:
    monkeypatch.setitem(__import__("sys").modules, program, None)
    (tmp_path / f"a{suffix}").write_bytes(b"something")
    with pytest.raises(MissingExtraError, match=f"pip install {program}"):
        read_mesh(tmp_path / f"a{suffix}")
