"""``unbend check`` says what is wrong, what will be done about it, and what to do next."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import unbend
from terminal import invoke
from unbend import Mesh, preparation
from unbend.datasets import make_sphere
from unbend.io import write_mesh
from unbend.preparation import Diagnosis

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    return tmp_path


def check(*arguments: str) -> tuple[int, str, str]:
    result = invoke(["check", *arguments])
    return result.exit_code, result.stdout, result.stderr


def health(name: str) -> dict[str, Any]:
    (found,) = json.loads(check(name, "--json")[1])["files"]
    return dict(found["health"])


def test_a_healthy_mesh(folder: Path) -> None:
    write_mesh("t.off", (VERTICES, FACES))
    code, out, err = check("t.off")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].split() == ["t.off", "found", "what", "unbend", "does"]
    assert lines[1].split() == ["vertices", "4"]
    assert lines[4].split() == ["boundary", "edges", "0", "closed"]
    assert lines[-2:] == ["This mesh is healthy.", "next: unbend canonical t.off -o OUT.ply"]
    assert "degenerate" not in out


def test_two_components_need_an_option(folder: Path) -> None:
    faces = np.vstack([FACES, FACES + 4])
    write_mesh("two meshes.off", (np.vstack([VERTICES, VERTICES + 2]), faces))
    code, out, _ = check("two meshes.off")
    assert code == 0
    assert "matches the largest; else needs --component largest (vertices: 4, 4)" in out
    assert "one component of this mesh" in out
    assert "next: unbend canonical 'two meshes.off' -o OUT.ply --component largest" in out


def test_what_is_cut_along_a_seam_is_whole(folder: Path) -> None:
    write_mesh(
        "cut.off",
        (
            np.vstack([VERTICES, VERTICES[:3]]),
            np.where([[1, 1, 1], [0] * 3, [0] * 3, [0] * 3], FACES + 4, FACES),
        ),
    )
    code, out, _ = check("cut.off")
    assert code == 0
    assert "vertices doubled at seams 3 joins the surface there" in " ".join(out.split())
    assert "components 1 boundary edges 0 closed genus 0" in " ".join(out.split())
    assert "unbend can work with this mesh." in out
    assert "next: unbend canonical cut.off -o OUT.ply" in out


def test_faces_that_are_turned_are_no_sign_of_health(folder: Path) -> None:
    write_mesh("turned.off", (VERTICES, np.vstack([FACES[:1, ::-1], FACES[1:]])))
    out = check("turned.off")[1]
    assert "edges with flipped faces 3 turns them to match" in " ".join(out.split())
    assert "unbend can work with this mesh." in out


def test_everything_at_once(folder: Path) -> None:
    vertices = np.vstack([VERTICES, VERTICES[:1], [[9, 9, 9]]])
    faces = np.vstack([FACES, FACES[:1], [[3, 3, 3]], [[1, 2, 4]]])
    write_mesh("[odd].off", (vertices, faces))
    code, out, _ = check("[odd].off")
    assert code == 0
    assert "[odd].off" in out
    for what in ("degenerate faces", "non-manifold edges", "unreferenced vertices"):
        assert what in out
    assert "duplicate vertices" in out
    assert "uses the robust Laplacian" in out
    assert "unbend can work with this mesh." in out


def test_faces_that_are_left_out_call_for_nothing_else(folder: Path) -> None:
    faces = np.vstack([FACES, FACES[:1], [[3, 3, 0]]])
    write_mesh("twice.off", (VERTICES, faces))
    code, out, _ = check("twice.off")
    assert code == 0
    assert "robust" not in out
    assert "degenerate faces 1 leaves them out" in " ".join(out.split())
    assert "non-manifold edges 3 leaves out the faces that repeat others" in " ".join(out.split())
    assert health("twice.off")["robust_needed"] is False


def test_a_refusal_says_why(folder: Path) -> None:
    write_mesh("three.off", (VERTICES[:3], FACES[:1] * 0 + [0, 1, 2]))
    code, out, _ = check("three.off")
    assert code == 2
    assert "unbend cannot work with this mesh: three.off: faces use only 3 vertices" in out
    assert "next" not in out
    write_mesh("two.off", (np.vstack([VERTICES[:3]] * 2), [[0, 1, 2], [3, 4, 5]]))
    assert "unbend cannot work with this mesh: two.off: faces use only 3" in check("two.off")[1]


def test_a_strip_with_one_side_cannot_be_matched(folder: Path, moebius_strip: Mesh) -> None:
    write_mesh("strip.off", moebius_strip)
    code, out, _ = check("strip.off")
    assert code == 0
    assert "match refuses it" in out
    assert "unbend can work with this mesh, but cannot match it." in out
    assert health("strip.off")["one_sided"] is True


@pytest.mark.parametrize("columns", ["0", "20"])
def test_no_terminal_is_too_narrow_for_numbers(
    folder: Path, monkeypatch: pytest.MonkeyPatch, columns: str
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    write_mesh("t.off", (VERTICES, FACES))
    out = check("t.off")[1]
    assert (
        "edge length     1 / 1.21 / 1.41  min / median / max; divide long ones to register" in out
    )
    write_mesh("ball.off", make_sphere(2))
    assert "divide" not in check("ball.off")[1]


def test_notes_of_the_reader_are_shown(folder: Path) -> None:
    write_mesh("t.stl", (VERTICES, FACES))
    assert "welded" in check("t.stl")[1]


def test_points(folder: Path) -> None:
    write_mesh("p.xyz", VERTICES)
    code, out, _ = check("p.xyz")
    assert code == 0
    assert "treated as a point cloud" in out
    assert "cannot match it: p.xyz: 4 points at different positions are too few" in out
    write_mesh("p.xyz", make_sphere(3).vertices)
    assert "unbend can work with this point cloud.\n" in check("p.xyz")[1]


def test_faces_that_are_oriented_inward(folder: Path) -> None:
    write_mesh("t.off", (VERTICES, FACES[:, ::-1]))
    out = check("t.off")[1]
    assert "inward  turns them to match" in out
    assert "healthy" not in out


def test_positions_that_lost_their_detail(folder: Path) -> None:
    ball = make_sphere(3)
    write_mesh("far.ply", ((ball.vertices + 4e6).astype(np.float32), ball.faces))
    assert "with this mesh, but its positions are rounded to about 0.5" in check("far.ply")[1]


def test_an_unreadable_file_is_one_sentence(folder: Path) -> None:
    (folder / "cut.off").write_text("OFF\n9 9 9\n")
    code, out, err = check("cut.off")
    assert (code, out) == (2, "")
    assert err.startswith("error: cut.off: truncated")
    assert err.count("\n") == 1


def test_json(folder: Path) -> None:
    write_mesh("p.xyz", VERTICES)
    assert (health("p.xyz")["n_vertices"], health("p.xyz")["edge_min"]) == (4, None)
    write_mesh("p.xyz", VERTICES[:2])
    code, out, _ = check("p.xyz", "--json")
    assert code == 2
    assert json.loads(out)["files"][0]["usable"] is False


def test_many_files_get_one_table_and_a_bad_one_does_not_end_it(folder: Path) -> None:
    write_mesh("t.off", (VERTICES, FACES))
    (folder / "cut.off").write_text("OFF\n9 9 9\n")
    write_mesh("two.off", (np.vstack([VERTICES, VERTICES]), np.vstack([FACES, FACES + 4])))
    code, out, err = check("t.off", "cut.off", "two.off")
    assert code == 2
    assert err.startswith("error: cut.off: truncated")
    assert err.count("\n") == 1
    head, *rows, last = out.splitlines()
    assert head.split()[:4] == ["mesh", "vertices", "faces", "components"]
    assert [row.split()[:4] for row in rows] == [
        ["t.off", "4", "4", "1"], ["cut.off", "-", "-", "-"], ["two.off", "8", "8", "2"]
    ]  # fmt: skip
    assert rows[0].endswith("This mesh is healthy.")
    assert "truncated" in rows[1]
    assert last == "next: unbend check MESH shows the details of one"
    told = json.loads(check("t.off", "cut.off", "two.off", "--json")[1])["files"]
    assert [one["usable"] for one in told] == [True, False, True]
    assert [one["file"] for one in told] == ["t.off", "cut.off", "two.off"]
    assert told[1]["health"] is None
    assert check("t.off", "two.off")[0] == 0


def test_a_mesh_that_memory_cannot_hold_does_not_end_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diagnose(mesh: Mesh) -> Diagnosis:
        if mesh.name == "large.off":
            raise MemoryError
        return preparation.diagnose(mesh)

    monkeypatch.setattr(unbend, "diagnose", diagnose)
    write_mesh("large.off", (VERTICES, FACES))
    write_mesh("t.off", (VERTICES, FACES))
    code, out, err = check("large.off", "t.off")
    assert code == 2
    assert err == "error: large.off: there is too little memory; reduce it to fewer vertices\n"
    assert "This mesh is healthy." in out


def test_a_folder_stands_for_its_meshes(folder: Path) -> None:
    (folder / "scans" / "old").mkdir(parents=True)
    write_mesh("scans/t.off", (VERTICES, FACES))
    write_mesh("scans/old/t.ply", (VERTICES, FACES))
    (folder / "scans" / "notes.txt").write_text("none")
    code, out, _ = check("scans", "--json")
    assert code == 0
    paths = [one["file"] for one in json.loads(out)["files"]]
    assert paths == [str(Path("scans", "t.off")), str(Path("scans", "old", "t.ply"))]


def test_a_pattern_stands_for_the_files_that_match(folder: Path) -> None:
    """As the warning of files left out of a folder says to, in quotes."""
    (folder / "scans").mkdir()
    for name in ("b.glb", "a.glb", "[c].glb"):
        write_mesh(folder / "scans" / name, (VERTICES, FACES))
    code, out, _ = check(str(Path("scans", "*.glb")), str(Path("scans", "[c].glb")), "--json")
    assert code == 0
    names = ["[c].glb", "a.glb", "b.glb", "[c].glb"]
    assert [one["file"] for one in json.loads(out)["files"]] == [
        str(Path("scans", name)) for name in names
    ]
    assert "there is no such file" in check("none*.glb")[2]


def test_real_shapes(real_data: Path) -> None:
    path = real_data / "tosca_remeshed" / "david0.off"
    code, out, _ = check(str(path))
    assert code == 0
    assert "5,000" in out
