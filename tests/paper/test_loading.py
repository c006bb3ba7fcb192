"""Collections on disk: every layout must give the same shapes and the same truth."""

import itertools
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from paper.loading import load_scape, load_tosca
from tests.paper.folders import dog
from unbend import Mesh, canonical_form, write_mesh
from unbend.datasets import make_sphere
from unbend.errors import FileError, InputError, MeshError, UnbendWarning

POSES = {"cat0": "standing", "cat2": "galloping", "cat10": "sitting"}


@pytest.fixture(scope="module")
def cats() -> dict[str, Mesh]:
    return {name: dog(pose) for name, pose in POSES.items()}


def _write_off(folder: Path, meshes: dict[str, Mesh], suffix: str = ".off") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, mesh in meshes.items():
        write_mesh(folder / f"{name}{suffix}", mesh)


def _write_mat(folder: Path, meshes: dict[str, Mesh]) -> None:
    for name, mesh in meshes.items():
        x, y, z = mesh.vertices.T[:, :, None]
        surface = {"X": x, "Y": y, "Z": z, "TRIV": mesh.faces + 1.0}
        savemat(folder / f"{name}.mat", {"surface": surface})


def _write_vert_tri(folder: Path, meshes: dict[str, Mesh]) -> None:
    for name, mesh in meshes.items():
        np.savetxt(folder / f"{name}.vert", mesh.vertices, fmt="%.17g")
        np.savetxt(folder / f"{name}.tri", mesh.faces + 1, fmt="%d")


def _write_remeshed(folder: Path, meshes: dict[str, Mesh], corres: Path) -> dict[str, np.ndarray]:
    """Renumber each mesh at random; return where each vertex went."""
    rng = np.random.default_rng(0)
    corres.mkdir(parents=True)
    moved, places = {}, {}
    for name, mesh in meshes.items():
        place = rng.permutation(mesh.n_vertices)
        moved[name] = Mesh(mesh.vertices[np.argsort(place)], place[mesh.faces])
        np.savetxt(corres / f"{name}.vts", place + 1, fmt="%d")
        np.savetxt(corres / f"{name}.sym.vts", place[::-1] + 1, fmt="%d")
        places[name] = place
    _write_off(folder, moved)
    return places


