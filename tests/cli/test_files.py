"""What a file holds is not lost in silence: textures, values, landmarks; maps know their meshes."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from sheets import make_torus
from stones import write_stones
from terminal import invoke
from unbend import Mesh, read_mesh, write_match, write_mesh
from unbend.io import read_markups, read_values, write_map, write_markups, write_values
from unbend.matching import Match

RING = make_torus(30, 20)  # pairs of its faces are quads
SOURCE = Mesh(RING.vertices * [0.25, 0.3, 0.22], RING.faces)
TARGET = Mesh(SOURCE.vertices + 0.3 * SOURCE.vertices[:, [1]] ** 2, RING.faces)
SAME = np.arange(600)


def right(*arguments):
    done = invoke(arguments)
    assert done.exit_code == 0, done.output
    return done


def textured(mesh: Mesh) -> bytes:
    """An OBJ file with a chart, normals, groups, a material, and quads where two faces allow it."""
    lines = ["mtllib skin.mtl", "o dog"]
    lines += [f"v {' '.join(map(repr, row))}" for row in mesh.vertices.tolist()]
    lines += [f"vt {x} {y}" for x, y, _ in mesh.vertices.tolist()]
    lines += ["vn 0 0 1"] * mesh.n_vertices + ["g body", "usemtl fur", "s 1"]
    faces = mesh.faces.tolist()
    while faces:
        face = faces.pop(0)
        if faces and faces[0][0] == face[0] and faces[0][1] == face[2]:
            face.append(faces.pop(0)[2])
        lines.append("f " + " ".join(f"{i + 1}/{i + 1}/{i + 1}" for i in face))
    return "\n".join([*lines, ""]).encode()


def lines_that_differ(path: Path, other: Path) -> set[bytes]:
    pairs = zip(path.read_bytes().split(b"\n"), other.read_bytes().split(b"\n"), strict=True)
    return {word for old, new in pairs if old != new for word in {old[:2], new[:2]}}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "a.obj").write_bytes(textured(SOURCE))
    (tmp_path / "b.obj").write_bytes(textured(TARGET))
    assert any(len(line.split()) == 5 for line in textured(SOURCE).split(b"\n"))
    write_mesh(tmp_path / "a.ply", SOURCE)
    write_mesh(tmp_path / "b.ply", TARGET)
    write_map(tmp_path / "map.npy", SAME)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "line",
    [
        "match a.ply b.ply --no-refine -o out.npz --figure out.png",
        "distance a.ply --from 0 -o out.csv --figure out.png",
    ],
)
def test_without_matplotlib_nothing_is_computed_or_written(
    folder: Path, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    before = sorted(folder.iterdir())
    done = invoke(line.split())
    assert done.exit_code == 2
    assert done.stderr == "error: matplotlib is needed for this: pip install matplotlib\n"
    assert sorted(folder.iterdir()) == before


def test_a_registered_obj_keeps_its_lines(folder: Path) -> None:
    done = right("register", "a.obj", "b.ply", "--map", "map.npy", "-o", "out.obj")
    assert lines_that_differ(folder / "a.obj", folder / "out.obj") == {b"v ", b"vn"}
    kept = "all lines of a.obj, with new positions; its normals are recomputed"
    assert f"note: out.obj has {kept}" in done.stderr
    assert np.abs(read_mesh("out.obj").vertices - TARGET.vertices).max() < 0.1
    done = right("register", "a.obj", "b.ply", "--map", "map.npy", "-o", "out.ply")
    assert (
        "note: out.ply does not keep texture coordinates, normals, materials, groups, object names "
        "of a.obj\n" in done.stderr
    )


def test_what_a_file_of_another_program_loses_is_said(folder: Path) -> None:
    pytest.importorskip("trimesh")
    write_mesh("a.glb", SOURCE, uvs=SOURCE.vertices[:, :2])
    done = right("morph", "a.glb", "b.ply", "--map", "map.npy", "-o", "out.ply")
    assert "note: out.ply does not keep anything but the shape of a.glb\n" in done.stderr
    done = right("morph", "a.glb", "b.ply", "--map", "map.npy", "-o", "out.glb")
    kept = "all that a.glb has, with new positions and normals, but without tangents"
    assert f"note: out.glb has {kept}\n" in done.stderr
    uvs = read_values("out.glb", name="uv")
    np.testing.assert_allclose(uvs, SOURCE.vertices[:, :2], atol=1e-6)


def test_morph_names_the_files_that_it_writes(folder: Path) -> None:
    done = right("morph", "a.obj", "b.ply", "--map", "map.npy", "--steps", "2", "-o", "m.obj")
    assert "note: m-*.obj has all lines of a.obj" in done.stderr


def test_a_canonical_form_keeps_them_and_finds_its_material(folder: Path) -> None:
    (folder / "new").mkdir()
    done = right("canonical", "a.obj", "--detail", "preserved", "-o", "new/out.obj")
    assert lines_that_differ(folder / "a.obj", folder / "new" / "out.obj") == {b"mt", b"v ", b"vn"}
    assert (folder / "new" / "out.obj").read_bytes().startswith(b"mtllib ../skin.mtl\n")
    assert "its materials stay in the folder of a.obj" in done.stderr


@pytest.mark.parametrize("suffix", [".glb", ".vtp"])
def test_a_canonical_form_in_other_formats(folder: Path, suffix: str) -> None:
    right("canonical", "a.ply", "-o", f"out{suffix}")
    assert (folder / f"out{suffix}").stat().st_size > 600 * 12


def test_transfer_colours_the_lines_of_an_obj(folder: Path) -> None:
    colors = np.arange(1800).reshape(600, 3) % 256
    np.savetxt("colors.csv", colors, "%d", ",", header="red,green,blue", comments="")
    given = ["transfer", "a.ply", "b.obj", "--map", "map.npy", "-o", "out.obj"]
    done = right(*given, "--values", "colors.csv")
    assert "600 x 3 values (color)" in done.stdout
    assert lines_that_differ(folder / "b.obj", folder / "out.obj") <= {b"v "}
    assert "note: out.obj has all lines of b.obj\n" in done.stderr
    np.testing.assert_array_equal(read_values("out.obj"), colors)
    # Carried from the .obj, and from a .ply beside other values.
    given = ["transfer", "out.obj", "a.ply", "--map", "map.npy", "-o", "again.ply"]
    right(*given, "--values", "out.obj")
    np.testing.assert_array_equal(read_values("again.ply"), colors)
    write_mesh("two.ply", SOURCE, colors=colors, scalars={"heat": SAME, "cold": -SAME})
    right(*given, "--values", "two.ply", "--property", "color")
    np.testing.assert_array_equal(read_values("again.ply"), colors)
    done = invoke([*given, "--values", "two.ply"])
    assert done.exit_code == 2
    assert "two.ply: holds color, heat, cold; name one of them with --property" in done.stderr
    done = invoke([*given, "--values", "two.ply", "--property", "colour"])
    assert done.exit_code == 2
    assert "two.ply: holds no colour, but color, heat, cold; name one of them" in done.stderr


def test_painted_labels_stay_colours_of_a_mesh(folder: Path) -> None:
    paint = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)[np.arange(600) % 2]
    write_mesh("paint.ply", SOURCE, colors=paint)
    given = ["transfer", "a.ply", "b.ply", "--map", "map.npy", "--values", "paint.ply"]
    for name in ("out.ply", "out.obj"):
        right(*given, "--kind", "label", "-o", name)
        np.testing.assert_array_equal(read_values(name, name="color"), paint)
    right(*given, "--kind", "label", "-o", "out.csv")
    np.testing.assert_array_equal(read_values("out.csv"), paint)


def test_texture_coordinates_are_carried_by_their_name(folder: Path) -> None:
    uvs = SOURCE.vertices[:, :2]
    write_mesh("uv.ply", SOURCE, uvs=uvs, scalars={"heat": SAME})
    given = ["transfer", "a.ply", "b.ply", "--map", "map.npy", "--values", "uv.ply"]
    right(*given, "--property", "uv", "-o", "out.obj")
    lines = [line.split() for line in Path("out.obj").read_text().splitlines()]
    assert [[float(word) for word in line[1:]] for line in lines if line[0] == "vt"] == uvs.tolist()
    write_mesh("uv.ply", SOURCE, uvs=uvs)
    assert "(uv)" in right(*given, "-o", "out.ply").stdout
    assert b"property double s\nproperty double t\n" in Path("out.ply").read_bytes()
    write_mesh("uv.ply", SOURCE, scalars={"uv": SAME, "heat": SAME})
    assert "(label)" in right(*given, "--property", "uv", "-o", "out.ply").stdout


def test_scalars_and_labels_written_to_ply_are_values_again(folder: Path) -> None:
    write_values("labels.ply", SAME % 5, SOURCE, kind="label")
    given = ["transfer", "a.ply", "b.ply", "--map", "map.npy", "--values"]
    done = right(*given, "labels.ply", "-o", "out.vtp")
    assert "(label)" in done.stdout
    right(*given, "labels.ply", "-o", "out.csv")
    np.testing.assert_array_equal(read_values("out.csv"), SAME % 5)
    Path("parts.csv").write_text("vertex,part\n" + "".join(f"{i},p{i}\n" for i in SAME[::-1]))
    right(*given, "parts.csv", "-o", "out.csv")
    assert read_values("out.csv").tolist() == [f"p{i}" for i in SAME]


@pytest.mark.parametrize("suffix", [".npy", ".csv", ".txt", ".ply"])
def test_labels_that_a_program_stored_as_floats_stay_labels(folder: Path, suffix: str) -> None:
    torn = np.where(SAME < 9, -1, SAME)
    write_match("map.npz", Match(torn, torn, np.eye(3), 1.0, 1.0))
    write_values(f"parts{suffix}", np.where(SAME < 100, 3.0, 7.0), SOURCE)
    for given, out in (("parts", "out"), ("out", "again")):  # what was carried is carried again
        line = ["transfer", "a.ply", "b.ply", "--map", "map.npz", "--values", given + suffix]
        assert "(label)" in right(*line, "-o", out + suffix).stdout
        carried = [np.nan] * 9 + [3] * 91 + [7] * 500
        np.testing.assert_array_equal(read_values(out + suffix), carried)


def test_infinite_values_count_as_carried(folder: Path) -> None:
    np.save("far.npy", np.where(SAME < 9, np.inf, SAME / 7))
    given = ["transfer", "a.ply", "b.ply", "--map", "map.npy", "--values", "far.npy"]
    told = right(*given, "-o", "out.npy").stdout
    assert "600 values (scalar)" in told
    assert "of 600" not in told


def test_labels_beside_other_columns_are_told_to_be_averaged(folder: Path) -> None:
    rows = [f"{1 + i % 3},{i / 7},0\n" for i in SAME]
    Path("some.csv").write_text("damage,depth,none\n" + "".join(rows))
    given = ["transfer", "a.ply", "b.ply", "--map", "map.npy", "--values", "some.csv"]
    told = "columns of whole numbers (damage) are averaged"
    assert told in right(*given, "-o", "out.csv").stderr
    assert told not in right(*given, "--kind", "scalar", "-o", "out.csv").stderr


def test_landmarks_are_carried_and_lead_a_match(folder: Path) -> None:
    write_markups("a.mrk.json", SOURCE, [3, 500, 77], ["nose", "tail", "paw"])
    given = ["transfer", "a.ply", "b.ply", "--values", "a.mrk.json", "-o", "b.mrk.json"]
    done = right(*given, "--map", "map.npy", "--json")
    assert json.loads(done.stdout)["kind"] == "landmarks"
    labels, vertices = read_markups("b.mrk.json", TARGET)
    assert (labels, vertices.tolist()) == (["nose", "tail", "paw"], [3, 500, 77])
    for more in (["--kind", "label"], ["--property", "heat"]):
        done = invoke([*given, "--map", "map.npy", *more])
        assert done.exit_code == 2
        assert "a.mrk.json is read as landmarks, which have no --kind" in done.stderr
    Path("weights.json").write_text("{}")
    done = invoke(["transfer", "a.ply", "b.ply", "--values", "weights.json", "-o", "w.csv"])
    assert done.exit_code == 2
    assert "w.csv: weights.json is read as landmarks, which go into a .mrk.json" in done.stderr
    done = invoke(["transfer", "a.ply", "b.ply", "--values", "w.npy", "-o", "w.json"])
    assert done.exit_code == 2
    assert "w.json: .json files hold landmarks, which w.npy does not; write .csv" in done.stderr
    np.savetxt("points.csv", SOURCE.vertices[[3, 500]], delimiter=",")
    right(
        "transfer", "a.ply", "b.ply", "--values", "points.csv", "-o", "c.json", "--map", "map.npy"
    )
    assert read_markups("c.json", TARGET)[1].tolist() == [3, 500]
    stones = write_stones(folder, 2)
    for name, stone in zip("ab", stones, strict=True):
        write_markups(f"{name}.mrk.json", read_mesh(stone), [3, 100], ["top", "side"])
    hints = ["--landmarks", "a.mrk.json", "--landmarks", "b.mrk.json"]
    done = right("match", *stones, *hints, "--no-refine", "--json")
    assert json.loads(done.stdout)["missed_landmarks"] == []
    mesh = read_mesh(stones[0])
    right_ones, x = [3, 20, 40, 60, 80], mesh.vertices[:, 0]
    names = [*"vwxyz", "paw"]
    write_markups("a.mrk.json", mesh, [*right_ones, x.argmin()], names)
    write_markups("b.mrk.json", read_mesh(stones[1]), [*right_ones, x.argmax()], names)
    done = right("match", *stones, *hints, "--no-refine", "--report", "page.html")
    assert "landmark 'paw' at vertices" in done.stderr
    page = Path("page.html").read_text("utf-8")
    assert '"ignored": [5]' in page
    assert "paw: they contradict" in page
    done = invoke(["match", *map(str, stones), *hints[:2]])
    assert done.exit_code == 2
    assert "--landmarks takes one .csv file" in done.stderr


def test_values_that_do_not_fit_their_kind_are_refused_before_matching(folder: Path) -> None:
    np.save("weights.npy", np.full((600, 2), 0.7))
    given = ["transfer", "a.ply", "b.ply", "--values", "weights.npy", "--kind", "weights"]
    done = invoke([*given, "--save-match", "match.npz", "-o", "out.csv"])
    assert done.exit_code == 2
    assert "row 0 sums to 1.4" in done.stderr
    assert not Path("match.npz").exists()


def test_landmarks_without_a_partner_are_named_and_not_counted(folder: Path) -> None:
    write_markups("a.mrk.json", SOURCE, [3, 500, 77], ["nose", "tail", "paw"])
    write_map("torn.csv", np.select([SAME == 500, SAME == 77], [-1, 3], SAME))
    line = ["transfer", "a.ply", "b.ply", "--map", "torn.csv", "--values", "a.mrk.json"]
    done = right(*line, "-o", "b.mrk.json")
    assert "landmark tail corresponds to no vertex of b.ply" in done.stderr
    assert "1 landmark at the same vertex of b.ply as another one" in done.stderr
    assert "2 values (landmarks)" in done.stdout
    assert read_markups("b.mrk.json", TARGET)[0] == ["nose", "paw"]
    write_markups("a.mrk.json", SOURCE, [3, 500, 77], ["", "", ""])
    done = right(*line, "-o", "b.mrk.json", "--quiet")
    assert "landmark 2 corresponds to no vertex of b.ply" in done.stderr
    assert read_markups("b.mrk.json", TARGET)[0] == ["1", "3"]  # by order they would pair wrongly
    write_map("torn.csv", np.where(SAME == 3, SAME, -1))
    write_markups("a.mrk.json", SOURCE, [500, 77], ["tail", "paw"])
    done = invoke([*line, "-o", "none.mrk.json"])
    assert done.exit_code == 2
    assert "no landmark corresponds to a vertex of b.ply" in done.stderr
    assert not Path("none.mrk.json").exists()


def test_a_map_of_other_meshes_is_refused(folder: Path) -> None:
    found = Match(SAME, SAME, np.eye(3), 1.0, 0.55)
    write_match("map.npz", found, source=SOURCE, target=TARGET)
    right("register", "a.obj", "b.ply", "--map", "map.npz", "-o", "out.ply")
    # The same mesh, turned, or with one component chosen, is no other one.
    write_mesh("a.ply", Mesh(SOURCE.vertices[:, ::-1], SOURCE.faces))
    done = right("register", "a.ply", "b.ply", "--map", "map.npz", "-o", "out.ply")
    assert "the match is doubtful (confidence 0.55)" in done.stderr
    write_mesh("other.ply", Mesh(SOURCE.vertices[:, ::-1], SOURCE.faces[::-1]))
    Path("out.ply").unlink()
    for command in (["register"], ["transfer", "--values", "map.npy"]):
        pair = ["other.ply", "b.ply", "--map", "map.npz", "-o", "out.ply"]
        done = invoke([*command, *pair])
        assert done.exit_code == 2
        assert "than other.ply, or to the same with its vertices in another order" in done.stderr
        assert not Path("out.ply").exists()


def test_a_map_that_leaves_vertices_of_the_target_out_is_told(folder: Path) -> None:
    part = Mesh(SOURCE.vertices[:400])
    write_mesh("part.ply", part)
    np.save("values.npy", SAME[:400])
    given = ["transfer", "part.ply", "b.ply", "--values", "values.npy", "-o", "out.npy", "--map"]
    write_map("part.csv", SAME[:400])
    told = "200 of 600 vertices of b.ply are the partner of no vertex of part.ply"
    assert told in right(*given, "part.csv").stderr
    torn = np.where(SAME < 400, SAME, -1)
    write_match("part.npz", Match(SAME[:400], torn, np.eye(3), 1.0, 1.0))
    assert told not in right(*given, "part.npz").stderr
    given = ["transfer", "a.ply", "b.ply", "--values", "map.npy", "-o", "out.npy"]
    assert "image of none" not in right(*given, "--map", "map.npy").stderr


@pytest.mark.parametrize(
    "line",
    [
        "canonical a.ply -o a.ply",
        "canonical one -o one/a.ply",
        "register a.ply b.ply --map map.npy -o a.ply",
        "register a.ply b.ply --map map.npy -o link.ply",
        "register a.ply one -o one/a.ply",
        "transfer a.ply b.ply --map map.npy --values map.npy -o b.ply",
        "transfer a.ply b.ply --map map.npy --values map.npy -o ./map.npy",
        "transfer a.ply b.ply --values map.npy --save-match map.npy -o out.npy",
        "transfer a.ply b.ply --values map.npy --expected-error b.ply -o out.npy",
        "morph a.ply b.ply --map map.npy -o b.ply",
        "morph a-1.ply b.ply --map map.npy --steps 2 -o a.ply",
        "match a.ply b.ply --colored out.ply a.ply",
        "match a.ply b.ply --landmarks hints.csv -o hints.csv",
        "match a.ply b.ply --landmarks hints-2.csv --n-matches 2 -o hints.csv",
    ],
)
def test_no_command_writes_over_what_it_reads(folder: Path, line: str) -> None:
    (folder / "one").mkdir()
    write_mesh("one/a.ply", SOURCE)
    write_mesh("a-1.ply", SOURCE)
    Path("link.ply").symlink_to("b.ply")
    for name in ("hints.csv", "hints-2.csv"):
        Path(name).write_text("1,1\n")
    before = {path: path.read_bytes() for path in folder.rglob("*.*")}
    done = invoke(line.split())
    assert done.exit_code == 2
    assert "is one of the inputs; give another" in done.stderr
    assert {path: path.read_bytes() for path in folder.rglob("*.*")} == before
