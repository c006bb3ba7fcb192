import json

import numpy as np
import pytest

from terminal import invoke
from unbend import canonical_form, lay_into_pose, read_mesh, sampled_canonical_form, write_mesh


def run(*arguments):
    return invoke(["canonical", *map(str, arguments)])


@pytest.fixture
def mesh(blob, tmp_path):
    write_mesh(tmp_path / "blob.off", blob)
    return tmp_path / "blob.off"


@pytest.mark.parametrize("suffix", [".ply", ".off", ".obj"])
def test_writes_the_form_with_the_same_faces_and_order(mesh, blob, tmp_path, suffix):
    out = tmp_path / f"form{suffix}"
    done = run(mesh, "-o", out)
    assert done.exit_code == 0, done.output
    written = read_mesh(out)
    np.testing.assert_array_equal(written.faces, blob.faces)
    np.testing.assert_array_equal(written.vertices, canonical_form(blob).points)


@pytest.mark.parametrize("suffix", [".npy", ".csv"])
def test_writes_any_dimension_as_a_table(mesh, blob, tmp_path, suffix):
    out = tmp_path / f"form{suffix}"
    assert run(mesh, "-o", out, "--n-components", 5, "--weighting", "area").exit_code == 0
    table = np.load(out) if suffix == ".npy" else np.loadtxt(out, delimiter=",", skiprows=1)
    form = canonical_form(blob, n_components=5, weighting="area")
    np.testing.assert_array_equal(table, form.points)


def test_writes_a_page(mesh, tmp_path):
    page = tmp_path / "form.html"
    done = run(mesh, "--report", page, "--up", "z")
    assert done.stdout.splitlines()[-1] == f"next: open {page} in a browser"
    assert "blob.off" in page.read_text(encoding="utf-8")
    assert run(mesh, "--report", tmp_path / "form.pdf").exit_code == 2


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_a_figure_can_be_drawn(mesh, tmp_path, suffix):
    path = tmp_path / f"form{suffix}"
    done = run(mesh, "--figure", path, "--detail", "preserved", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["written"] == [str(path)]
    begins = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}[suffix]
    assert path.read_bytes().startswith(begins)


def test_prints_aligned_rows_and_the_next_step(mesh):
    *lines, last = run(mesh).stdout.splitlines()
    rows = dict(line.split(maxsplit=1) for line in lines)
    assert rows["mesh"] == "blob.off, 642 vertices, 1,280 faces"
    assert rows["form"] == "exact biharmonic, uniform weights, cotangent Laplacian"
    assert len({line.index(line.split(maxsplit=1)[1]) for line in lines}) == 1
    assert last == "next: add -o OUT.ply to write the form, --report HTML to look at it"


@pytest.mark.parametrize("options", [{"n_samples": 50}, {"n_eigenpairs": 30}])
def test_samples_or_eigenpairs_ask_for_the_form_of_the_paper(mesh, blob, options):
    words = [f"--{name.replace('_', '-')}={value}" for name, value in options.items()]
    (found,) = json.loads(run(mesh, "--json", *words).stdout)["files"]
    form = sampled_canonical_form(blob, **options)
    assert found["eigenvalues"] == list(form.eigenvalues)
    assert (found["n_vertices"], found["n_faces"]) == (642, 1280)
    assert (found["method"], found["distance"]) == ("sampled", "biharmonic")
    assert found["stress"] == form.stress
    assert "scaling" in found["steps"]


def test_every_option_reaches_the_library(mesh, blob, tmp_path):
    out = tmp_path / "form.npy"
    options = (
        "--n-components 2 --distance diffusion --weighting area --n-eigenpairs 40 --n-samples 70 "
        "--laplacian robust --keep-scale --no-cache"
    )
    assert run(mesh, "-o", out, *options.split()).exit_code == 0
    form = sampled_canonical_form(
        blob,
        n_components=2,
        distance="diffusion",
        weighting="area",
        n_eigenpairs=40,
        n_samples=70,
        laplacian="robust",
        keep_scale=True,
    )
    np.testing.assert_allclose(np.load(out), form.points, atol=1e-9)


def test_a_component_keeps_its_place_among_all_vertices(blob, tmp_path):
    both = np.vstack([blob.vertices + 20, blob.vertices, [[9, 9, 9]]])
    faces = np.vstack([blob.faces[:-2], blob.faces + blob.n_vertices])
    write_mesh(tmp_path / "both.ply", (both, faces))
    refused = run(tmp_path / "both.ply", "-o", tmp_path / "form.ply")
    assert refused.exit_code == 2
    assert "--component largest" in refused.stderr
    assert not (tmp_path / "form.ply").exists()
    done = run(tmp_path / "both.ply", "-o", tmp_path / "form.ply", "--component", 1)
    assert done.exit_code == 0
    assert "1 unreferenced vertex gets no values (NaN)" in done.stderr
    form = read_mesh(tmp_path / "form.ply")
    assert form.n_vertices == 2 * blob.n_vertices + 1
    assert np.isfinite(form.vertices).all(axis=1).sum() == blob.n_vertices
    assert set(map(tuple, form.faces)) <= set(map(tuple, faces))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["missing.off"], "there is no such file"),
        (["blob.off", "-o", "form.ply", "--n-components", "4"], "write the form as .npy or .csv"),
        (["blob.off", "-o", "form.stl"], 'unknown suffix ".stl"'),
        (["blob.off", "-o", "nowhere/form.ply"], "there is no folder nowhere"),
        (
            ["blob.off", "-o", "form.npy", "--n-components", "0"],
            "dimension must be a whole number from 1 to 641",
        ),
        (["blob.off", "--component", "x"], "must be largest or a number"),
        (
            ["blob.off", "--detail", "preserved", "--n-components", "2"],
            "at least 3 dimensions, not",
        ),
        (["blob.off", "--n-samples", "1"], "n_samples must be a whole number of at least 2"),
    ],
)
def test_mistakes_get_one_sentence_and_write_nothing(
    mesh, tmp_path, monkeypatch, arguments, message
):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    done = run(*arguments)
    assert done.exit_code == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("keep_scale", [False, True])