LAYOUTS = {
    "mat": _write_mat,
    "vert": _write_vert_tri,
    "off": _write_off,
    "ply": lambda folder, meshes: _write_off(folder, meshes, ".ply"),
    "princeton": lambda folder, meshes: _write_off(folder / "Meshes", meshes),
    "benchmark": lambda folder, meshes: _write_off(folder / "Data" / "TOSCA" / "Meshes", meshes),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_shapes_numbered_alike_are_the_same_in_every_layout(layout, cats, tmp_path):
    LAYOUTS[layout](tmp_path, cats)
    shapes = load_tosca(tmp_path)
    assert shapes.names == ("cat0", "cat2", "cat10")
    assert dict(shapes.class_of) == dict.fromkeys(cats, "cat")
    for name, mesh in cats.items():
        read = shapes.mesh(name)
        np.testing.assert_array_equal(read.vertices, mesh.vertices)
        np.testing.assert_array_equal(read.faces, mesh.faces)
        assert read.name.startswith(f"{name}.")
    truth = shapes.truth("cat0", "cat10")
    np.testing.assert_array_equal(truth.source_points, np.arange(600))
    np.testing.assert_array_equal(truth.target_points, np.arange(600))
    assert truth.mirrored_target_points is None


@pytest.mark.parametrize(
    ("load", "below", "first"),
    [
        (load_tosca, "", "cat{}"),
        (load_tosca, "Dataset/TOSCA_Isometric/vtx_5k", "cat{}"),
        (load_scape, "vtx_5k", "mesh00{}"),
    ],
)
def test_remeshed_shapes_correspond_by_their_rows(load, below, first, cats, tmp_path):
    meshes = {first.format(i): mesh for i, mesh in enumerate(cats.values())}
    place = _write_remeshed(tmp_path / below, meshes, tmp_path / below / "corres")
    shapes = load(tmp_path)
    for source, target in itertools.permutations(meshes, 2):
        truth = shapes.truth(source, target)
        np.testing.assert_array_equal(truth.source_points, place[source])
        np.testing.assert_array_equal(truth.target_points, place[target])
        np.testing.assert_array_equal(truth.mirrored_target_points, place[target][::-1])
        # The rows name the points that the meshes were made from.
        np.testing.assert_array_equal(
            shapes.mesh(source).vertices[truth.source_points], meshes[source].vertices
        )


@pytest.mark.parametrize("given", ["", "off"])
def test_meshes_may_lie_beside_the_rows_and_lack_mirrored_ones(given, cats, tmp_path):
    place = _write_remeshed(
        tmp_path / "off", {"mesh000": cats["cat0"], "mesh052": cats["cat2"]}, tmp_path / "corres"
    )
    (tmp_path / "corres" / "mesh052.sym.vts").unlink()
    truth = load_scape(tmp_path / given).truth("mesh000", "mesh052")
    np.testing.assert_array_equal(truth.target_points, place["mesh052"])
    assert truth.mirrored_target_points is None


def test_unused_vertices_are_no_part_of_the_truth(tmp_path):
    sphere = make_sphere(2)
    holes = {"cat0": (3, 50), "cat1": (7,)}
    for name, hole in holes.items():
        faces = sphere.faces[~np.isin(sphere.faces, hole).any(axis=1)]
        write_mesh(tmp_path / f"{name}.off", Mesh(sphere.vertices, faces))
    truth = load_tosca(tmp_path).truth("cat0", "cat1")
    np.testing.assert_array_equal(truth.source_points, np.setdiff1d(np.arange(162), [3, 7, 50]))
    np.testing.assert_array_equal(truth.source_points, truth.target_points)


def test_holes_and_pinched_vertices_are_read_and_used(tmp_path):
    sphere = make_sphere(2)
    faces = sphere.faces[1:]
    # One more triangle that touches the surface in a single vertex.
    vertices = np.vstack([sphere.vertices, [[2, 0, 0], [2, 1, 0]]])
    pinched = Mesh(vertices, np.vstack([faces, [[0, 162, 163]]]))
    _write_off(tmp_path, {"mesh000": pinched, "mesh001": pinched})
    shapes = load_scape(tmp_path)
    assert len(shapes.truth("mesh000", "mesh001").source_points) == 164
    with pytest.warns(UnbendWarning, match="1 non-manifold vertex"):
        assert canonical_form(shapes.mesh("mesh001")).points.shape == (164, 3)


def test_a_class_is_a_name_without_its_number(cats, tmp_path):
    names = ["dog0", "cat0", "seahorse1", "8_man_01"]
    _write_off(tmp_path, dict.fromkeys(names, cats["cat0"]))
    (tmp_path / "atlas.off").touch()  # no number: no shape of the collection
    assert set(load_tosca(tmp_path).classes) == {"dog", "cat", "seahorse", "8_man"}


def test_nothing_is_read_before_it_is_asked_for(tmp_path):
    for name in ("cat0", "cat1"):
        (tmp_path / f"{name}.off").write_text("not a mesh")
    shapes = load_tosca(tmp_path)
    assert len(shapes) == 2
    with pytest.raises(FileError, match=r"cat1\.off: not an OFF file"):
        shapes.mesh("cat1")


@pytest.mark.parametrize("suffixes", [("off",), ("vert", "tri")])
def test_a_file_that_changes_is_read_again(suffixes, tmp_path):
    texts = {
        "off": "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 {}\n",
        "vert": "0 0 0\n1 0 0\n0 1 0\n",
        "tri": "{}\n",
    }
    first = int(suffixes[-1] == "tri")
    shapes = None
    for second, corners in enumerate(([0, 1, 2], [2, 1, 0])):
        for suffix in suffixes:
            row = " ".join(str(corner + first) for corner in corners)
            path = tmp_path / f"cat0.{suffix}"
            if "{}" in texts[suffix] or not path.exists():
                path.write_text(texts[suffix].format(row))
                os.utime(path, (second, second))  # clocks of file systems are coarse
        shapes = shapes or load_tosca(tmp_path)
        assert shapes.mesh("cat0").faces.tolist() == [corners]
        assert shapes.mesh("cat0") is shapes.mesh("cat0")


def test_what_is_missing_is_said(cats, tmp_path):
    with pytest.raises(FileError, match=r"there is no folder .*put the shapes of SCAPE there"):
        load_scape(tmp_path / "nowhere")
    with pytest.raises(FileError, match=r"holds no shapes of SCAPE; put mesh000\.off"):
        load_scape(tmp_path)
    np.savetxt(tmp_path / "cat0.vert", np.eye(3))
    with pytest.raises(FileError, match=r"cat0\.vert has no triangles: put cat0\.tri into"):
        load_tosca(tmp_path).mesh("cat0")
    _write_off(tmp_path, {**cats, "dog0": cats["cat0"]})
    shapes = load_tosca(tmp_path)
    with pytest.raises(InputError, match="there is no shape 'cat7' in TOSCA; it has cat0, cat2"):
        shapes.mesh("cat7")
    with pytest.raises(InputError, match="of different classes"):
        shapes.truth("cat0", "dog0")


def test_truth_that_does_not_fit_is_refused(cats, tmp_path):
    pair = {name: cats[name] for name in ("cat0", "cat2")}
    corres = tmp_path / "corres"
    _write_remeshed(tmp_path, pair, corres)
    shapes = load_tosca(tmp_path)
    rows = corres / "cat2.vts"
    for text, message in [
        ("1\n2\n", r"cat0\.vts has 600 rows and cat2\.vts has 2"),
        ("1\n601\n", r"row 2 names vertex 601, but cat2\.off has 600"),
        ("0\n1\n", r"cat2\.vts: row 0 is 0, but counted from 1"),
        ("-1\n1\n", r"cat2\.vts: row 0 names no vertex"),
        ("1\nx\n", r"cat2\.vts: row 1 holds 'x'"),
        ("", r"cat2\.vts is empty"),
    ]:
        rows.write_text(text)
        with pytest.raises(FileError, match=message):
            shapes.truth("cat0", "cat2")
    rows.unlink()
    with pytest.raises(FileError, match=r"cat2\.off has no ground truth: put cat2\.vts into"):
        shapes.truth("cat0", "cat2")


def test_meshes_numbered_apart_are_not_taken_for_numbered_alike(cats, tmp_path):
    _write_remeshed(tmp_path, cats, tmp_path / "elsewhere")
    write_mesh(tmp_path / "cat11.off", make_sphere(2))
    shapes = load_tosca(tmp_path)
    with pytest.raises(FileError, match="cat0 and cat2 are meshed each on its own"):
        shapes.truth("cat0", "cat2")
    with pytest.raises(FileError, match="cat0 has 600 vertices and cat11 has 162"):
        shapes.truth("cat0", "cat11")


def test_damaged_matlab_files(tmp_path):
    points = np.eye(3)[:, :1]
    good = {"X": points, "Y": points, "Z": points, "TRIV": [[1, 2, 3]]}
    cases = [
        ({"surface": {**good, "TRIV": [[0, 1, 2]]}}, MeshError, "whole numbers from 1 on"),
        ({"surface": {**good, "TRIV": [[1, 2, 2.5]]}}, MeshError, "whole numbers from 1 on"),
        ({"surface": {**good, "X": points[:2]}}, MeshError, "X, Y and Z differ in length"),
        ({"surface": {**good, "TRIV": [[1, 2, 9]]}}, MeshError, "names vertex 8"),
        ({"shape": good}, FileError, "holds no MATLAB struct 'surface'"),
    ]
    shapes = None
    for contents, error, message in cases:
        savemat(tmp_path / "cat0.mat", contents)
        shapes = load_tosca(tmp_path)
        with pytest.raises(error, match=rf"cat0\.mat: .*{message}"):
            shapes.mesh("cat0")
    (tmp_path / "cat0.mat").write_bytes(b"MATLAB 5.0 MAT-file, cut off")
    with pytest.raises(FileError, match="holds no MATLAB struct"):
        shapes.mesh("cat0")
    (tmp_path / "cat0.mat").unlink()
    with pytest.raises(FileError, match=r"cannot read .*cat0"):
        shapes.mesh("cat0")


@pytest.mark.parametrize(
    ("vert", "tri", "error", "message"),
    [
        ("0 0 0\n1 0\n", "1 2 3\n", FileError, r"cat0\.vert: vertex 1 has 2 numbers"),
        ("0 0 0\n1 0 0\n0 1 0\n", "1 2\n", FileError, r"cat0\.tri: face 0 promises 3"),
        ("0 0 0\n1 0 0\n0 1 0\n", "0 1 2\n", MeshError, r"cat0\.tri: .* from 1 on"),
        ("0 0 0\n1 0 0\n0 1 0\n", "1 2 4\n", MeshError, r"cat0\.vert: face 0 names vertex 3"),
    ],
)
def test_damaged_pairs_of_files(vert, tri, error, message, tmp_path):
    (tmp_path / "cat0.vert").write_text(vert)
    (tmp_path / "cat0.tri").write_text(tri)
    with pytest.raises(error, match=message):
        load_tosca(tmp_path).mesh("cat0")


def test_real_remeshed_tosca(real_data):
    shapes = load_tosca(real_data / "tosca_remeshed")
    assert {kind: len(names) for kind, names in shapes.classes.items()} == {
        "cat": 6, "centaur": 3, "david": 4, "dog": 5, "michael": 5,
    }  # fmt: skip
    truth = shapes.truth("cat0", "cat8")
    source, target = shapes.mesh("cat0"), shapes.mesh("cat8")
    assert truth.mirrored_target_points is not None
    # A pose changes few lengths: edges must be about as long between corresponding points. (They
    # are four times as long for the worst quarter where ids are one off.)
    for points in (truth.target_points, truth.mirrored_target_points):
        image = np.full(source.n_vertices, -1)
        image[truth.source_points] = points
        edges = source.faces[:, :2][(image[source.faces[:, :2]] >= 0).all(axis=1)]
        before, after = (
            np.linalg.norm(mesh.vertices[ends[:, 0]] - mesh.vertices[ends[:, 1]], axis=1)
            for mesh, ends in ((source, edges), (target, image[edges]))
        )
        assert len(edges) > 5000
        assert np.quantile(after / before, 0.9) < 2


def test_real_original_tosca(real_data):
    shapes = load_tosca(real_data / "tosca_original")
    assert shapes.names == ("wolf0", "wolf1", "wolf2")
    for source, target in itertools.combinations(shapes.names, 2):
        np.testing.assert_array_equal(shapes.truth(source, target).source_points, np.arange(4344))
