"""match, evaluate, transfer and similarity as commands: one story on two poses of a dog."""

import functools
import json
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from animals import dog
from sheets import make_egg, make_torus
from stones import write_stones
from terminal import invoke
from testshapes.damage import keep
from unbend import morph, read_mesh, write_mesh
from unbend.cli._output import warn_if_doubtful
from unbend.cli.match import summary
from unbend.correspondence import read_match, write_match
from unbend.datasets import make_quadruped, make_sphere, rest_map
from unbend.io import read_map, read_values, write_map, write_values
from unbend.matching import Hypothesis, Match
from unbend.report import match_colors

source = functools.partial(dog, "standing", n_vertices=600)
target = functools.partial(dog, "walking", n_vertices=500, meshing=1)


def run(*arguments):
    return invoke(arguments)


def right(*arguments):
    done = run(*arguments)
    assert done.exit_code == 0, done.output
    return done


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Both dogs, the truth, and their match as the command wrote it."""
    path = tmp_path_factory.mktemp("dogs")
    write_mesh(path / "a.ply", source().mesh)
    write_mesh(path / "b.ply", target().mesh)
    truth = rest_map(source(), target())
    write_map(path / "a.vts", np.arange(600))
    write_map(path / "b.vts", truth)
    write_map(path / "b.sym.vts", target().mirror[truth])
    figure = path / "match.png"
    shown = ["--figure", figure, "--report", path / "match.html"]
    shown += ["--colored", path / "a.glb", path / "b_colored.ply"]
    known = ["--truth", path / "a.vts", path / "b.vts"]
    out = ["-o", path / "ab.npz", "--json"]
    done = right("match", path / "a.ply", path / "b.ply", *out, *shown, *known)
    (path / "match.json").write_text(done.stdout)
    return path


def test_match_tells_and_writes_what_it_found(folder: Path) -> None:
    told = json.loads((folder / "match.json").read_text())
    written = read_match(folder / "ab.npz")
    assert (told["n_matched"], told["n_source"], told["n_target"]) == (600, 600, 500)
    assert told["confidence"] == written.confidence > 0.5
    assert told["confidence_bound"] == written.confidence_bound == 1
    assert told["orientation"] == written.orientation > 0
    assert len(told["hypotheses"]) == len(written.hypotheses)
    assert (told["expected_error"]["median"], told["expected_error"]["within_95"]) == (
        written.expected_error_quantiles()
    )
    assert written.faces is not None
    assert (folder / "match.png").read_bytes().startswith(b"\x89PNG")
    page = (folder / "match.html").read_text(encoding="utf-8")
    assert f"confidence {written.confidence:.2f}" in page
    assert "points counted</th><td>600<" in page
    assert {str(folder / "a.glb"), str(folder / "b_colored.ply")} < set(told["written"])
    colors = match_colors(folder / "a.ply", folder / "b.ply", written)
    seen = trimesh.load(folder / "b_colored.ply", process=False).visual.vertex_colors
    np.testing.assert_array_equal(seen[:, :3], colors[1])
    assert (folder / "a.glb").read_bytes().startswith(b"glTF")


def test_match_writes_a_map_without_the_rest_of_the_match(tmp_path: Path) -> None:
    out = tmp_path / "map.vts"
    done = right("match", *write_stones(tmp_path, 2), "-o", out, "--no-refine")
    *found, written, next_step = done.stdout.splitlines()
    assert written == f"written: {out}"
    told = dict(line.split(maxsplit=1) for line in found)
    assert told["matched"].startswith("162 vertices of stone00.ply to stone01.ply, ")
    confidence = float(told["confidence"].split()[0])
    assert 0 <= confidence <= 1
    goes_on = "unbend transfer" if confidence >= 0.6 else "add --report"
    assert next_step.startswith(f"next: {goes_on}")
    assert len(read_map(out, n_target=162)) == 162


def test_a_doubtful_map_is_to_be_looked_at_and_not_to_be_used(tmp_path: Path) -> None:
    (stone,) = write_stones(tmp_path, 1)
    write_mesh(tmp_path / "ring.ply", make_torus(20, 8))
    out = tmp_path / "map.npz"
    done = right("match", stone, tmp_path / "ring.ply", "-o", out, "--no-refine")
    assert "the match is doubtful" in done.stderr
    assert done.stdout.endswith(f"written: {out}\nnext: add --report HTML to look at it\n")


def test_match_takes_a_component(tmp_path: Path) -> None:
    large, other = write_stones(tmp_path, 2)
    stone, ball = read_mesh(large), make_sphere(1)
    both = np.vstack([ball.vertices / 2, stone.vertices + 9])
    write_mesh(tmp_path / "two.ply", (both, np.vstack([ball.faces, stone.faces + 42])))
    arguments = ["match", tmp_path / "two.ply", other, "--no-refine"]
    whole = right(*arguments)
    assert "204 vertices" in whole.stdout
    assert "its largest component is matched, 162 of 204 vertices" in whole.stderr
    done = right(*arguments, "--component", "largest")
    assert "162 of 204 vertices" in done.stdout
    assert "42 unreferenced vertices get no values (NaN) and no partners (-1)" in done.stderr
    assert "next: add -o MAP.npz" in done.stdout
    # The other shape has no second component, and is matched as it is.
    done = right(*arguments, "--component", "1")
    assert f"42 of 204 vertices of two.ply to {other.name}" in done.stdout
    assert "numbers go by size" not in done.stderr
    # Of both shapes the second is taken, which need not be the same part.
    swapped = np.vstack([stone.vertices / 9, ball.vertices + 9])
    write_mesh(tmp_path / "other.ply", (swapped, np.vstack([stone.faces, ball.faces + 162])))
    done = right("match", other, tmp_path / "other.ply", "--no-refine", "-o", tmp_path / "map.npz")
    assert "next: if the body of other.ply is component 1, add --component 1\n" in done.stdout
    twice = ["match", tmp_path / "two.ply", tmp_path / "other.ply", "--component", "1"]
    done = right(*twice, "--no-refine")
    assert "component 1 is 42 vertices of two.ply, 42 vertices of other.ply: numbers" in done.stderr
    for paths in (arguments[:3], ["match", other, other]):
        done = run(*paths, "--component", "2")
        assert done.exit_code == 2
        assert "there is no component 2" in done.stderr
    # What the command suggests takes the map, whose places are on the faces of that component.
    egg = make_egg(2)
    write_mesh(tmp_path / "egg.ply", egg)
    both = np.vstack([ball.vertices / 2 + 9, egg.vertices])
    write_mesh(tmp_path / "two.ply", (both, np.vstack([ball.faces, egg.faces + 42])))
    given = ["match", tmp_path / "egg.ply", tmp_path / "two.ply", "--component", "largest"]
    done = right(*given, "--no-refine", "-o", tmp_path / "map.npz")
    np.save(tmp_path / "values.npy", np.arange(162) / 7)
    said = done.stdout.splitlines()[-1].removeprefix("next: unbend ")
    said = said.replace("VALUES", f"{tmp_path}/values").replace("OUT", f"{tmp_path}/out")
    right(*shlex.split(said))
    carried = np.load(tmp_path / "out.npy")
    assert np.isnan(carried[:42]).all()
    assert np.isfinite(carried[42:]).mean() > 0.9
    refused = run(*shlex.split(said)[:-2])
    assert refused.exit_code == 2
    assert "source and target as then, choose the same component, or match again" in refused.stderr


def test_match_of_a_part_with_hints_and_alternatives(tmp_path: Path) -> None:
    egg = make_egg(2)
    torn = keep(egg, egg.vertices[:, 1] > np.quantile(egg.vertices[:, 1], 0.2))
    write_mesh(tmp_path / "egg.ply", egg)
    write_mesh(tmp_path / "torn.ply", torn.mesh)
    assert torn.image[50] >= 0
    (tmp_path / "hints.csv").write_text(f"source,target\n50,{torn.image[50]}\n")
    out = tmp_path / "map.npz"
    told = json.loads(
        right(
            *("match", tmp_path / "egg.ply", tmp_path / "torn.ply", "-o", out),
            *("--partial", "target"),
            *("--landmarks", tmp_path / "hints.csv", "--n-matches", "2"),
            *("--figure", tmp_path / "torn.png", "--json"),
        ).stdout
    )
    written = read_match(out)
    assert (written.source_to_target[torn.image < 0] < 0).mean() > 0.8
    assert told["n_matched"] == int((written.source_to_target >= 0).sum()) < 162
    assert 0.7 < told["overlap_source"] == written.overlap_source < 0.9
    assert told["overlap_target"] == 1
    assert told["missed_landmarks"] == []
    (other,) = told["alternatives"]
    assert other["confidence"] <= told["confidence"]
    assert told["written"][:2] == [str(out), str(tmp_path / "map-2.npz")]
    assert len(read_match(told["written"][1]).source_to_target) == 162


def test_fewer_maps_than_asked_for_are_told(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = Hypothesis(0.1, 1.0), Hypothesis(0.1, 1.0, 0.025)
    found = replace(read_match(folder / "ab.npz"), confidence=0.8, hypotheses=tried)
    found = replace(found, alternatives=(found,))
    monkeypatch.setattr("unbend.match", lambda *shapes, **options: found)
    given = ["match", folder / "a.ply", folder / "b.ply", "-o", tmp_path / "map.csv"]
    done = right(*given, "--n-matches", 4)
    assert "note: 2 distinct maps found, not 4\n" in done.stderr
    assert "differs by 2.5% of the size on average\n" in done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map-2.csv", "map.csv"]
    assert "distinct" not in right(*given, "--n-matches", 2).stderr


def test_a_map_in_disorder_is_said_by_whatever_uses_it(folder: Path, tmp_path: Path) -> None:
    """Its confidence is bounded by what it shows; the terminal, JSON and files say so."""
    poor = replace(
        read_match(folder / "ab.npz"), orientation=0.68, confidence=0.1, confidence_bound=0.1
    )
    write_match(tmp_path / "poor.npz", poor)
    shapes = [folder / "a.ply", folder / "b.ply"]
    given = [*shapes, "--map", tmp_path / "poor.npz"]
    np.save(tmp_path / "values.npy", np.arange(600.0))
    carried = right("transfer", *given, "--values", tmp_path / "values.npy", "-o",
                    tmp_path / "out.npy")  # fmt: skip
    fitted = right("register", *given, "-o", tmp_path / "fitted.ply")
    for done in (carried, fitted):
        assert done.stderr.count("warning: part of the map is wrong") == 1
        assert "orientation +0.68, confidence at most 0.10" in done.stderr
        assert "warning: the match is doubtful (confidence 0.10)" in done.stderr
    told = summary([source().mesh, target().mesh], poor, 1.0)
    assert told["orientation"] == "84% of the surface right side out"
    assert told["confidence"] == "0.10 (limited to 0.10 by errors of the final map)"
    assert told["overlap"] == "100% of the source's area, 100% of the target's"
    told = summary([source().mesh, target().mesh], replace(poor, confidence_bound=0.997), 1.0)
    assert told["confidence"] == "0.10"  # not "limited to 1.00"


def test_doubt_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    every = np.arange(5)
    poor = Match(every, every, np.eye(1), 1.0, 0.59)
    for confidence in (0.9, 0.5999, float("nan")):  # 0.5999 is shown as 0.60
        warn_if_doubtful(replace(poor, confidence=confidence))
    assert capsys.readouterr().err == ""
    warn_if_doubtful(poor)
    told = capsys.readouterr().err
    assert told.startswith(
        "warning: the match is doubtful (confidence 0.59): the shapes may differ"
    )
    assert "unbend match --report" in told
    warn_if_doubtful(replace(poor, confidence=0.1), seen=True)
    assert "--report" not in capsys.readouterr().err
    warn_if_doubtful(replace(poor, confidence_bound=0.5))
    assert "(confidence 0.59): the final map is in disorder" in capsys.readouterr().err
    warn_if_doubtful(replace(poor, confidence_bound=0.9))
    assert "disorder" not in capsys.readouterr().err  # which would still allow 0.9
    warn_if_doubtful(replace(poor, overlap_target=0.8))
    assert capsys.readouterr().err.endswith(
        ", or with --partial none if neither shape lacks a part\n"
    )
    warn_if_doubtful(replace(poor, mirror_fits=True))
    assert capsys.readouterr().err.startswith("warning: the mirror image of the target fits better")
    warn_if_doubtful(replace(poor, landmark_hints=(3, 1)))
    told = capsys.readouterr().err
    assert "another map is nearly as good" in told
    where = "best at source vertex 3 or 1 (counted from 0)"
    assert f"place landmarks with unbend view, {where}, and match again with --landmarks" in told


@pytest.mark.parametrize(
    ("orientation", "words"),
    [
        (0.6, "80% of the surface right side out"),
        (-0.6, "80% of the surface inside out, a reflection"),
        (0.02, "unclear which side is out"),
    ],
)
def test_the_side_is_said(folder: Path, orientation: float, words: str) -> None:
    found = replace(read_match(folder / "ab.npz"), orientation=orientation)
    assert summary([source().mesh, target().mesh], found, 1.0)["orientation"] == words


def test_evaluate_prints_a_table_and_draws_curves(folder: Path, tmp_path: Path) -> None:
    arguments = [folder / "ab.npz", folder / "b.ply", folder / "a.vts", folder / "b.vts"]
    mirrored = ["--mirrored-truth", folder / "b.sym.vts"]
    done = right("evaluate", *arguments, *mirrored, "--figure", tmp_path / "curves.png")
    lines = done.stdout.splitlines()
    assert lines[0].split()[:4] == ["protocol", "mean", "median", "AUC"]
    assert [line.split()[0] for line in lines[1:4]] == ["direct", "map-min", "vertex-min"]
    assert float(lines[1].split()[1]) < 0.05
    assert lines[-2].startswith("600 rows; ")
    assert lines[-1] == f"written: {tmp_path / 'curves.png'}"
    assert (tmp_path / "curves.png").exists()
    some = target().mirror[rest_map(source(), target())]
    some[:300] = -1
    write_map(tmp_path / "some.vts", some)
    done = right("evaluate", *arguments, "--mirrored-truth", tmp_path / "some.vts")
    assert done.stdout.splitlines()[-1].startswith("600 rows, 300 of them with a mirrored truth; ")
    assert done.stdout.splitlines()[1] == lines[1]
    told = json.loads(right("evaluate", *arguments, "--json").stdout)
    assert list(told["protocols"]) == ["direct"]
    assert told["protocols"]["direct"]["n_rows"] == told["n_rows"] == 600
    assert f"{told['protocols']['direct']['mean']:.4f}" == lines[1].split()[1]
    part = np.where(np.arange(600) < 80, -1, rest_map(source(), target()))
    write_map(tmp_path / "part.vts", part)
    every = tmp_path / "every.vts"
    write_map(every, np.arange(600))
    done = right("evaluate", *arguments[:2], every, tmp_path / "part.vts")
    overlap = done.stdout.splitlines()[-1]
    assert overlap.startswith("overlap: ")
    assert overlap.endswith("% precision, 100.0% recall")
    # The truth itself has no error, whatever its file counts from.
    for name, base in (("t.txt", 1), ("t.vts", 0)):
        write_map(tmp_path / name, rest_map(source(), target()), base=base)
        told = right("evaluate", tmp_path / name, *arguments[1:], "--json", "--base", base).stdout
        assert json.loads(told)["protocols"]["direct"]["mean"] == 0
    told = "far nearer the truth if they count from 1: name them .vts, if they do"
    rows = np.arange(1, 500)
    for name, images in (("rows.txt", rows), ("images.txt", rest_map(source(), target())[rows])):
        write_map(tmp_path / name, images, base=1)
    rows_and_images = [tmp_path / "rows.txt", tmp_path / "images.txt"]
    assert told in right("evaluate", *arguments[:2], *rows_and_images).stderr
    given = [
        "match",
        folder / "a.ply",
        folder / "b.ply",
        "--no-refine",
        "--report",
        tmp_path / "p.html",
    ]
    assert told in right(*given, "--truth", *rows_and_images).stderr


def test_transfer_carries_labels_weights_and_colors(folder: Path, tmp_path: Path) -> None:
    parts = np.array(source().parts)[source().labels]
    write_values(tmp_path / "parts.csv", parts, source().mesh, kind="label")
    np.save(tmp_path / "weights.npy", np.eye(len(source().parts))[source().labels])
    np.save(tmp_path / "colors.npy", np.full((600, 3), 7, np.uint8))
    given = ["transfer", folder / "a.ply", folder / "b.ply", "--map", folder / "ab.npz"]
    done = right(*given, "--values", tmp_path / "parts.csv", "-o", tmp_path / "out.csv")
    assert done.stdout.splitlines()[0] == "carried  500 values (label)"
    truth = np.array(target().parts)[target().labels]
    assert (read_values(tmp_path / "out.csv") == truth).mean() > 0.95
    heights = np.where(source().labels == 0, np.nan, source().mesh.vertices[:, 1])
    np.save(tmp_path / "heights.npy", heights)
    done = right(*given, "--values", tmp_path / "heights.npy", "-o", tmp_path / "heights.csv")
    n_known = np.isfinite(read_values(tmp_path / "heights.csv")).sum()
    assert 0 < n_known < 500
    assert done.stdout.splitlines()[0] == f"carried  {n_known} of 500 values (scalar)"
    options = ["--kind", "weights", "-o", tmp_path / "out.npy", "--json"]
    done = right(*given, "--values", tmp_path / "weights.npy", *options)
    told = json.loads(done.stdout)
    assert (told["shape"], told["kind"], told["n_without_preimage"]) == ([500, 7], "weights", 0)
    np.testing.assert_allclose(np.load(tmp_path / "out.npy").sum(axis=1), 1)
    right(*given, "--values", tmp_path / "colors.npy", "-o", tmp_path / "out.ply")
    np.testing.assert_array_equal(read_mesh(tmp_path / "out.ply").vertices, target().mesh.vertices)
    # A bare point map is turned round.
    given[-1] = folder / "b.vts"
    right(*given, "--values", tmp_path / "parts.csv", "-o", tmp_path / "turned.csv")
    assert (read_values(tmp_path / "turned.csv") == truth).mean() > 0.95


def test_values_cross_the_seams_of_the_target_by_a_table(tmp_path: Path) -> None:
    ball = make_sphere(2)
    below = ball.vertices[ball.faces].mean(axis=1)[:, 2] < 0  # has vertices of its own
    faces = ball.faces + ball.n_vertices * below[:, None]
    used, faces = np.unique(faces, return_inverse=True)
    cut = ball.vertices[used % ball.n_vertices], faces.reshape(-1, 3)
    above = np.flatnonzero(used < ball.n_vertices)
    write_mesh(tmp_path / "ball.ply", ball)
    write_mesh(tmp_path / "cut.ply", cut)
    np.save(tmp_path / "map.npy", above[cKDTree(cut[0][above]).query(ball.vertices)[1]])
    np.save(tmp_path / "heights.npy", ball.vertices[:, 2])
    given = [tmp_path / "ball.ply", tmp_path / "cut.ply", "--map", tmp_path / "map.npy"]
    options = ["--values", tmp_path / "heights.npy", "-o", tmp_path / "out.npy", "--json"]
    done = right("transfer", *given, *options)
    assert np.isfinite(np.load(tmp_path / "out.npy")).all()
    assert json.loads(done.stdout)["n_without_preimage"] == 0
    assert "correspond to none" not in done.stderr


def test_an_unsure_match_is_told_but_not_written_and_exits_with_3(tmp_path: Path) -> None:
    out, shapes = tmp_path / "map.npz", write_stones(tmp_path, 2)
    done = run("match", *shapes, "-o", out, "--json", "--no-refine", "--min-confidence", 1)
    assert (done.exit_code, json.loads(done.stdout)["written"]) == (3, [])
    assert "error: the match's confidence is " in done.stderr
    assert "below 1: no file written" in done.stderr
    assert not out.exists()


def test_transfer_writes_where_it_is_to_be_trusted(folder: Path, tmp_path: Path) -> None:
    values = tmp_path / "values.txt"
    np.savetxt(values, np.arange(600.0))
    given = ["transfer", folder / "a.ply", folder / "b.ply", "--values", values]
    out = ["-o", tmp_path / "out.npy", "--expected-error", tmp_path / "errors.csv"]
    told = json.loads(right(*given, "--map", folder / "ab.npz", *out, "--json").stdout)
    assert str(tmp_path / "errors.csv") in told["written"]
    errors = read_values(tmp_path / "errors.csv")
    found = read_match(folder / "ab.npz")
    assert errors.shape == (500,)
    assert (errors >= found.expected_error.min() - 1e-9).all()
    assert (errors <= found.expected_error.max() + 1e-9).all()
    points = tmp_path / "points.csv"
    points.write_text("label,vertex\nnose,3\ntail,500\n")
    line = [*given[:-1], points, "--map", folder / "ab.npz", "-o", tmp_path / "b.mrk.json"]
    right(*line, "--expected-error", tmp_path / "errors.csv")
    nose, tail = found.expected_error[[3, 500]].tolist()
    told = (tmp_path / "errors.csv").read_text().split()
    assert told == ["label,expected_error", f"nose,{nose}", f"tail,{tail}"]
    refused = run(*line, "--expected-error", tmp_path / "errors.npy")
    assert (refused.exit_code, (tmp_path / "errors.npy").exists()) == (2, False)
    write_match(tmp_path / "old.npz", replace(found, expected_error=None))
    refused = run(*given, "--map", tmp_path / "old.npz", *out)
    assert refused.exit_code == 2
    assert "has no expected errors" in refused.output


def test_transfer_and_register_refuse_an_unsure_match(folder: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "values.npy", np.arange(600.0))
    poor = replace(read_match(folder / "ab.npz"), confidence=0.6)
    write_match(tmp_path / "map.npz", poor)
    given = [folder / "a.ply", folder / "b.ply", "--map", tmp_path / "map.npz"]
    values = ["--values", tmp_path / "values.npy"]
    before = sorted(tmp_path.iterdir())
    for command in ("register", "transfer"):
        more = values if command == "transfer" else []
        line = [command, *given, *more, "-o", tmp_path / "out.ply", "--min-confidence"]
        done = run(*line, 0.7)
        assert (done.exit_code, done.stdout) == (3, "")
        assert done.stderr == ("error: the match's confidence is 0.6, below 0.7: no file written\n")
        told = json.loads(run(*line, 0.7, "--json").stdout)
        assert (told["confidence"], told["written"]) == (0.6, [])
        assert sorted(tmp_path.iterdir()) == before
        right(*line, 0.6)
        (tmp_path / "out.ply").unlink()


def test_transfer_takes_what_match_takes_and_keeps_the_match(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, given = read_match(folder / "ab.npz"), {}

    def match(source, target, *, progress, **options):
        given.update(options, shapes=[source.n_vertices, target.n_vertices])
        return found

    monkeypatch.setattr("unbend.match", match)
    write_values(tmp_path / "parts.txt", source().labels, source().mesh)
    (tmp_path / "hints.csv").write_text("5,7\n")
    hints = ["--landmarks", tmp_path / "hints.csv", "--partial", "none"]
    saved = tmp_path / "saved.npz"
    out = ["-o", tmp_path / "out.txt", "--save-match", saved]
    shapes = [folder / "a.ply", folder / "b.ply"]
    done = right("transfer", *shapes, "--values", tmp_path / "parts.txt", *hints, *out, "--json")
    assert given.pop("landmarks").tolist() == [[5, 7]]
    assert given == {"partial": "none", "barycentric": True, "shapes": [600, 500]}
    told = json.loads(done.stdout)
    assert told["written"] == [str(tmp_path / "out.txt"), str(saved)]
    assert (read_values(tmp_path / "out.txt") == target().labels).mean() > 0.95
    kept = read_match(saved)
    assert kept.confidence == told["confidence"]
    assert kept.faces is not None
    np.testing.assert_array_equal(kept.source_to_target, found.source_to_target)


def test_similarity_sorts_and_tabulates(folder: Path, tmp_path: Path) -> None:
    write_mesh(tmp_path / "pose.ply", make_quadruped("sitting", n_vertices=600).mesh)
    write_mesh(tmp_path / "flat.ply", (source().mesh.vertices * [1, 5, 1], source().mesh.faces))
    shapes = [folder / "a.ply", tmp_path / "flat.ply", tmp_path / "pose.ply"]
    table = tmp_path / "table.csv"
    done = right("similarity", *shapes, "--known-correspondence", "--csv", table)
    lines = [line.split() for line in done.stdout.splitlines()]
    assert [line[0] for line in lines] == ["probe", str(shapes[2]), str(shapes[1]), "written:"]
    assert 1 >= float(lines[1][1]) > float(lines[2][1])
    assert len(table.read_text().splitlines()) == 3
    options = ["--known-correspondence", "--matrix", "--csv", table]
    done = right("similarity", *shapes, *options, "--figure", tmp_path / "heat.png")
    assert (tmp_path / "heat.png").exists()
    page = tmp_path / "page.html"
    for more, title in (("--matrix", "How alike 3 shapes are"), ("--up=z", "Most like a.ply")):
        told = right("similarity", *shapes, "--known-correspondence", more, "--report", page)
        assert told.stdout.endswith(f"next: open {page} in a browser\n")
        assert f"<title>{title}</title>" in page.read_text(encoding="utf-8")
    rows = [line.split(",") for line in table.read_text().splitlines()]
    values = np.array([row[1:] for row in rows[1:]], float)
    np.testing.assert_array_equal(values, values.T)
    np.testing.assert_array_equal(np.diag(values), 1)
    assert done.stdout.splitlines()[1].startswith(str(shapes[0]))


def test_similarity_warns_of_a_shape_once(tmp_path: Path) -> None:
    egg = make_egg(2)
    for name in "abc":
        write_mesh(tmp_path / f"{name}.ply", (egg.vertices, egg.faces[:, ::-1]))
    done = right("similarity", *(tmp_path / f"{name}.ply" for name in "abc"), "--matrix", "--json")
    inward = [one for one in json.loads(done.stdout)["warnings"] if "oriented inward" in one]
    assert [one.split(": its")[0] for one in inward] == [
        "a.ply to b.ply: a.ply",
        "a.ply to b.ply: b.ply",
        "a.ply to c.ply: c.ply",
    ]


def test_similarity_of_shapes_meshed_apart(tmp_path: Path) -> None:
    for level in (2, 3):
        write_mesh(tmp_path / f"egg{level}.ply", make_egg(level))
    write_mesh(tmp_path / "ring.ply", make_torus(20, 8))
    page, shapes = tmp_path / "page.html", (tmp_path / "egg3.ply", tmp_path / "ring.ply")
    options = ("--n-components", 8, "--report", page, "--json")
    done = right("similarity", tmp_path / "egg2.ply", *shapes, *options)
    told = json.loads(done.stdout)
    assert told["warnings"]
    assert all(one.startswith("egg2.ply to ring.ply: ") for one in told["warnings"])
    pair, other = told["pairs"]
    assert pair["similarity"] > 0.97
    assert pair["confidence"] > 0.6 > other["confidence"]
    html = page.read_text(encoding="utf-8")
    assert "ring.ply (doubtful match)" in html
    assert "egg3.ply (doubtful match)" not in html
    done = right("similarity", tmp_path / "egg2.ply", *shapes, *options[:-1], "--matrix")
    html = page.read_text(encoding="utf-8")
    for name in ("egg2.ply", "egg3.ply"):
        told = "doubtful match to ring.ply, confidence 0."
        assert f"note: {name}: {told}" in done.stderr
        assert told in html
    assert "doubtful match to egg3.ply" not in done.stderr + html


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("match a.ply none.ply", "there is no such file"),
        ("match a.ply b.ply -o map.foo", 'unknown suffix ".foo"'),
        ("match a.ply b.ply --figure map.bmp", 'unknown suffix ".bmp"'),
        ("match a.ply b.ply --colored a.glb b.off", 'unknown suffix ".off"'),
        ("match a.ply b.ply --colored c.glb ./c.glb", "two results cannot be written to one file"),
        (
            "transfer a.ply b.ply --values v.npy -o t.npy --expected-error t.npy",
            "two results cannot be written to one file: t.npy",
        ),
        ("match a.ply b.ply --report map.pdf", 'unknown suffix ".pdf"'),
        ("match a.ply b.ply --truth a.vts b.vts", "shown by --report"),
        ("match a.ply b.ply --up z", "--up is for pictures, and none is drawn"),
        ("register a.ply b.ply -o out.ply --up y", "--up is for pictures"),
        ("match a.ply b.ply --report r.html --mirrored-truth a.vts", "needs --truth"),
        ("match a.ply b.ply --n-eigenpairs 2", "at least 4"),
        ("match a.ply b.ply --landmarks long.vts", "unknown suffix"),
        ("match a.ply b.ply --landmarks words.txt", "a landmark is two vertex numbers"),
        ("match a.ply b.ply --n-matches 0", "n_matches must be a whole number of at least 1"),
        ("match a.ply b.ply --component x", "--component must be"),
        ("match points.xyz b.ply -o new.npz --report r.html", "points.xyz: 4 points"),
        ("evaluate b.vts b.ply a.vts a.vts", "row 500 is"),
        (
            "evaluate b.vts b.ply long.vts b.vts",
            "long.vts: row 599 is 601, but counted from 1 vertices are 1 to 600",
        ),
        (
            "evaluate b.vts b.ply none.txt b.vts",
            "none.txt: row 1 is -1, but each must be a source vertex",
        ),
        (
            "evaluate ab.npz a.vts a.vts b.vts",
            'unknown suffix ".vts"',
        ),
        (
            "evaluate b.vts --base 2 b.ply a.vts b.vts",
            "base must be 0 or 1",
        ),
        (
            "evaluate ab.npz --base 1 b.ply a.vts b.vts",
            "--base is for tables, and ab.npz is a .npz match",
        ),
        (
            "transfer a.ply b.ply --values other600.txt -o out.csv --map ab.npz --partial none",
            "--landmarks, --partial and --save-match are for matching",
        ),
        (
            "transfer a.ply b.ply --values other600.txt -o out.csv --map b.vts "
            "--min-confidence 0.5",
            "--min-confidence needs a .npz match, and b.vts is none",
        ),
        ("register a.ply b.ply -o out.ply --base 1", "--base is for --map"),
        ("register a.ply b.ply -o out.ply --save-match map.ply", 'unknown suffix ".ply"'),
        ("match a.ply b.ply --min-confidence 0.5 --landmarks none.csv", "there is no such file"),
        ("transfer a.ply b.ply --values b.vts -o out.csv", 'unknown suffix ".vts"'),
        ("transfer a.ply b.ply --values few.txt -o out.csv", "few.txt: holds 2 rows"),
        ("transfer a.ply b.ply --values words.txt -o out.ply", "cannot hold text"),
        ("transfer a.ply b.ply --values words.txt --kind scalar -o o.csv --map b.vts", "averaged"),
        (
            "transfer b.ply a.ply --values other.txt -o out.csv --map ab.npz",
            "maps a.ply to b.ply: exchange",
        ),
        ("similarity a.ply b.ply --figure heat.png", "add --matrix"),
        (
            "similarity a.ply b.ply --known-correspondence",
            "a.ply and b.ply have 600 and 500 vertices",
        ),
        ("similarity a.ply b.ply --csv table.txt", 'unknown suffix ".txt"'),
        ("similarity a.ply b.ply --report page.pdf", 'unknown suffix ".pdf"'),
    ],
)
def test_mistakes_get_one_sentence_and_write_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch, arguments: str, message: str
) -> None:
    monkeypatch.chdir(folder)
    write_map("long.vts", np.append(np.arange(599), 600))
    write_map("none.txt", [0, -1] * 300)
    Path("few.txt").write_text("1\n2\n")
    Path("points.xyz").write_text("0 0 0\n1 0 0\n0 1 0\n0 0 1\n")
    Path("words.txt").write_text("a\n" * 600)
    Path("other.txt").write_text("1\n" * 500)
    Path("other600.txt").write_text("1\n" * 600)
    before = sorted(folder.iterdir())
    done = run(*arguments.split())
    assert done.exit_code == 2, done.output
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""
    assert sorted(folder.iterdir()) == before


def test_symmetry_writes_the_mirror_partners(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    egg, out = make_egg(2), tmp_path / "p.csv"
    write_mesh(tmp_path / "egg.ply", egg)
    told = json.loads(right("symmetry", tmp_path / "egg.ply", "-o", out, "--json").stdout)
    assert told["confidence"] > 0.5 > 0 > told["orientation"]
    partners = egg.vertices[read_map(out)]
    np.testing.assert_allclose(partners * [-1, 1, 1], egg.vertices, atol=1e-6)
    monkeypatch.setattr("unbend.cli.match.is_doubtful", lambda confidence: True)
    before = sorted(tmp_path.iterdir())
    unsure = ["--min-confidence", 1, "--no-refine", "-o", tmp_path / "none.csv"]
    done = run("symmetry", tmp_path / "egg.ply", *unsure, "--report", tmp_path / "none.html")
    assert done.exit_code == 3
    assert sorted(tmp_path.iterdir()) == before
    assert "the shape may have none" in done.stderr
    assert "look at it with unbend symmetry --report" in done.stderr  # not with a page that is not
    assert "try again with --landmarks" in done.stderr
    (tmp_path / "tips.csv").write_text("0,641\n")
    done = run("symmetry", tmp_path / "egg.ply", "--landmarks", tmp_path / "tips.csv")
    assert done.exit_code == 2
    assert "641" in done.stderr


def test_morph_writes_the_shapes_between(folder: Path) -> None:
    given = ["morph", folder / "a.ply", folder / "b.ply", "--map", folder / "ab.npz"]
    right(*given, "-o", folder / "half.off")
    right(*given, "--steps", 10, "-o", folder / "frame.off")
    found = read_match(folder / "ab.npz")
    for name, t in (("half", 1 / 2), ("frame-01", 1 / 11), ("frame-10", 10 / 11)):
        between = read_mesh(folder / f"{name}.off")
        expected = morph(source().mesh, target().mesh, found, t)
        np.testing.assert_allclose(between.vertices, expected.vertices, atol=1e-6)
        np.testing.assert_array_equal(between.faces, source().mesh.faces)
    done = right(*given, "-o", folder / "half.vtp")
    assert done.stdout.endswith(" in ParaView\n")