def test_the_surface_in_the_forms_pose_is_written_in_the_forms_unit(
    mesh, blob, tmp_path, keep_scale
):
    out = tmp_path / "posed.npy"
    done = run(mesh, "-o", out, "--detail", "preserved", "--json", *["--keep-scale"] * keep_scale)
    assert "detail" in json.loads(done.stdout)["files"][0]["steps"]
    form = canonical_form(blob)
    unit = 1 if keep_scale else np.sqrt(form.area)
    np.testing.assert_allclose(np.load(out), lay_into_pose(blob, form) / unit, atol=1e-6)


def test_the_surface_in_the_pose_of_a_form_of_more_dimensions_is_a_mesh(mesh, tmp_path):
    posed = ["--detail", "preserved", "--n-components", "4"]
    assert run(mesh, "-o", tmp_path / "posed.ply", *posed).exit_code == 0
    assert run(tmp_path / "posed.ply", mesh, "-o", tmp_path / "all", *posed).exit_code == 0
    assert {path.name for path in (tmp_path / "all").iterdir()} == {"blob.off", "posed.ply"}


def test_many_meshes_get_a_folder_of_forms_and_a_bad_one_is_listed(blob, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scans").mkdir()
    write_mesh("scans/a.off", blob)
    write_mesh("scans/b.stl", blob)
    (tmp_path / "scans" / "bad.ply").write_bytes(b"ply\nnothing more")
    done = run("scans", "-o", "forms")
    assert done.exit_code == 1, done.output
    assert [one.name for one in sorted((tmp_path / "forms").iterdir())] == ["a.off", "b.ply"]
    np.testing.assert_array_equal(read_mesh("forms/a.off").vertices, canonical_form(blob).points)
    head, *rows, last = done.stdout.splitlines()
    assert head.split() == ["mesh", "vertices", "faces", "stress", "time"]
    assert [row.split()[0] for row in rows] == ["scans/a.off", "scans/b.stl", "scans/bad.ply"]
    assert rows[0].split()[1:3] == ["642", "1,280"]
    assert rows[2].endswith("failed")
    assert last == "written: forms"
    assert run("scans").stdout.endswith("\nnext: add -o FOLDER to write the forms\n")
    assert "note: scans/b.stl: " in done.stderr
    assert "failed: scans/bad.ply: truncated" in done.stderr
    told = json.loads(run("scans", "--json").stdout)
    assert [one["file"] for one in told["files"]] == ["scans/a.off", "scans/b.stl"]
    assert [one["path"] for one in told["failed"]] == ["scans/bad.ply"]
    assert run("scans/a.off", "-o", "forms", "--n-components", 2).exit_code == 0
    for name in ("scans/b.stl", "scans/bad.ply"):
        (tmp_path / name).unlink()
    assert run("scans", "-o", "form_of_one").exit_code == 0
    assert [one.name for one in (tmp_path / "form_of_one").iterdir()] == ["a.off"]
    assert run("scans", "-o", "form.ply").exit_code == 0
    assert (tmp_path / "form.ply").is_file()
    assert np.load("forms/a.npy").shape == (642, 2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("a.off b/a.off -o forms", "a.off and b/a.off would both be written to forms/a.off"),
        ("a.off b/A.off -o forms", "a.off and b/A.off would both be written to forms/A.off"),
        ("a.off out.ply", "cannot read out.ply: there is no such file; or was -o meant?"),
        ("a.off c.off -o form.ply", "2 meshes need a folder to write to, and form.ply is a file"),
        ("a.off c.off -o form.vtp", "2 meshes need a folder to write to, and form.vtp is a file"),
        ("a.off c.off -o .", "./a.off is one of the inputs; give another place"),
        ("a.off c.off --report page.html", "is for one mesh and no folder; leave it out\n"),
        ("empty", "empty: it is a folder without .off, .obj, .ply, .stl, .vtk or .vtp files"),
    ],
)
def test_what_makes_no_sense_for_many_is_refused(blob, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    for folder in ("b", "empty"):
        (tmp_path / folder).mkdir()
    for path in ("a.off", "b/a.off", "c.off"):
        write_mesh(path, blob)
    before = sorted(tmp_path.rglob("*"))
    done = run(*arguments.split())
    assert done.exit_code == 2
    assert message in done.stderr
    assert sorted(tmp_path.rglob("*")) == before
