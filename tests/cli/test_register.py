"""``unbend register``: a template onto a torn scan, in files."""

import functools
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from animals import dog
from sheets import make_egg
from stones import write_stones
from terminal import invoke
from testshapes.damage import cut_discs, damaged_truth, keep
from unbend import Mesh, read_mesh, write_mesh
from unbend.correspondence import read_match, write_match
from unbend.datasets import rest_map
from unbend.io import write_map
from unbend.matching import Match

template = functools.partial(dog, "standing", n_vertices=600)
scan = functools.partial(dog, "walking", n_vertices=500, meshing=1)


def run(*arguments):
    return invoke(arguments)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    torn = cut_discs(scan().mesh, 0.1, random_state=1)
    write_mesh(tmp_path / "template.ply", template().mesh)
    write_mesh(tmp_path / "scan.ply", torn.mesh)
    write_mesh(tmp_path / "points.xyz", template().mesh.vertices)
    truth = damaged_truth(rest_map(template(), scan()), target=torn)
    write_map(tmp_path / "map.npy", truth)
    write_map(
        tmp_path / "from-1.txt", np.where(truth < len(torn.mesh.vertices) - 1, truth, -1), base=1
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_it_tells_and_writes_what_came_out(folder: Path) -> None:
    given = ["register", "template.ply", "scan.ply", "--map", "map.npy", "-o", "out.ply"]
    done = run(*given, "--json")
    assert done.exit_code == 0, done.output
    (told,) = json.loads(done.stdout)["scans"]
    assert 0.8 < told["coverage"] < 0.95
    assert told["n_vertices"] == 600
    assert told["confidence"] is None
    assert told["distance_covered"]["within_95"] < 0.1 * told["tolerance"]
    assert told["distance_all"]["mean"] > told["distance_covered"]["mean"]
    written = read_mesh("out.ply")
    np.testing.assert_array_equal(written.faces, template().mesh.faces)
    header = (folder / "out.ply").read_bytes()[:400]
    assert b"property double distance\nproperty uchar red" in header
    rows = run(*given, "--report", "page.html").stdout.splitlines()
    html = Path("page.html").read_text("utf-8")
    assert f"{told['coverage']:.1%} of the template&#x27;s area lies on the scan, within " in html
    assert f"and {told['scan_coverage']:.1%} of the scan&#x27;s on the template" in html
    assert "; confidence not estimated.</p>" in html
    assert f"by distance from the scan, up to {told['tolerance']:.3g}</option>" in html
    assert rows[0].startswith(f"covered          {told['coverage']:.1%} of the area, within ")
    reached = f"{told['scan_coverage']:.1%} of its area"
    assert rows[1] == f"scan covered     {reached}, within a mean edge"
    assert rows[2].startswith("distance there   mean ")
    assert " in the scan's unit (" in rows[2]
    assert rows[4] == "confidence       not estimated"
    assert run(*given).stdout.splitlines()[-1] == (
        "next: open out.ply and scan.ply together in MeshLab or Blender; its colours are the "
        "distance from the scan"
    )
    given[-1] = "out.stl"
    done = run(*given)
    assert done.stdout.splitlines()[-1].endswith(" in MeshLab or Blender")
    note = "note: out.stl holds bare triangles: it does not number vertices like template.ply\n"
    assert note in done.stderr
    given[-1] = "out.vtp"
    assert " together in ParaView; its colours" in run(*given).stdout
    write_mesh("scan.vtp", read_mesh("scan.ply"))
    given[2], given[-1] = "scan.vtp", "out.ply"
    assert " together in ParaView; its colours" in run(*given).stdout
    write_map("same.npy", np.arange(600))
    run("register", *2 * ["template.ply"], "--map", "same.npy", "-o", "o.ply", "--report", "p.html")
    assert "by distance from the scan</option>" in Path("p.html").read_text("utf-8")


def test_it_matches_where_no_map_is_given(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    egg = make_egg(2)
    torn = keep(egg, egg.vertices[:, 1] > np.quantile(egg.vertices[:, 1], 0.2))
    write_mesh("egg.ply", egg)
    write_mesh("torn.ply", torn.mesh)
    Path("hints.csv").write_text("50,7\n")
    asked: list = []

    def match(source: Mesh, target: Mesh, *, progress: object, **options: object) -> Match:
        asked.append((source.n_vertices, target.n_vertices, options))
        return Match(torn.image, np.flatnonzero(torn.image >= 0), np.eye(2), 1.0, 0.9)

    monkeypatch.setattr("unbend.match", match)
    given = ["register", "egg.ply", "torn.ply", "--landmarks", "hints.csv"]
    done = run(*given, "--partial", "target", "--save-match", "saved.npz", "-o", "out.glb")
    assert done.exit_code == 0, done.output
    ((n, n_torn, options),) = asked
    assert (n, n_torn, options["partial"]) == (162, torn.mesh.n_vertices, "target")
    np.testing.assert_array_equal(options["landmarks"], [[50, 7]])
    np.testing.assert_array_equal(read_match("saved.npz").source_to_target, torn.image)
    assert "confidence       0.90, of the match" in done.stdout
    (fitted,) = trimesh.load("out.glb").geometry.values()
    lightest = fitted.visual.vertex_attributes["color"][:, 1].max()
    assert 0 < (fitted.visual.vertex_attributes["color"][:, 1] == lightest).mean() < 0.3


def test_it_warns_of_a_doubtful_match(folder: Path) -> None:
    truth = np.load("map.npy")
    back = np.zeros(read_mesh("scan.ply").n_vertices, dtype=np.int64)
    write_match("map.npz", Match(truth, back, np.eye(2), 0.5, 0.25))
    done = run("register", "template.ply", "scan.ply", "--map", "map.npz", "-o", "out.stl")
    assert "warning: the match is doubtful (confidence 0.25)" in done.stderr
    assert "confidence       0.25, of the match" in done.stdout


def test_many_scans_are_fitted_into_a_folder_and_a_bad_one_is_listed(folder: Path) -> None:
    template, scan, again = map(read_mesh, write_stones(folder / "stones", 3))
    write_mesh("template.ply", template, colors=np.zeros((162, 3), int))
    (folder / "scans").mkdir()
    write_mesh("scans/scan.ply", scan)
    write_mesh("scans/again.off", again)
    (folder / "scans" / "points.xyz").write_text("0 0 0\n1 0 0\n")
    (folder / "scans" / "bad.ply").write_bytes(b"ply\nnothing more")
    done = run("register", "template.ply", "scans", "scans/points.xyz", "-o", "out")
    assert done.exit_code == 1, done.output
    failed = [line for line in done.stderr.splitlines() if line.startswith("failed: ")]
    assert [line.split(": ")[1] for line in failed] == ["scans/bad.ply", "scans/points.xyz"]
    lines = done.stdout.splitlines()
    assert sorted(line.split()[0] for line in lines[1:3]) == ["scans/again.off", "scans/scan.ply"]
    assert "registered 2, there before 0, failed 2" in lines[6]
    fitted = sorted(folder.glob("out/*-*.ply"))
    for path in fitted:
        np.testing.assert_array_equal(read_mesh(path).faces, template.faces)
    assert [path.name.split("-")[0] for path in fitted] == ["again", "scan"]
    lost = f"note: {Path('out', '*.ply')} does not keep red, green, blue of template.ply\n"
    assert done.stderr.count(lost) == 1
    (folder / "scans" / "copy.ply").write_bytes((folder / "scans" / "scan.ply").read_bytes())
    given = ("register", "template.ply", "scans/scan.ply", "scans/copy.ply", "-o", "out")
    assert "scans/scan.ply (also scans/copy.ply)" in run(*given).stdout
    told = json.loads(run(*given, "--json").stdout)
    assert told["scans"][0]["also"] == [str(folder / "scans" / "copy.ply")]
    assert [one["file"] for one in told["scans"]] == [str(Path("out", fitted[1].name))]
    assert told["scans"][0]["n_vertices"] == 162
    assert "registered 1, there before 0" in run(*given, "--partial", "none").stdout


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("template.ply scan.ply -o out.npy", 'unknown suffix ".npy"'),
        ("points.xyz scan.ply --map map.npy -o out.ply", "this is a point cloud"),
        ("points.xyz scan.ply --save-match own.npz -o out.ply", "this is a point cloud"),
        ("scan.ply template.ply --map map.npy -o out.ply", "map.npy"),
        (
            "template.ply scan.ply --map from-1.txt -o out.ply",
            "if it counts from 1: add --base 1, or",
        ),
        ("template.ply scan.ply scan.ply -o out.ply", "2 meshes need a folder to write to"),
        ("template.ply scan.ply scan.ply --map map.npy -o out", "no folder; leave it out\n"),
    ],
)
def test_mistakes_get_one_sentence_and_write_nothing(
    folder: Path, arguments: str, sentence: str
) -> None:
    before = sorted(folder.iterdir())
    done = run("register", *arguments.split())
    assert done.exit_code == 2, done.output
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
    assert sorted(folder.iterdir()) == before
